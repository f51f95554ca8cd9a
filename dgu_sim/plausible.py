"""What a valid scenario may still be wrong about: values that no DC microgrid has, and what will never happen."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pydantic import BaseModel

from dgu_sim.loads import TableLoad
from dgu_sim.scenario import Scenario

__all__ = ["RANGES", "Concern", "concerns"]

RANGES: Mapping[str, tuple[float, float, str]] = {
    "dgus.resistance_ohm": (1e-4, 100.0, "ohm, a filter's resistance"),
    "dgus.inductance_h": (1e-6, 1.0, "H, a filter's inductance"),
    "dgus.capacitance_f": (1e-6, 10.0, "F, the capacitance at a bus: 2.2e-3 is 2200 uF"),
    "dgus.reference_v": (1.0, 1500.0, "V, low-voltage DC ends at 1500 V"),
    "dgus.rated_current_a": (1e-3, 1e4, "A, a rated current"),
    "dgus.load": (0.0, 1e4, "A, a load"),
    "dgus.initial_state": (0.0, 1e4, "V, A or V s"),
    "dgus.initial_spread": (0.0, 1e4, "V, A or V s"),
    "lines.resistance_ohm": (1e-4, 100.0, "ohm, a line's resistance"),
    "secondary.gain": (1e-6, 1e3, "V/s"),
    "noise": (0.0, 100.0, "V, A or V s, noise of a sensor"),
    "history.samples": (2, 1e6, "samples of an experiment"),
    "history.experiments": (1, 1e4, "experiments"),
    "history.load_spread_a": (0.0, 1e4, "A, a load"),
    "history.reference_spread_v": (0.0, 1500.0, "V, low-voltage DC ends at 1500 V"),
    "history.voltage_spread_v": (0.0, 1500.0, "V, low-voltage DC ends at 1500 V"),
    "history.noise_std": (0.0, 100.0, "V, A or V s, noise of a sensor"),
}
"""Least and largest value by key, and of what; G's grid has 0.1 to 0.6 ohm, 1.3 to 3 mH, 1.7 to 3 mF, 48 V.

A key without numbers of its own (a load, the noise) stands for the amplitudes within it, not for its times.
"""

_NO_AMPLITUDE = re.compile(r"_sec$|^(kind|freedom)$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Concern:
    """Something in a scenario that is hardly meant.

    Attributes:
        text: One line: key, value, and why.
        key: Path of the key.
        implausible: Whether the value is outside of its plausible range: a unit is probably wrong.
    """

    text: str
    key: tuple[str | int, ...] = ()
    implausible: bool = False


def concerns(scenario: Scenario, ranges: Mapping[str, tuple[float, float, str]] = RANGES) -> tuple[Concern, ...]:
    """Look for what is valid and hardly meant.

    Args:
        scenario: A valid scenario.
        ranges: Plausible values by key.
    """
    return (*_implausible(scenario, ranges), *_times(scenario), *_parts(scenario))


def _implausible(scenario: Scenario, ranges: Mapping[str, tuple[float, float, str]]) -> Iterator[Concern]:
    for pattern, (low, high, what) in ranges.items():
        for key, value in _numbers(scenario, pattern.split("."), ()):
            if not low <= abs(value) <= high:
                place = ".".join(map(str, key))
                text = f"{place} = {value:g}: expected {low:g} to {high:g} {what}"
                yield Concern(text=text, key=key, implausible=True)


def _numbers(
    part: object, names: Sequence[str], key: tuple[str | int, ...]
) -> Iterator[tuple[tuple[str | int, ...], float]]:
    """Go through the numbers at or below `names` of a part of a scenario, with their keys."""
    if isinstance(part, tuple):
        for index, one in enumerate(part):
            yield from _numbers(one, names, (*key, index))
    elif isinstance(part, TableLoad):
        yield (*key, "current_a"), max(abs(part.scale * value + part.offset_a) for value in part.current_a)
    elif isinstance(part, BaseModel):
        for name in names[:1] or [name for name in type(part).model_fields if not _NO_AMPLITUDE.search(name)]:
            yield from _numbers(getattr(part, name), names[1:], (*key, name))
    elif isinstance(part, int | float) and not isinstance(part, bool):
        yield key, float(part)


def _times(scenario: Scenario) -> Iterator[Concern]:
    length, period = scenario.duration_sec, scenario.sampling_period_sec
    whole = scenario.steps * period
    if abs(whole - length) > 1e-6 * period:
        text = f"duration_sec = {length:g}: no multiple of sampling_period_sec = {period:g}"
        yield Concern(text=f"{text}: the run has {scenario.steps} steps, {whole:g} s")
    for at, dgu in enumerate(scenario.dgus):
        for index, load in enumerate(dgu.load):
            if isinstance(load, TableLoad) and load.time_sec[0] - load.from_sec >= whole:
                text = f"dgus.{at}.load.{index}.time_sec.0 = {load.time_sec[0]:g}: the run ends at {whole:g} s"
                yield Concern(text=f"{text}: its first row holds all the time; from_sec shifts it")
    for index, attack in enumerate(scenario.attacks):
        if attack.start_sec >= whole:
            text = f"attacks.{index}.start_sec = {attack.start_sec:g}"
            yield Concern(text=f"{text}: the run ends at {whole:g} s: this attack never begins")


def _parts(scenario: Scenario) -> Iterator[Concern]:
    parts = scenario.grid.components()
    if len(parts) > 1:
        told = ", ".join("{" + ", ".join(map(str, sorted(one))) + "}" for one in parts)
        yield Concern(text=f"lines: the grid falls into {len(parts)} parts, {told}: each shares its currents alone")
