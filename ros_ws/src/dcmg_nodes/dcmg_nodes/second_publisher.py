"""Spoofed links: how their readers learn of a second publisher before it speaks.

The attacker asks on /run/second_publisher and relays nothing more until every reader of the link's messages has
answered: it is matched with the second publisher, and it knows of which steps there will be two messages. This is run
control, as the clock's ticks are: it makes the run the same every time, and tells neither DGUs nor guards anything.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dcmg_msgs.msg import SecondPublisher

from dcmg_nodes.ports import CONTROL_OUT_QOS, CONTROL_QOS
from dcmg_nodes.wiring import SECOND, SECOND_MATCHED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from bags.mcap.topic import Topic
    from dcmg_nodes.ports import Ports
    from dgu_sim.grid import Link
    from dgu_sim.relay import Spoofing

_UNKNOWN = 2**64 - 1
_POLL_SEC = 0.01


class SecondPublishers:
    """The attacker's side: opens publishers, asks, and knows whether everybody has answered.

    Args:
        ports: of the attacker.
        on_ready: called when the last answer is in.
    """

    def __init__(self, ports: Ports, on_ready: Callable[[], None]) -> None:
        """Create the question's publisher and listen to answers."""
        self._ports = ports
        self._on_ready = on_ready
        self._told: dict[tuple[Link, int], int] = {}
        self._number = 0
        self._awaited: set[tuple[int, str]] = set()
        self._waiting_for_readers: list[tuple[Topic, SecondPublisher]] = []
        node = ports.node
        self._question = node.create_publisher(SecondPublisher, SECOND, CONTROL_OUT_QOS)
        self._answers = node.create_subscription(SecondPublisher, SECOND_MATCHED, self._on_answer, CONTROL_QOS)

    def tell(self, spoofings: Sequence[Spoofing], step: int) -> bool:
        """Tell all readers what changes at a step; return whether they know already.

        Args:
            spoofings: where second publishers speak or will.
            step: the next step to relay.
        """
        if not (spoofings or self._told):
            return True
        now = {
            (one.link, one.first_step): _UNKNOWN if one.end_step is None else one.end_step
            for one in spoofings
            if one.first_step <= step
        }
        ended = {key: step for key, end in self._told.items() if key not in now and end > step}
        for key, end in (now | ended).items():
            if self._told.get(key) != end:
                self._told[key] = end
                self._ask(*key, end)
        return not self._awaited

    def send(self, link: Link, data: bytes) -> None:
        """Publish one message as the second publisher of a link."""
        self._ports.publish_second(self._ports.wiring.topics.received(link).topic, data)

    def _ask(self, link: Link, first: int, end: int) -> None:
        topic = self._ports.wiring.topics.received(link).topic
        self._ports.open_second(topic)
        self._number += 1
        question = SecondPublisher(
            number=self._number, source=link.source, target=link.target, first_step=first, end_step=end
        )
        self._awaited |= {(self._number, reader) for reader in self._ports.wiring.readers(topic)}
        if not self._waiting_for_readers:
            self._timer = self._ports.node.create_timer(_POLL_SEC, self._ask_when_matched)
        self._waiting_for_readers.append((topic, question))

    def _ask_when_matched(self) -> None:
        """Ask once the publisher is matched with all readers; they look whether they are matched with it."""
        late = []
        for topic, question in self._waiting_for_readers:
            if self._ports.second_is_matched(topic):
                self._question.publish(question)
            else:
                late.append((topic, question))
        self._waiting_for_readers = late
        if not late:
            self._ports.node.destroy_timer(self._timer)

    def _on_answer(self, answer: SecondPublisher) -> None:
        self._awaited.discard((answer.number, answer.node))
        if not self._awaited:
            self._on_ready()


class SecondPublisherReaders:
    """A reader's side: passes on what to expect, and answers once it is matched with both publishers.

    Args:
        ports: of the reader.
        links: whose messages it reads.
        expect: called with link, first step and end step.
    """

    def __init__(self, ports: Ports, links: Iterable[Link], expect: Mapping[Link, Callable[[int, int], None]]) -> None:
        """Listen to questions."""
        self._ports = ports
        self._links = {(link.source, link.target): link for link in links}
        self._expect = expect
        self._open: list[tuple[Topic, SecondPublisher]] = []
        node = ports.node
        self._answer = node.create_publisher(SecondPublisher, SECOND_MATCHED, CONTROL_OUT_QOS)
        self._questions = node.create_subscription(SecondPublisher, SECOND, self._on_question, CONTROL_QOS)

    def _on_question(self, question: SecondPublisher) -> None:
        link = self._links.get((question.source, question.target))
        if link is None:
            return
        self._expect[link](question.first_step, question.end_step)
        if not self._open:
            self._timer = self._ports.node.create_timer(_POLL_SEC, self._answer_when_matched)
        self._open.append((self._ports.wiring.topics.received(link).topic, question))

    def _answer_when_matched(self) -> None:
        late = []
        for topic, question in self._open:
            if self._ports.hears_second(topic):
                question.node = self._ports.name
                self._answer.publish(question)
            else:
                late.append((topic, question))
        self._open = late
        if not late:
            self._ports.node.destroy_timer(self._timer)
