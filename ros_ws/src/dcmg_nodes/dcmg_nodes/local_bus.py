"""Delivery between nodes of one process without DDS, as rclcpp's intra-process communication does it.

In one process DDS would carry every message through its history caches and the executor's event queue: 2 ms a step of
the six-DGU grid, twice what the nodes themselves need. Here a message goes to a queue, by reference, and an executor
callback hands it to its readers one after the other; no node is ever called from inside another one.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rclpy.executors import Executor

_BATCH = 2000  # deliveries between two looks at services, timers and signals: about 10 ms


class LocalBus:
    """Readers by topic, and what still waits for them.

    Args:
        nodes: names of the nodes of this process.
    """

    def __init__(self, nodes: tuple[str, ...]) -> None:
        """Start without readers."""
        self.nodes = frozenset(nodes)
        self._readers: dict[str, list[Callable[[bytes], None]]] = {}
        self._second_readers: dict[str, list[Callable[[bytes], None]]] = {}
        self._waiting: deque[tuple[Callable[[bytes], None], bytes]] = deque()
        self._awake = False
        self._executor: Executor | None = None

    def attach(self, executor: Executor) -> None:
        """Let this executor do the deliveries, those that wait already, too."""
        self._executor = executor
        self._wake(executor)

    def add_reader(self, topic: str, on_bytes: Callable[[bytes], None]) -> None:
        """Hand every later message of a topic to `on_bytes`."""
        self._readers.setdefault(topic, []).append(on_bytes)

    def add_second_reader(self, topic: str, on_bytes: Callable[[bytes], None]) -> None:
        """Hand every later message of another publisher of a topic to `on_bytes`."""
        self._second_readers.setdefault(topic, []).append(on_bytes)

    def readers(self, topic: str) -> int:
        """Count the readers of a topic in this process."""
        return len(self._readers.get(topic, ()))

    def send(self, topic: str, data: bytes) -> None:
        """Queue one message for its readers."""
        self._queue(self._readers.get(topic, ()), data)

    def send_second(self, topic: str, data: bytes) -> None:
        """Queue one message of another publisher for its readers."""
        self._queue(self._second_readers.get(topic, ()), data)

    def _queue(self, readers: Iterable[Callable[[bytes], None]], data: bytes) -> None:
        for reader in readers:
            self._waiting.append((reader, data))
        if self._executor is not None:
            self._wake(self._executor)

    def _wake(self, executor: Executor) -> None:
        if self._waiting and not self._awake:
            self._awake = True
            executor.create_task(self._deliver, executor)

    def _deliver(self, executor: Executor) -> None:
        waiting = self._waiting
        for _ in range(_BATCH):
            if not waiting:
                self._awake = False
                return
            reader, data = waiting.popleft()
            reader(data)
        executor.create_task(self._deliver, executor)
