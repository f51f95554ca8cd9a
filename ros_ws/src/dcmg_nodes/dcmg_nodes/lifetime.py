"""How long a process lives: until all its nodes have left, or one has failed."""

from __future__ import annotations

from rclpy.task import Future


class Lifetime:
    """Shared by the nodes of one process.

    Args:
        nodes: names of the nodes that must leave before the process ends.
    """

    def __init__(self, nodes: tuple[str, ...]) -> None:
        """Start with every node alive."""
        self.over: Future = Future()
        self.failure: str | None = None
        self.nodes = len(nodes)
        self._alive = set(nodes)

    def leave(self, node: str) -> None:
        """Note that `node` has nothing left to do."""
        self._alive.discard(node)
        if not self._alive:
            self._end()

    def fail(self, node: str, reason: str) -> None:
        """End the process because `node` cannot go on."""
        self.failure = self.failure or f"{node}: {reason}"
        self._end()

    def interrupt(self) -> None:
        """End the process early, without a failure."""
        self._end()

    def _end(self) -> None:
        if not self.over.done():
            self.over.set_result(None)
