"""From a study to its cells: the units of work that are done in parallel and kept when a study is interrupted."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import yaml
from pydantic import ValidationError

from bags.study.designs import BASELINES, designs_of
from bags.study.errors import StudyError
from bags.study.settings import NO_ATTACK, Study, StudyDetector, StudyObserver
from bags.watch.scenarios import load_scenario
from bags.wire.schema import topics_of
from dgu_sim.errors import ScenarioError
from dgu_sim.explain import explain
from dgu_sim.scenario import Scenario
from monitor import observers
from monitor.errors import HistoryError, MonitorError, OptionError
from monitor.settings import DetectorSettings

_FORMAT = 2  # of the rows; another one makes kept cells worthless
_MOST_SEEDS = 8  # of a cell: more are hardly cheaper each, and fewer cells keep fewer cores busy
_MOST_SAMPLES = 1_000_000  # of a cell, on all links in all of its runs: some 200 MB
_AT_ONCE = DetectorSettings(options={"settle_sec": 0.0, "calibrate_sec": 0.0})  # learns nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCell:
    """The runs of one condition with some of the seeds, watched by one observer.

    Attributes:
        study: Name of the study.
        condition: Name of the condition.
        scenarios: Scenario by attack; the one without attack first.
        observer: The observer.
        detectors: The detectors.
        seeds: Seeds of the runs.
        digest: Of the scenarios: there may be thousands of cells, and a dump of all of them takes a tenth of a second.
    """

    study: str
    condition: str
    scenarios: Mapping[str, Scenario]
    observer: StudyObserver
    detectors: tuple[StudyDetector, ...]
    seeds: tuple[int, ...]
    digest: str

    @property
    def key(self) -> str:
        """Digest of everything that the rows follow from."""
        document = {
            "format": _FORMAT,
            "condition": self.condition,
            "scenarios": self.digest,
            "observer": self.observer.model_dump(mode="json"),
            "detectors": [one.model_dump(mode="json") for one in self.detectors],
            "seeds": self.seeds,
        }
        return _digest(document)


def cells_of(study: Study, source: str, scenario_path: Callable[[str], Path]) -> tuple[StudyCell, ...]:
    """Return the cells of a study, everything checked before the first run.

    Args:
        study: The study.
        source: What to call its file in messages.
        scenario_path: Finds the file of a scenario by its name or path.

    Raises:
        StudyError: One line with file, key, value and what was expected.
    """
    _check_kinds(study, source)
    try:
        path = scenario_path(study.scenario)
    except ScenarioError as error:
        raise StudyError(f"{source}: scenario = {study.scenario!r}: {error}") from error
    cells = []
    for position, condition in enumerate(study.conditions):
        try:
            base = load_scenario(path, (*study.set, *condition.set, "attacks=[]"))
        except ScenarioError as error:
            raise StudyError(f"{source}: conditions.{position}.set: {error}") from error
        if base.script:
            told = f"{len(base.script)} commands, expected none: a study's monitors do not obey them"
            raise StudyError(f"{source}: script of {study.scenario}: {told}")
        scenarios = {NO_ATTACK: base, **_attacked(study, base, source)}
        digest = _digest({attack: scenario.to_yaml() for attack, scenario in scenarios.items()})
        cells += [
            StudyCell(
                study=study.name,
                condition=condition.name,
                scenarios=scenarios,
                observer=observer,
                detectors=study.detectors,
                seeds=seeds,
                digest=digest,
            )
            for observer in study.observers
            for seeds in _seed_blocks(study, scenarios)
        ]
        _check_detectors(study, base, source)
    return tuple(cells)


def check_designs(study: Study, cells: Sequence[StudyCell], source: str) -> None:
    """Design once what each observer runs at one DGU, so that no cell starts with options that no design takes.

    Args:
        study: The study.
        cells: Of it.
        source: What to call its file in messages.

    Raises:
        StudyError: One line with file, key, value and what was expected.
    """
    base = cells[0].scenarios[NO_ATTACK]
    for position, one in enumerate(study.observers):
        try:
            with _said_of(source, "observer", f"observers.{position}"):
                designs = designs_of(one, base, topics_of(base).monitors[:1])
                designs.check_start()
        except HistoryError:
            continue  # no fault of the options: the cell says what becomes of it
        for number, detector in enumerate(study.detectors):
            for value in detector.points:
                with _said_of(source, "detector", f"detectors.{number}"):
                    designs.judged_by(detector.at(value)).check_start()


def _digest(document: object) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()[:24]


@contextmanager
def _said_of(source: str, section: str, place: str) -> Iterator[None]:
    """Say of a wrong option where it stands: what monitors know as a section is an entry of the study."""
    try:
        yield
    except OptionError as error:
        key = ".".join(error.key[1:] if error.key[0] == section else error.key)
        found = "" if error.value is None else f" = {error.value!r}"
        raise StudyError(f"{source}: {place}.{key}{found}: {error.expected}") from error


def _seed_blocks(study: Study, scenarios: Mapping[str, Scenario]) -> Iterator[tuple[int, ...]]:
    """Yield the seeds of each cell: more seeds in a study leave the full blocks as they are."""
    samples = sum(one.steps * max(1, len(one.links)) for one in scenarios.values())  # with one seed
    size = max(1, min(_MOST_SEEDS, _MOST_SAMPLES // samples))
    end = study.first_seed + study.seeds
    for start in range(study.first_seed, end, size):
        yield tuple(range(start, min(start + size, end)))


def _attacked(study: Study, base: Scenario, source: str) -> dict[str, Scenario]:
    """Return the scenario with each attack."""
    found = {}
    data = yaml.safe_load(base.to_yaml())
    for position, one in enumerate(study.attacks):
        times = {"start_sec": study.attack_start_sec, "stop_sec": study.attack_stop_sec}
        attacks = [{**one.attack, **{key: value for key, value in times.items() if value is not None}}]
        if study.attack_start_sec >= base.duration_sec:
            raise StudyError(
                f"{source}: attack_start_sec = {study.attack_start_sec:g}: "
                f"expected a time before the end of the run, {base.duration_sec:g} s"
            )
        document = {**data, "attacks": attacks, "monitor": {}}  # the study's own monitors watch
        try:
            found[one.name] = Scenario.model_validate(document)
        except ValidationError as error:
            problem = str(explain(error, document)).replace("attacks.0", f"attacks.{position}", 1)
            raise StudyError(f"{source}: {problem}") from error
    return found


def _check_kinds(study: Study, source: str) -> None:
    """Refuse observers that do not exist, and further tests that still learn when the attack starts."""
    known = (*sorted(observers.KINDS), *BASELINES)
    for position, one in enumerate(study.observers):
        if one.kind not in known:
            raise StudyError(f"{source}: observers.{position}.kind = {one.kind!r}: expected one of {', '.join(known)}")
        told = one.settings(_AT_ONCE)
        if told.combined and one.kind in BASELINES:
            raise StudyError(f"{source}: observers.{position}.kind = {one.kind!r}: baselines have no further tests")
        _check_start(study, told.calibrated_sec, f"{source}: observers.{position}: learns")


def _check_detectors(study: Study, base: Scenario, source: str) -> None:
    """Refuse detectors that do not exist, and those still learning when the attack starts."""
    for position, one in enumerate(study.detectors):
        for value in one.points:
            where = f"{source}: detectors.{position}"
            where += "" if value is None or one.sweep is None else f" with {one.sweep.option} = {value:g}"
            try:
                found = one.at(value)
                found.build(base.sampling_period_sec)
            except MonitorError as error:
                raise StudyError(f"{where}: {error}") from error
            _check_start(study, found.calibrated_sec, f"{where}: settles and calibrates")


def _check_start(study: Study, ready_sec: float, what: str) -> None:
    if study.attacks and study.attack_start_sec < ready_sec:
        raise StudyError(
            f"{what} until {ready_sec:g} s, expected at most attack_start_sec = {study.attack_start_sec:g}"
        )
