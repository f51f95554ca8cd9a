"""What if: two futures of one moment, with an attack and without, and what lies between them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bags.runs.following import Followed
from bags.runs.live import LiveRun
from dcmg.page.attack_forms import order_of
from dcmg.page.board import arrow, numbers
from dcmg.page.messages import Attack, Band, Forecast, WhatIf
from dcmg.page.source import RefusalError
from dcmg.page.trace import extremes
from dgu_sim.errors import DguSimError
from dgu_sim.grid import Link
from dgu_sim.linear import FloatArray
from dgu_sim.scenario import Scenario
from dgu_sim.stealthy_damage import Goal, Limits, Responses, largest_damage, responses_of

_COLUMNS, _MOST_LINKS = 250, 60
_PLAUSIBLE = Limits(load_a=5.0, load_rate_a=1.0, reference_v=0.5, reference_rate_v=0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Futures:
    """Two futures of one moment.

    Attributes:
        calm: Nothing new is done.
        attacked: An attack is started.
        attacks: What is started: links of each attack.
    """

    calm: Followed
    attacked: Followed
    attacks: Sequence[tuple[Link, ...]]


class Foresight:
    """Plays attacks ahead.

    Args:
        fork: A run that goes on from the moment that is shown; raises RefusalError.
    """

    def __init__(self, fork: Callable[[], LiveRun]) -> None:
        """Know nothing yet."""
        self._fork = fork
        self._responses: dict[int, Responses] = {}

    def fork(self) -> LiveRun:
        """The moment; whoever calls has the lock."""
        return self._fork()

    def ask(self, run: LiveRun, asked: WhatIf) -> Forecast:
        """Play ahead from a fork, which nobody else has.

        Raises:
            RefusalError: The attack cannot be started there.
        """
        steps = max(1, round(asked.horizon_sec / run.scenario.sampling_period_sec))
        if asked.worst:
            attacks, said = self._worst(run, steps)
        else:
            attacks, said = [_ordered(asked)], []
        return forecast(run, futures(run, attacks, steps), asked, said)

    def _worst(
        self, run: LiveRun, steps: int
    ) -> tuple[list[tuple[tuple[Link, ...], str, dict[str, object]]], list[str]]:
        """The attacks of the largest-damage programme; what one ampere on a link does is the same at every moment."""
        scenario = run.scenario
        if len(scenario.links) > _MOST_LINKS:
            raise RefusalError(f"the worst attack of {len(scenario.links)} links: expected at most {_MOST_LINKS} here")
        rise_sec = max(scenario.sampling_period_sec, steps * scenario.sampling_period_sec / 5)
        try:
            if steps not in self._responses:
                self._responses[steps] = _responses(scenario, steps, rise_sec)
            damage = largest_damage(self._responses[steps], _PLAUSIBLE, Goal.MEAN_VOLTAGE)
        except DguSimError as error:
            raise RefusalError(str(error)) from error
        currents = ", ".join(f"{arrow(link)} {current:+.3g} A" for link, current in damage.currents.items())
        said = [
            f"uio_stealthy_trajectory on {len(damage.currents)} links: {currents}",
            f"within what is plausible: loads ±{_PLAUSIBLE.load_a:g} A, references ±{_PLAUSIBLE.reference_v:g} V",
        ]
        more = {"rise_sec": damage.rise_sec, "knowledge": "model", "anyway": True}
        return [
            ((link,), "uio_stealthy_trajectory", {"current_a": current, **more})
            for link, current in damage.currents.items()
        ], said


def futures(run: LiveRun, attacks: Sequence[tuple[tuple[Link, ...], str, Mapping[str, object]]], steps: int) -> Futures:
    """Let a fork go on twice; raises RefusalError where an attack cannot be started."""
    other = run.fork()
    try:
        for links, kind, parameters in attacks:
            other.start(links[0], kind, parameters)
    except DguSimError as error:
        raise RefusalError(str(error)) from error
    return Futures(calm=run.advance(steps), attacked=other.advance(steps), attacks=[links for links, _, _ in attacks])


def forecast(run: LiveRun, found: Futures, asked: WhatIf, said: Sequence[str]) -> Forecast:
    """Draw and say what two futures are."""
    calm, attacked = found.calm.block, found.attacked.block
    steps = len(calm.x)
    size = -(-steps // _COLUMNS)
    bands = []
    for panel in ("voltage", "current", "alpha"):
        one, other = (_curves(followed, panel) for followed in (found.calm, found.attacked))
        bands.append(_band(panel, np.minimum(one, other), np.maximum(one, other), size))
    for at, link in enumerate(run.designs.topics.links):
        links = found.attacked.links
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(links.residual[:, at]) / links.threshold[:, at]
        bands.append(_band(str(link), ratio, ratio, size))
    assert calm.first_step == attacked.first_step  # noqa: S101 - both are forks of one moment
    return Forecast(
        id=asked.id,
        first_step=calm.first_step,
        steps=steps,
        bin_steps=size,
        bands=bands,
        lines=[*said, *_words(run, found)],
    )


def _ordered(asked: WhatIf) -> tuple[tuple[Link, ...], str, dict[str, object]]:
    order = Attack(
        id=asked.id, action="start", links=asked.links, attack=asked.attack, parameters=asked.parameters, anyway=True
    )
    links, parameters = order_of(order)
    return links, asked.attack, {**parameters, "anyway": True}


def _responses(scenario: Scenario, steps: int, rise_sec: float) -> Responses:
    period_sec = scenario.sampling_period_sec
    return responses_of(scenario, period_sec, steps * period_sec, rise_sec)


def _curves(followed: Followed, panel: str) -> FloatArray:
    block = followed.block
    return block.alpha[:, 0] if panel == "alpha" else block.y[:, 0, :, 0 if panel == "voltage" else 1]


def _band(panel: str, low: FloatArray, high: FloatArray, size: int) -> Band:
    """Smallest and largest value of (steps, channels) in columns; the last one may hold fewer steps."""
    missing = -len(low) % size
    low, high = (np.concatenate([one, np.repeat(one[-1:], missing, axis=0)]) for one in (low, high))
    return Band(
        panel=panel,
        low=[numbers(one) for one in extremes(low.T, size)[0]],
        high=[numbers(one) for one in extremes(high.T, size)[1]],
    )


def _words(run: LiveRun, found: Futures) -> list[str]:
    """Damage, detection and what stays unseen."""
    period_sec, links = run.scenario.sampling_period_sec, run.designs.topics.links
    moved = found.attacked.block.x[:, 0, :, 0] - found.calm.block.x[:, 0, :, 0]
    mean, each = moved.mean(axis=1), np.abs(moved)
    most = mean[np.argmax(np.abs(mean))]
    step, dgu = np.unravel_index(int(np.argmax(each)), each.shape)
    number = run.designs.topics.dgus[int(dgu)]
    said = [
        f"mean voltage: at most {most:+.3g} V",
        f"one DGU: at most {moved[step, dgu]:+.3g} V, at DGU {number} after {step * period_sec:.3g} s",
    ]
    fresh = found.attacked.links.alarm & ~found.calm.links.alarm
    attacked = {link for one in found.attacks for link in one}
    first = {links[at]: int(np.argmax(fresh[:, at])) for at in np.flatnonzero(fresh.any(axis=0))}
    for link, row in sorted(first.items(), key=lambda one: one[1])[:4]:
        wrong = "" if link in attacked else ", which is not attacked"
        said.append(f"alarm on {arrow(link)}{wrong} after {row * period_sec:.3g} s")
    unseen = [arrow(link) for link in links if link in attacked and link not in first]
    if unseen:
        said.append(f"no alarm at all on {', '.join(unseen)}")
    return said
