"""What a run says: one row for each directed link, as a table or as a JSON document."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, final

from bags.mcap.yaml_text import load
from bags.reporting.outline import Outline, outline_of
from bags.reporting.team_outline import TeamOutline
from bags.runs.run_record import RunRecord
from bags.wire.records import DesignRecord
from bags.wire.schema import dgu_name
from dgu_sim.grid import Link
from monitor.metrics import LinkMetrics


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSummary:
    """What the monitor of one directed link saw.

    Attributes:
        source: Name of the sending DGU.
        target: Name of the receiving DGU, which hosts the monitor.
        attacked: Whether an attack ran on the link.
        attack_start_sec: First affected sample [s], None when not attacked.
        alarm_sec: First alarm; when attacked, the first one from the attack's start on [s].
        detection_delay_sec: From the attack's start to the alarm [s], None when not attacked or not seen.
        false_alarms: Alarms that started while no attack ran on the link.
        max_abs_residual_before: Largest |r_i| before the attack, settling left out; NaN without a residual.
        max_abs_residual_after: Largest |r_i| from the attack's start on, None when not attacked.
        threshold: Last thresholds, 3 components [V, A, V s]; NaN where there is none.
        monitored: False when no observer could be designed.
        observer: Name of the design method.
        verdict: What the design says about itself.
    """

    source: str
    target: str
    attacked: bool
    attack_start_sec: float | None
    alarm_sec: float | None
    detection_delay_sec: float | None
    false_alarms: int
    max_abs_residual_before: float
    max_abs_residual_after: float | None
    threshold: tuple[float, ...]
    monitored: bool
    observer: str
    verdict: str

    def document(self) -> dict[str, Any]:
        """The row for the JSON document: NaN, which JSON does not know, becomes null."""
        row = asdict(self)
        row["max_abs_residual_before"] = _or_none(self.max_abs_residual_before)
        row["threshold"] = [_or_none(limit) for limit in self.threshold]
        return {"from": row.pop("source"), "to": row.pop("target"), **row}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """A run in one table.

    Attributes:
        scenario: Name of the scenario, "" when the bag holds none.
        seed: Its seed, None likewise.
        steps: Complete steps.
        duration_sec: Simulated time of the complete steps [s].
        links: One row for each directed link, by target and source.
        bag: Path of the bag.
        team: What the monitors did as a team, None when they were none.
    """

    scenario: str
    seed: int | None
    steps: int
    duration_sec: float
    links: tuple[LinkSummary, ...]
    bag: Path
    team: TeamOutline | None = None

    def document(self) -> dict[str, Any]:
        """The JSON document of `dcmg run --json`; every number in it is finite."""
        team = {} if self.team is None else {"team": self.team.document()}
        return {
            "scenario": self.scenario,
            "seed": self.seed,
            "steps": self.steps,
            "duration_sec": self.duration_sec,
            "links": [link.document() for link in self.links],
            **team,
            "bag": str(self.bag),
        }


def summary(run: RunRecord | Outline, bag: Path | None = None) -> RunSummary:
    """Put a run into a table.

    Args:
        run: The run, or its outline.
        bag: What to give as the bag's path, if not the run's own.
    """
    found = run if isinstance(run, Outline) else outline_of(run)
    record = found.run
    scenario = _scenario(record)
    seed = scenario.get("seed")
    rows = zip(record.links, found.metrics, strict=True)
    return RunSummary(
        scenario=str(scenario.get("name", "")),
        seed=seed if isinstance(seed, int) else None,
        steps=found.steps,
        duration_sec=found.duration_sec,
        links=tuple(_link(record.designs.get(link), link, metrics) for link, metrics in rows),
        bag=record.path if bag is None else bag,
        team=found.team,
    )


def _link(design: DesignRecord | None, link: Link, metrics: LinkMetrics) -> LinkSummary:
    return LinkSummary(
        source=dgu_name(link.source),
        target=dgu_name(link.target),
        attacked=metrics.attacked,
        attack_start_sec=metrics.attack_start_sec,
        alarm_sec=metrics.alarm_sec,
        detection_delay_sec=metrics.detection_delay_sec,
        false_alarms=metrics.false_alarms,
        max_abs_residual_before=metrics.residual_before,
        max_abs_residual_after=_or_none(metrics.residual_after),
        threshold=tuple(float(limit) for limit in metrics.threshold),
        monitored=design.accepted if design else False,
        observer=design.observer if design else "",
        verdict=design.verdict if design else "the bag holds no design",
    )


def _scenario(record: RunRecord) -> Mapping[str, object]:
    # only two keys are wanted, and a report must work for bags of scenarios that are no longer valid
    document = load(record.scenario_text) if record.scenario_text else None
    return document if isinstance(document, dict) else {}


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
