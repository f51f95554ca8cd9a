"""Records <-> bytes of the messages whose length varies."""

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bags.mcap.errors import BagError
from bags.mcap.typestore import typestore
from bags.wire.records import DesignRecord, DiagnosticLevel, HistoryRecord
from bags.wire.schema import RunTopics, run_topics
from dgu_sim.grid import Link
from dgu_sim.relay import Action, Origin, RelayEvent
from monitor.detectors import Phase
from monitor.link_monitor import MonitorOutput

QUIET = MonitorOutput(Phase.ARMED.value, False, (48.0, 9.0, 11.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # noqa: FBT003


@pytest.mark.parametrize("action", list(Action))
@pytest.mark.parametrize("origin", list(Origin))
def test_attack_event(topics: RunTopics, action: Action, origin: Origin) -> None:
    """An event of the relay comes back as it was."""
    event = RelayEvent(
        step=500, attack=3, link=Link(1, 2), action=action, kind="bias", parameters='{"bias": [1]}', origin=origin
    )
    codec = topics.attack_events()
    assert codec.decode(codec.encode(event)) == event


def test_history_keeps_every_bit(topics: RunTopics) -> None:
    """Matrices come back with their shapes and bits, an input matrix without columns included."""
    rng = np.random.default_rng(1)
    record = HistoryRecord(
        dgu=2,
        experiment=1,
        experiments=3,
        sampling_period_sec=0.01,
        u=np.empty((20, 0)),
        y=rng.normal(size=(20, 3))[::-1],
        x=rng.normal(size=(3, 20)).T,
        d=rng.normal(size=(20, 2)),
        w=np.empty((20, 0)),
    )
    codec = topics.history(2)
    back = codec.decode(codec.encode(record))
    for name in ("u", "y", "x", "d", "w"):
        assert np.array_equal(getattr(back, name), getattr(record, name))
    assert astuple(back)[:4] == astuple(record)[:4]


def test_history_with_wrong_shape_is_refused(topics: RunTopics) -> None:
    """Fewer numbers than announced are an error, not a reshaped matrix."""
    store, codec = typestore(), topics.history(2)
    record = HistoryRecord(
        dgu=2,
        experiment=0,
        experiments=1,
        sampling_period_sec=0.01,
        u=np.ones((4, 1)),
        y=np.ones((4, 3)),
        x=np.ones((4, 3)),
        d=np.empty((4, 0)),
        w=np.ones((4, 2)),
    )
    message = store.deserialize_cdr(codec.encode(record), "dcmg_msgs/msg/History")
    message.samples = 5  # type: ignore[attr-defined]
    with pytest.raises(BagError, match="u has 4 values, expected 5 rows of 1"):
        codec.decode(bytes(store.serialize_cdr(message, "dcmg_msgs/msg/History", little_endian=True)))


def test_design(topics: RunTopics) -> None:
    """A verdict in words and a JSON document come back, whatever letters they use."""
    record = DesignRecord(
        source=1, monitor=2, observer="full_order", accepted=False, verdict="refused: Ω too small", certificate="{}"
    )
    codec = topics.design(Link(1, 2))
    assert codec.decode(codec.encode(record)) == record


@pytest.mark.parametrize(
    ("phase", "alarm", "level"),
    [
        (Phase.REFUSED, False, DiagnosticLevel.STALE),
        (Phase.SETTLING, False, DiagnosticLevel.WARN),
        (Phase.CALIBRATING, False, DiagnosticLevel.WARN),
        (Phase.ARMED, False, DiagnosticLevel.OK),
        (Phase.ARMED, True, DiagnosticLevel.ERROR),
    ],
)
def test_diagnostics_levels(topics: RunTopics, phase: Phase, alarm: bool, level: DiagnosticLevel) -> None:  # noqa: FBT001
    """Each link of a monitor has its own level; the other link of DGU 1 stays OK."""
    codec = topics.diagnostics(1)
    assert codec.sources == (2, 3)
    data = codec.encode(0, [QUIET._replace(phase=phase.value, alarm=alarm, residual=(math.nan,) * 3), QUIET])
    assert codec.decode(data) == {2: level, 3: DiagnosticLevel.OK}
    message = typestore().deserialize_cdr(data, "diagnostic_msgs/msg/DiagnosticArray")
    first = message.status[0]  # type: ignore[attr-defined]
    assert (first.name, first.hardware_id) == ("monitor_1: link 2-1", "dgu_1")


@given(period_ns=st.integers(1_000, 3_000_000_000), steps=st.integers(1, 500))
def test_diagnostics_once_a_second(period_ns: int, steps: int) -> None:
    """Every whole second that a step reaches is told once, at the first step not before it; step 0 included."""
    codec = run_topics([1, 2], [Link(1, 2)], period_ns).diagnostics(2)
    told = [step * period_ns // 1_000_000_000 for step in range(steps) if codec.due(step)]
    reached = sorted({step * period_ns // 1_000_000_000 for step in range(steps)})
    assert told == reached


@given(data=st.binary(max_size=200))
def test_damaged_messages_are_refused(data: bytes) -> None:
    """Arbitrary bytes give a value or one line, never another exception."""
    topics = run_topics([1, 2], [Link(1, 2)], 1)
    for decode in (topics.attack_events().decode, topics.history(1).decode, topics.design(Link(1, 2)).decode):
        said = ""
        try:
            decode(b"\x00\x01\x00\x00" + data)
        except BagError as error:
            said = str(error)
        assert "\n" not in said


def test_unknown_action_is_refused(topics: RunTopics) -> None:
    """An action that the message does not define is an error."""
    codec = topics.attack_events()
    event = RelayEvent(
        step=1, attack=1, link=Link(1, 2), action=Action.STOP, kind="bias", parameters="{}", origin=Origin.SERVICE
    )
    message = typestore().deserialize_cdr(codec.encode(replace(event)), "dcmg_msgs/msg/AttackEvent")
    message.action = 9  # type: ignore[attr-defined]
    with pytest.raises(BagError, match="action 9"):
        codec.decode(bytes(typestore().serialize_cdr(message, "dcmg_msgs/msg/AttackEvent", little_endian=True)))
