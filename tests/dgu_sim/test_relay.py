"""The relay on the communication links."""

import json
import math

import pytest

from dgu_sim.errors import AttackError
from dgu_sim.grid import Link, links_of
from dgu_sim.records import Sample
from dgu_sim.relay import Action, AttackPlan, Origin, Relay, RelayEvent, RelayState

RELAY = Relay(dgus=(1, 2, 3), links=links_of([(1, 2), (2, 3)]), sampling_period_sec=0.01)
OUTPUTS = [Sample(y=(10.0 * dgu, 1.0 * dgu, 0.1 * dgu)) for dgu in RELAY.dgus]
BIAS: dict[str, object] = {"bias": [1.0, 2.0, 3.0]}
LINK = Link(1, 2)
POSITION = RELAY.links.index(LINK)


def _plan(start_sec: float, stop_sec: float | None = None, link: Link = LINK) -> AttackPlan:
    return AttackPlan(links=(link,), kind="bias", parameters=BIAS, start_sec=start_sec, stop_sec=stop_sec)


def _run(state: RelayState, steps: int) -> tuple[RelayState, list[bool], list[RelayEvent]]:
    """Relay some steps; say at which ones LINK was attacked."""
    attacked: list[bool] = []
    events: list[RelayEvent] = []
    for _ in range(steps):
        state, samples, occurred = RELAY.step(state, OUTPUTS)
        attacked.append(samples[POSITION] is not OUTPUTS[0])
        events += occurred
    return state, attacked, events


def test_transparent_without_attack() -> None:
    """Every link hands on the very sample of its source, in the order of the links."""
    _, samples, events = RELAY.step(RELAY.init(), OUTPUTS)
    assert [str(link) for link in RELAY.links] == ["2-1", "1-2", "3-2", "2-3"]
    assert [sample is OUTPUTS[index] for sample, index in zip(samples, (1, 0, 2, 1), strict=True)] == [True] * 4
    assert events == ()


def test_scheduled_attack_affects_start_to_stop_and_reports_both() -> None:
    """Samples from start_sec up to but excluding stop_sec are attacked; both events carry the step."""
    state, attacked, events = _run(RELAY.init([_plan(0.03, 0.05)]), 8)
    assert attacked == [False, False, False, True, True, False, False, False]
    assert [(event.step, event.action) for event in events] == [(3, Action.START), (5, Action.STOP)]
    assert events[0].attack == 1
    assert events[0].link == LINK
    assert events[0].origin is Origin.SCENARIO
    assert json.loads(events[0].parameters) == BIAS
    assert state.attacks == ()


def test_attack_between_two_samples_has_one() -> None:
    """A window shorter than T_s affects the next sample, and START comes before STOP."""
    _, attacked, events = _run(RELAY.init([_plan(0.031, 0.035)]), 7)
    assert attacked == [False] * 4 + [True] + [False] * 2
    assert [(event.step, event.action) for event in events] == [(4, Action.START), (5, Action.STOP)]


def test_other_links_stay_clean() -> None:
    """An attack on 1-2 changes nothing on the links of others."""
    state = RELAY.init([_plan(0.0)])
    _, samples, _ = RELAY.step(state, OUTPUTS)
    assert list(samples[POSITION].y) == [10.0 + 1.0, 1.0 + 2.0, 0.1 + 3.0]
    for position, source in ((0, 1), (2, 2), (3, 1)):
        assert samples[position] is OUTPUTS[source]


def test_service_attack_starts_with_the_next_sample_and_ends_by_duration() -> None:
    """START is returned at once, with the step of the first affected sample; the end is reported by step."""
    state, _, _ = _run(RELAY.init(), 4)
    state, started = RELAY.start(state, LINK, "bias", BIAS, 0.02)
    assert (started.step, started.action, started.origin) == (4, Action.START, Origin.SERVICE)
    _, attacked, events = _run(state, 4)
    assert attacked == [True, True, False, False]
    assert [(event.step, event.action) for event in events] == [(6, Action.STOP)]


