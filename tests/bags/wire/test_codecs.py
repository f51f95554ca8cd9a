"""Records <-> wire bytes of the fixed-length messages."""

import math

from bags.mcap.typestore import typestore
from bags.wire.schema import RunTopics
from dgu_sim.grid import Link
from dgu_sim.records import Physical, Sample
from dgu_sim.unit import UnitOutput
from monitor.link_monitor import MonitorOutput

STEP = 12_345  # 123.45 s
VERDICT = MonitorOutput(3, True, (48.0, 9.0, 11.0), (0.1, math.nan, -0.0), (1e-6, 2e-6, 3e-6))  # noqa: FBT003


def test_clock_and_tick(topics: RunTopics) -> None:
    """Simulated time comes back in nanoseconds, the tick as its step."""
    assert topics.clock().decode(topics.clock().encode(STEP)) == 123_450_000_000
    assert topics.tick().decode(topics.tick().encode(STEP)) == (STEP, ())


def test_state_gives_neighbours_what_they_may_know(topics: RunTopics) -> None:
    """A coupled DGU gets state, load and reference; alpha stays in the message for the recorder."""
    output = UnitOutput(x=(48.0, 9.0, 11.0), y=(0.0, 0.0, 0.0), load_current=10.0, reference=48.1, alpha=0.1)
    codec = topics.state(2)
    assert codec.decode(codec.encode(STEP, output)) == (
        STEP,
        Physical(x=(48.0, 9.0, 11.0), load_current=10.0, reference=48.1),
    )
    message = typestore().deserialize_cdr(codec.encode(STEP, output), "dcmg_msgs/msg/State")
    assert (message.alpha, message.dgu, message.header.frame_id) == (0.1, 2, "dgu_2")  # type: ignore[attr-defined]


def test_outputs_and_lost_samples(topics: RunTopics) -> None:
    """A sample comes back as it was, also one that the link lost; the frame names the DGU that measured it."""
    codec = topics.received(Link(1, 2))
    sample = Sample(y=(48.0, 9.0, 11.0))
    assert codec.decode(codec.encode(STEP, sample)) == (STEP, sample)
    step, lost = codec.decode(codec.encode(STEP, Sample(y=(math.nan,) * 3, delivered=False)))
    assert step == STEP
    assert not lost.delivered
    assert all(math.isnan(float(component)) for component in lost.y)
    message = typestore().deserialize_cdr(codec.encode(STEP, sample), "dcmg_msgs/msg/Output")
    assert (message.header.frame_id, message.header.stamp.sec) == ("dgu_1", 123)  # type: ignore[attr-defined]


def test_residual(topics: RunTopics) -> None:
    """A verdict comes back with every component, NaN and negative zero included."""
    codec = topics.residual(Link(1, 2))
    step, verdict = codec.decode(codec.encode(STEP, VERDICT))
    assert step == STEP
    assert (verdict.phase, verdict.alarm) == (VERDICT.phase, VERDICT.alarm)
    for name in ("estimate", "residual", "threshold"):
        assert repr(tuple(getattr(verdict, name))) == repr(getattr(VERDICT, name))


def test_alarm(topics: RunTopics) -> None:
    """An alarm names the accused link, and what was seen when it started."""
    codec = topics.alarms(2)
    alarm = codec.decode(codec.encode(STEP, 1, VERDICT))
    assert (alarm.step, alarm.source, alarm.monitor, alarm.active) == (STEP, 1, 2, True)
    assert repr(alarm.residual) == repr(VERDICT.residual)
    assert alarm.threshold == VERDICT.threshold
