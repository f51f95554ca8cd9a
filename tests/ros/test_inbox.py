"""The firing rule, and the recorder's order, as pure code."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from bags.mcap.topic import TopicKind
from bags.wire.schema import RunTopics, run_topics
from dcmg_nodes.assembler import Assembler
from dcmg_nodes.inbox import Inbox
from dgu_sim.grid import Link
from dgu_sim.records import Sample
from dgu_sim.unit import UnitOutput
from monitor.link_monitor import MonitorOutput

STEPS = 3
PERIOD_NS = 500_000_000  # a diagnostics message at steps 0 and 2


@given(st.permutations([slot for slot in range(3) for _ in range(4)]))
def test_inbox_fires_in_order_whatever_the_arrival(arrivals: list[int]) -> None:
    """However the inputs interleave, firing k takes the k-th token of each, as soon as the last of them is in."""
    inbox: Inbox[int] = Inbox(["a", "b", "c"])
    sent, fired = [0, 0, 0], []
    for slot in arrivals:
        tokens = inbox.push(slot, sent[slot])
        sent[slot] += 1
        while tokens is not None:
            fired.append(tokens)
            tokens = inbox.take()
        assert len(fired) == min(sent)
    assert fired == [[step] * 3 for step in range(4)]


def test_primed_inputs_do_not_hold_up_the_first_firing() -> None:
    """A primed input gives None first; `missing` names what the next firing waits for."""
    inbox: Inbox[str] = Inbox(["tick", "state"], primed=frozenset({"state"}))
    assert inbox.missing() == ("tick",)
    assert inbox.push(0, "0") == ["0", None]
    assert inbox.push(0, "1") is None
    assert inbox.missing() == ("state",)


def messages(topics: RunTopics) -> dict[str, list[bytes]]:
    """What the nodes of a two-DGU run of three steps publish, by topic, with one alarm at step 1."""
    quiet = MonitorOutput(3, alarm=False, estimate=(0.0,) * 3, residual=(0.0,) * 3, threshold=(1.0,) * 3)
    sample = Sample(y=(1.0, 2.0, 3.0))
    state = UnitOutput(x=sample.y, y=sample.y, load_current=4.0, reference=5.0, alpha=0.0)
    found: dict[str, list[bytes]] = {}
    for step in range(STEPS):
        published = {
            topics.clock().topic.name: topics.clock().encode(step),
            topics.tick().topic.name: topics.tick().encode(step),
            **{topics.output(dgu).topic.name: topics.output(dgu).encode(step, sample) for dgu in topics.dgus},
            **{topics.received(link).topic.name: topics.received(link).encode(step, sample) for link in topics.links},
            **{topics.residual(link).topic.name: topics.residual(link).encode(step, quiet) for link in topics.links},
        }
        for dgu in topics.dgus:
            codec = topics.state(dgu)
            published[codec.topic.name] = codec.encode(step, state)
        for name, data in published.items():
            found.setdefault(name, []).append(data)
    found[topics.alarms(2).topic.name] = [topics.alarms(2).encode(1, 1, quiet)]
    name = topics.diagnostics(1).topic.name
    found[name] = [topics.diagnostics(dgu).encode(step, [quiet]) for step in (0, 2) for dgu in topics.monitors]
    return found


@given(st.randoms(use_true_random=False))
@settings(max_examples=50, deadline=None)  # the first example reads the message definitions
def test_assembler_puts_any_arrival_into_one_order(random: object) -> None:
    """Topics may interleave in any way: the steps come out complete, in canonical order, none missing."""
    topics = run_topics((1, 2), (Link(1, 2), Link(2, 1)), PERIOD_NS)
    by_name = {topic.name: topic for topic in topics.all}
    published = messages(topics)
    queue = [name for name, data in published.items() for _ in data]
    random.shuffle(queue)  # type: ignore[attr-defined]  # hypothesis gives a random.Random
    assembler, taken, position = Assembler(topics), [], dict.fromkeys(published, 0)
    for name in queue:
        taken += assembler.push(by_name[name], published[name][position[name]])
        position[name] += 1
    taken += assembler.drain()
    assert assembler.complete == STEPS
    assert assembler.overdue() is not None  # of step 3, which nobody has published
    assert sorted(one.data for one in taken) == sorted(data for all_data in published.values() for data in all_data)
    per_step = [one.topic.name for one in taken if one.topic.kind is TopicKind.PER_STEP]
    assert per_step == [topic.name for topic in topics.per_step] * STEPS