def test_service_attack_stays_until_stopped() -> None:
    """Without a duration it stays; stop returns the event with the first clean sample."""
    state, _ = RELAY.start(RELAY.init(), LINK, "bias", BIAS)
    state, attacked, _ = _run(state, 5)
    assert attacked == [True] * 5
    state, events = RELAY.stop(state, LINK)
    assert [(event.step, event.action) for event in events] == [(5, Action.STOP)]
    _, attacked, later = _run(state, 2)
    assert attacked == [False, False]
    assert later == []


def test_attack_can_be_stopped_before_its_first_sample() -> None:
    """Started and stopped between two steps: START and STOP carry the same step and nothing is attacked."""
    state, started = RELAY.start(RELAY.init(), LINK, "bias", BIAS)
    state, (stopped,) = RELAY.stop(state, LINK)
    assert (started.step, stopped.step) == (0, 0)
    assert _run(state, 2)[1:] == ([False, False], [])


def test_stop_leaves_scheduled_attacks() -> None:
    """Stopping what is active keeps what the scenario has planned for later."""
    state = RELAY.init([_plan(0.0), _plan(0.05)])
    state, _, _ = _run(state, 2)
    state, events = RELAY.stop(state, LINK)
    assert [event.attack for event in events] == [1]
    _, attacked, _ = _run(state, 4)
    assert attacked == [False, False, False, True]


def test_two_attacks_on_one_link_add_up() -> None:
    """They act in the order of their numbers."""
    state, _ = RELAY.start(RELAY.init([_plan(0.0)]), LINK, "bias", {"bias": [0.5, 0.0, 0.0]})
    _, samples, _ = RELAY.step(state, OUTPUTS)
    assert samples[POSITION].y[0] == 10.0 + 1.0 + 0.5


def test_pending_lists_active_and_scheduled() -> None:
    """Each entry has its START event and its stop time, NaN when it is told to stop."""
    state, _ = RELAY.start(RELAY.init([_plan(0.05, 0.07)]), Link(2, 3), "bias", BIAS)
    (first, first_stop), (second, second_stop) = RELAY.pending(state)
    assert (first.attack, first.step) == (1, 5)
    assert first_stop == pytest.approx(0.07)
    assert (second.attack, second.step, str(second.link)) == (2, 0, "2-3")
    assert math.isnan(second_stop)


@pytest.mark.parametrize(
    ("link", "kind", "parameters", "duration_sec", "said"),
    [
        (Link(1, 3), "bias", BIAS, 0.0, "link 1-3: expected a communication link of this run: 2-1, 1-2, 3-2, 2-3"),
        (LINK, "nope", BIAS, 0.0, "expected an attack class"),
        (LINK, "bias", {"bias": [1.0]}, 0.0, "expected 3 numbers"),
        (LINK, "bias", BIAS, -1.0, "duration_sec = -1: expected a length"),
        (LINK, "bias", BIAS, math.nan, "duration_sec = nan: expected a length"),
    ],
)
def test_wrong_start_is_refused_in_one_line(
    link: Link, kind: str, parameters: dict[str, object], duration_sec: float, said: str
) -> None:
    """A link that is not there, an unknown class, a wrong vector or duration: one line, nothing started."""
    with pytest.raises(AttackError) as caught:
        RELAY.start(RELAY.init(), link, kind, parameters, duration_sec)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_nothing_to_stop_is_an_error() -> None:
    """Stopping a quiet link, or one that does not exist, says so."""
    with pytest.raises(AttackError, match="link 1-2: no attack is active"):
        RELAY.stop(RELAY.init([_plan(0.05)]), LINK)
    with pytest.raises(AttackError, match="link 3-1: expected a communication link"):
        RELAY.stop(RELAY.init(), Link(3, 1))
