"""The player's part for nodes that run on replayed data: it stands in for every node of the run that is not there.

It lets them become ready, keeps the replay at most a window of steps ahead of what they conclude, and holds their
conclusions against the recorded ones.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from dcmg_msgs.msg import NodeDone, Ready, RunEnd, SecondPublisher
from rclpy.task import Future

from bags.mcap.topic import TopicKind
from dcmg_nodes.ports import CONTROL_OUT_QOS, CONTROL_QOS, data_qos, message_class
from dcmg_nodes.wiring import DONE, END, READY, SECOND, SECOND_MATCHED

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rclpy.node import Node
    from rclpy.subscription import Subscription

    from bags.mcap.topic import Topic
    from bags.runs.playback import Playback
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.grid import Link

WINDOW = 16  # steps ahead of the slowest node; far below the queue depth of a topic


class StandIn:
    """Every node of a run but the live ones, as far as the live ones can tell.

    Args:
        node: the player's.
        wiring: static graph of the recorded run.
        live: names of the nodes that run on the replayed data.
        doubled: steps [start, stop) in which a second publisher speaks on a link.
    """

    def __init__(
        self, node: Node, wiring: Wiring, live: Sequence[str], doubled: Mapping[Link, Sequence[tuple[int, int]]]
    ) -> None:
        """Subscribe to what the live nodes publish, as often as they expect."""
        self._progress: Future = Future()
        self._period_ns = wiring.topics.sampling_period_ns
        self._waiting = set(live)
        self._counts: dict[str, int] = {}  # of the topics with one message a step
        self._expected: dict[str, deque[bytes]] = {}
        self._found: dict[str, deque[bytes]] = {}
        self._same: dict[str, int] = {}
        self._different: dict[str, int] = {}
        self._subscriptions: list[Subscription] = []
        held, needed = live_topics(wiring, live)
        self._needed = {topic.name: sum(reader in live for reader in wiring.readers(topic)) for topic in needed}
        for topic in held:
            if topic.kind is TopicKind.PER_STEP:
                self._counts[topic.name] = 0
            # not the designs: their certificates are worded by the version; nor, for its order, what several publish
            if topic.kind is not TopicKind.LATCHED and len(topic.publishers) == 1:
                self._expected[topic.name], self._found[topic.name] = deque(), deque()
                self._same[topic.name] = self._different[topic.name] = 0
            absent = sum(reader not in live for reader in wiring.readers(topic))
            kind, qos = message_class(topic.type_name), data_qos(topic)
            for number in range(max(absent, 1)):
                receive = _ignore if number else partial(self._receive, topic.name)
                self._subscriptions.append(node.create_subscription(kind, topic.name, receive, qos, raw=True))
        told = [(link, first, end) for link, intervals in doubled.items() for first, end in intervals]
        self._doubled = [
            (
                link,
                SecondPublisher(number=number, source=link.source, target=link.target, first_step=first, end_step=end),
            )
            for number, (link, first, end) in enumerate(told, start=1)
        ]
        self._readers = {link: set(wiring.readers(wiring.topics.received(link).topic)) & set(live) for link in doubled}
        self._unanswered: set[tuple[int, str]] = set()
        self._question = node.create_publisher(SecondPublisher, SECOND, CONTROL_OUT_QOS)
        self._answers = node.create_subscription(SecondPublisher, SECOND_MATCHED, self._on_answer, CONTROL_QOS)
        self._ready = node.create_subscription(Ready, READY, self._on_ready, CONTROL_QOS)
        self._done = node.create_subscription(NodeDone, DONE, lambda _message: None, CONTROL_QOS)
        self._end = node.create_publisher(RunEnd, END, CONTROL_OUT_QOS)

    @property
    def not_ready(self) -> tuple[str, ...]:
        """Names of the live nodes that have not announced themselves, or not answered."""
        return tuple(sorted(self._waiting | {node for _, node in self._unanswered}))

    @property
    def needed(self) -> dict[str, int]:
        """How many live nodes read each topic that the player has to publish."""
        return self._needed

    @property
    def steps(self) -> int:
        """Number of steps from which the live nodes have drawn all their conclusions."""
        return min(self._counts.values(), default=0)

    @property
    def slowest(self) -> str:
        """The topic on which the next conclusion is missing, "" when none ever comes."""
        return min(self._counts, key=self._counts.__getitem__, default="")

    def next_progress(self) -> Future:
        """Return what is done as soon as another step is complete."""
        self._progress = Future()
        return self._progress

    def allows(self, time_ns: int) -> bool:
        """Whether the live nodes are far enough for the messages of a stamp."""
        return not self._counts or time_ns // self._period_ns < self.steps + WINDOW

    def caught_up(self, time_ns: int) -> bool:
        """Whether the live nodes have concluded from the step of a stamp."""
        return not self._counts or time_ns // self._period_ns < self.steps

    def expect(self, name: str, data: bytes) -> None:
        """Note what was recorded of a topic that a live node publishes."""
        if name in self._expected:
            self._expected[name].append(data)
            self._compare(name)

    def comparison(self) -> dict[str, tuple[int, int]]:
        """Number of equal and of different messages of each live topic; one without its counterpart is different."""
        return {
            name: (same, self._different[name] + len(self._expected[name]) + len(self._found[name]))
            for name, same in self._same.items()
        }

    def end(self) -> None:
        """Tell the live nodes that they may leave."""
        self._end.publish(RunEnd(steps=self.steps, lost=0))

    @property
    def listeners(self) -> int:
        """Number of nodes that still wait to be told."""
        count: int = self._end.get_subscription_count()
        return count

    def ask(self) -> None:
        """Tell the readers of spoofed links of which steps there will be two messages, as the attacker did."""
        for link, question in self._doubled:
            self._unanswered |= {(question.number, reader) for reader in self._readers[link]}
            self._question.publish(question)

    def _on_answer(self, answer: SecondPublisher) -> None:
        self._unanswered.discard((answer.number, answer.node))

    def _on_ready(self, message: Ready) -> None:
        self._waiting.discard(message.node)

    def _receive(self, name: str, data: bytes) -> None:
        if name in self._found:
            self._found[name].append(data)
            self._compare(name)
        if name in self._counts:
            before = self.steps
            self._counts[name] += 1
            if self.steps > before and not self._progress.done():
                self._progress.set_result(None)

    def _compare(self, name: str) -> None:
        expected, found = self._expected[name], self._found[name]
        while expected and found:
            counts = self._same if expected.popleft() == found.popleft() else self._different
            counts[name] += 1


def live_topics(wiring: Wiring, live: Sequence[str]) -> tuple[list[Topic], list[Topic]]:
    """Return the topics that live nodes publish, and those that they read and others must publish."""
    held = [topic for topic in wiring.topics.all if set(topic.publishers) & set(live)]
    read = [topic for topic in wiring.topics.all if set(wiring.readers(topic)) & set(live)]
    return held, [topic for topic in read if topic not in held]


def doubled_steps(wiring: Wiring, playback: Playback) -> dict[Link, list[tuple[int, int]]]:
    """Steps [start, stop) of which a bag has messages of a second publisher, by link."""
    period_ns = wiring.topics.sampling_period_ns
    found = {}
    for link in wiring.topics.links:
        steps = (stamp // period_ns for stamp in playback.stamps(wiring.topics.second(link).topic.name))
        intervals = intervals_of(steps)
        if intervals:
            found[link] = intervals
    return found


def intervals_of(steps: Iterable[int]) -> list[tuple[int, int]]:
    """Ascending steps as intervals [start, stop)."""
    found: list[tuple[int, int]] = []
    for step in steps:
        if found and step <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], step + 1))
        else:
            found.append((step, step + 1))
    return found


def _ignore(_data: bytes) -> None:
    """Be a reader that the live nodes count on."""
