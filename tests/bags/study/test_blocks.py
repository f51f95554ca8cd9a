"""Cells of few seeds, and observers that run once whatever judges them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from bags.study import Study, StudyCell, cells_of
from bags.study.evaluate import evaluate
from bags.study.judging import LinkResiduals, Received
from bags.study.settings import NO_ATTACK, StudyDetector
from bags.watch.designs import design_scenario
from bags.watch.monitors import RunMonitors, group_monitors
from dcmg.shipped import scenario_path
from dgu_sim.simulate import simulate
from monitor.detectors import KINDS, Phase

_CALIBRATE: dict[str, object] = {"settle_sec": 0.5, "calibrate_sec": 1.5}
_DETECTORS: dict[str, dict[str, object]] = {
    "n_of_m": {"n": 2, "m": 3, "kind": "fixed", "options": {**_CALIBRATE, "margin": 0.7}},
    "noise_bound": {"noise": 0.001, "settle_sec": 0.5},
}


def test_seed_blocks_have_the_rows_of_all_seeds_at_once(cells: tuple[StudyCell, ...]) -> None:
    """One seed after the other gives the bits of four side by side, in the order of seeds within each point."""
    whole = evaluate(cells[0])
    each = pa.concat_tables([evaluate(replace(cells[0], seeds=(seed,))) for seed in cells[0].seeds])
    assert _sorted(each) == _sorted(whole)


def _sorted(table: pa.Table) -> list[str]:
    return sorted(map(repr, table.to_pylist()))


def test_more_seeds_leave_full_blocks_alone(tiny: Study) -> None:
    """A study that is given more seeds keeps the cells that were full."""
    attacks = [{"name": one.name, **one.attack} for one in tiny.attacks]
    found = {}
    for seeds in (8, 20):
        study = Study.model_validate({**tiny.model_dump(), "attacks": attacks, "seeds": seeds})
        cells = cells_of(study, "tiny.yaml", scenario_path)
        assert [seed for one in cells if one.observer == tiny.observers[0] for seed in one.seeds] == [
            *range(1, seeds + 1)
        ]
        found[seeds] = {one.key for one in cells}
    assert found[8] < found[20]


def test_an_observer_runs_once_whatever_the_detectors(
    cells: tuple[StudyCell, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two operating points or seven: every step goes through the observers once."""
    steps: list[int] = []
    run = RunMonitors.run

    def counted(self: RunMonitors, states: Any, received: Any, *rest: Any) -> Any:  # noqa: ANN401 - passed on
        steps.append(len(received))
        return run(self, states, received, *rest)

    monkeypatch.setattr(RunMonitors, "run", counted)
    more = tuple(cells[0].detectors[0].model_copy(update={"name": name}) for name in "abc")
    for detectors in (cells[0].detectors, more):
        steps.clear()
        evaluate(replace(cells[0], detectors=detectors))
        assert sum(steps) == cells[0].scenarios[NO_ATTACK].steps


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("attack", ["bias", "drop"])
def test_every_detector_says_what_its_monitors_say(tiny: Study, kind: str, attack: str) -> None:
    """On residuals made once, with and without gaps: the alarms and phases of monitors that hold the detector."""
    how = {"kind": attack, "link": "1-2", **({"bias": [0.1, 0.1, 0.1]} if attack == "bias" else {"probability": 0.2})}
    document = {**tiny.model_dump(), "attacks": [{"name": attack, **how}], "seeds": 2}
    cell = cells_of(Study.model_validate(document), "tiny.yaml", scenario_path)[0]
    blocks = list(simulate(cell.scenarios[attack], seeds=cell.seeds))
    received, delivered = (np.concatenate([getattr(one, name) for one in blocks]) for name in ("received", "delivered"))
    designs = [design_scenario(cell.scenarios[NO_ATTACK].model_copy(update={"seed": seed})) for seed in cell.seeds]
    options = _DETECTORS.get(kind, _CALIBRATE)
    detector = StudyDetector(name=kind, kind=kind, options=options).at(None).build(0.01)
    found = LinkResiduals.of([Received(received, delivered)], designs).judged_by(detector)
    lanes = [link for one in designs for link in one.links]
    monitors = RunMonitors(designs=tuple(lanes), groups=group_monitors(lanes, detector))
    _, said = monitors.run(monitors.init(), received, delivered)
    assert (found.armed[:, 0] == (said.phase == Phase.ARMED.value)).all()
    assert (found.alarm[:, 0] == said.alarm).all()
    assert (found.size[:, 0] == np.nan_to_num(np.abs(said.residual)).max(axis=-1)).all()
    assert found.alarm.any() if attack == "bias" else not delivered.all()
