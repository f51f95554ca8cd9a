"""The recorded topics of a run."""

import pytest

from bags.mcap.qos import Durability
from bags.mcap.topic import TopicKind
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.grid import Link

LINKS = (Link(2, 1), Link(1, 2), Link(3, 2), Link(2, 3))


@pytest.fixture(name="chain")
def _chain() -> RunTopics:
    return run_topics([3, 1, 2], LINKS[::-1], 10_000_000)


def test_canonical_order(chain: RunTopics) -> None:
    """Per-step topics, then events, then latched ones; DGUs ascend, links go by target and source."""
    assert [topic.name for topic in chain.all] == [
        "/clock",
        "/tick",
        *(f"/dgu_{dgu}/state" for dgu in (1, 2, 3)),
        *(f"/dgu_{dgu}/output" for dgu in (1, 2, 3)),
        *(f"/dgu_{link.target}/received/dgu_{link.source}" for link in LINKS),
        *(f"/dgu_{link.target}/residual/dgu_{link.source}" for link in LINKS),
        *(f"/dgu_{dgu}/alarms" for dgu in (1, 2, 3)),
        *(f"/dgu_{dgu}/stream" for dgu in (1, 2, 3)),
        "/attacks/events",
        "/diagnostics",
        *(f"/dgu_{dgu}/history" for dgu in (1, 2, 3)),
        *(f"/dgu_{link.target}/design/dgu_{link.source}" for link in LINKS),
    ]


def test_kinds_and_layouts(chain: RunTopics) -> None:
    """Every per-step topic has a fixed layout: that is what makes blocks possible."""
    assert chain.per_step == tuple(topic for topic in chain.all if topic.kind is TopicKind.PER_STEP)
    assert all(topic.layout is not None for topic in chain.per_step)
    assert len(chain.per_step) == 2 + 2 * 3 + 2 * 4


def test_every_topic_has_its_publishers(chain: RunTopics) -> None:
    """Each topic belongs to one node, except /diagnostics, which every monitor publishes."""
    nodes = ["clock", "attacker", *(f"{kind}_{dgu}" for dgu in (1, 2, 3) for kind in ("dgu", "monitor"))]
    owned = [topic.name for node in nodes for topic in chain.published_by(node)]
    assert sorted(set(owned)) == sorted(topic.name for topic in chain.all)
    shared = {name for name in owned if owned.count(name) > 1}
    assert shared == {"/diagnostics"}
    assert chain.monitors == (1, 2, 3)
    assert chain.sources(2) == (1, 3)


def test_quality_of_service(chain: RunTopics) -> None:
    """Latched topics and events are kept for late subscribers; all others hold a thousand messages in flight."""
    for topic in chain.all:
        kept = topic.kind is not TopicKind.PER_STEP
        assert topic.qos.durability is (Durability.TRANSIENT_LOCAL if kept else Durability.VOLATILE)
        assert topic.qos.depth == (64 if topic.kind is TopicKind.LATCHED else 1000)


def test_isolated_dgu_has_no_monitor() -> None:
    """Without links there is nothing to monitor, and there are no diagnostics."""
    alone = run_topics([1], [], 10_000_000)
    assert alone.monitors == ()
    assert "/diagnostics" not in [topic.name for topic in alone.all]


def test_stamps_count_sampling_periods(chain: RunTopics) -> None:
    """The stamp of step k is k T_s, as integers."""
    assert chain.stamp_ns(123) == 1_230_000_000
