"""A study file: what is varied, checked and frozen; docs/studies.md explains every key."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from bags.study.errors import StudyError
from dgu_sim.errors import ScenarioError
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.scenario_file import apply_overrides, embed_waveforms, parse_yaml, read_text, validated
from monitor.detectors import filled_in
from monitor.settings import DetectorSettings, LocalSettings, MonitorSettings, ObserverSettings, PlausibilitySettings

__all__ = ["Condition", "Study", "StudyAttack", "StudyDetector", "StudyObserver", "Sweep", "load_study"]

NO_ATTACK = "none"
"""Name of the runs without an attack, which every study has: false alarms are counted there."""


class Condition(Frozen):
    """A variant of the scenario."""

    name: str = Field(min_length=1, description="Name in tables and plots.")
    set: tuple[str, ...] = Field(default=(), description='Changes of the scenario, "a.b=value" each.')


class StudyObserver(Frozen):
    """A way to design the observer of every link."""

    name: str = Field(min_length=1, description="Name in tables and plots.")
    kind: str = Field(
        default="full_order",
        description="Design method of `monitor.observer`; or a baseline: model_based (a UIO of the true matrices) "
        "or identify_then_design (least squares, then the model-based UIO).",
    )
    options: dict[str, object] = Field(default_factory=dict, description="Options of the method.")
    local: LocalSettings | None = Field(default=None, description="The module of the own state, as `monitor.local`.")
    plausibility: PlausibilitySettings | None = Field(
        default=None, description="The test of the reconstructed input, as `monitor.plausibility`."
    )

    def settings(self, detector: DetectorSettings) -> MonitorSettings:
        """What the monitors are told, under one of the detectors."""
        return MonitorSettings(
            observer=ObserverSettings(kind=self.kind, options=self.options),
            detector=detector,
            local=self.local,
            plausibility=self.plausibility,
        )


class Sweep(Frozen):
    """One option of a detector at several values: the points of its ROC curve."""

    option: str = Field(min_length=1, description="Name of the option.")
    values: tuple[Number, ...] = Field(min_length=1, description="Its values.")


class StudyDetector(Frozen):
    """A detector, and how it is varied."""

    name: str = Field(min_length=1, description="Name in tables and plots.")
    kind: str = Field(default="fixed", description="Kind of `monitor.detector`.")
    options: dict[str, object] = Field(default_factory=dict, description="Options of the detector.")
    sweep: Sweep | None = Field(default=None, description="Further operating points; default: only the one of options.")

    def at(self, value: float | None) -> DetectorSettings:
        """Return what it is with the swept option at a value; None: as given.

        Raises:
            monitor.errors.MonitorError: unknown kind or option, or a value that does not fit.
        """
        swept = {} if self.sweep is None or value is None else {self.sweep.option: value}
        return DetectorSettings(kind=self.kind, options=filled_in(self.kind, {**self.options, **swept}))

    @property
    def points(self) -> tuple[float | None, ...]:
        """The values of the swept option at its operating points; None: as given."""
        return (None, *(() if self.sweep is None else self.sweep.values))


class StudyAttack(Frozen):
    """An attack; every key but `name` is one of the scenario's attacks, without its times."""

    name: str = Field(min_length=1, description="Name in tables and plots.")
    attack: dict[str, object] = Field(description="kind, link or links, and the parameters of the kind.")

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, data: object) -> object:
        if not isinstance(data, dict):
            return data
        for key in ("start_sec", "stop_sec"):
            if key in data:
                raise finding((key,), data[key], "expected none: the study's attack_start_sec and attack_stop_sec hold")
        given = {key: value for key, value in data.items() if key != "name"}
        return {"name": data.get("name", data.get("kind")), "attack": given}


class Study(Frozen):
    """Many runs of one scenario, and how they are judged."""

    name: str = Field(min_length=1, description="Short name.")
    question: str = Field(default="", description="What the study answers.")
    scenario: str = Field(description="Name of a shipped scenario, or path of one beside the study file.")
    set: tuple[str, ...] = Field(default=(), description='Changes of the scenario in all conditions, "a.b=value" each.')
    seeds: int = Field(default=10, ge=1, le=100_000, description="How many seeds: runs of each combination.")
    first_seed: int = Field(default=1, ge=0, description="The first one; they are consecutive.")
    attack_start_sec: Number = Field(gt=0, description="Time of the first affected sample [s].")
    attack_stop_sec: Number | None = Field(
        default=None, description="Time of the first clean sample [s]; default: never."
    )
    false_alarm_limit: Number = Field(
        default=1e-3,
        gt=0,
        description="Largest false-alarm rate that the comparison accepts.",
    )
    conditions: tuple[Condition, ...] = Field(
        default=(Condition(name="as is"),), min_length=1, description="Variants of the scenario."
    )
    observers: tuple[StudyObserver, ...] = Field(min_length=1, description="Observers to compare.")
    detectors: tuple[StudyDetector, ...] = Field(min_length=1, description="Detectors to compare.")
    attacks: tuple[StudyAttack, ...] = Field(default=(), description="Attacks, each in runs of its own.")

    @model_validator(mode="after")
    def _named_once(self) -> Self:
        for key in ("conditions", "observers", "detectors", "attacks"):
            names = [NO_ATTACK] if key == "attacks" else []
            for position, one in enumerate(getattr(self, key)):
                if one.name in names:
                    raise finding((key, position, "name"), one.name, f"expected a name not used before among {key}")
                names.append(one.name)
        if self.attack_stop_sec is not None and self.attack_stop_sec <= self.attack_start_sec:
            expected = f"expected a time after attack_start_sec = {self.attack_start_sec:g}"
            raise finding(("attack_stop_sec",), self.attack_stop_sec, expected)
        return self


def load_study(path: Path | str, overrides: Sequence[str] = ()) -> Study:
    """Read and check a study file.

    Args:
        path: The YAML file.
        overrides: "a.b=value" each; list indices count from 0, values are YAML.

    Raises:
        StudyError: One line with file, key, value and what was expected.
    """
    path = Path(path)
    try:
        data = parse_yaml(read_text(path, "study file"), str(path))
        apply_overrides(data, overrides, str(path))
        embed_waveforms(data, str(path), path.parent, overrides)
        return validated(Study, data, str(path), overrides)
    except ScenarioError as error:
        raise StudyError(str(error)) from error
