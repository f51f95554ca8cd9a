"""A study says what a run says: whatever attacks, by whatever tests."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.study import cells_of
from bags.study.cells import StudyCell
from bags.study.evaluate import evaluate
from bags.study.settings import Study
from dcmg.shipped import scenario_path
from dgu_sim.attacks.registry import KINDS
from dgu_sim.scenario import Scenario

START, END = 100, 160
ATTACKS: dict[str, dict[str, object]] = {
    "bias": {"link": "1-2", "bias": [0.1, 0.1, 0.1]},
    "bias_ramp": {"link": "1-2", "rate": [0, 0.1, 0]},
    "bias_sine": {"link": "1-2", "amplitude": [0, 0.5, 0], "period_sec": 1},
    "bias_pulse": {"link": "1-2", "bias": [0, 0.5, 0], "period_sec": 1, "width_sec": 0.1},
    "bias_random": {"link": "1-2", "spread": [0.1, 0.1, 0.1]},
    "bias_waveform": {"link": "1-2", "time_sec": [0, 0.2], "current_a": [0, 0.5], "interpolation": "linear"},
    "scaling": {"link": "1-2", "gain": [1, 1.05, 1]},
    "freeze": {"link": "1-2"},
    "delay": {"link": "1-2", "samples": 10},
    "drop": {"link": "1-2", "probability": 0.5},
    "replay": {"link": "1-2", "record_sec": 0.2},
    "zero_sum": {"links": ["1-2", "5-4"], "shares": [0.5, -0.5]},
    "uio_stealthy_plane": {"link": "1-2", "current_a": 0.5},
    "uio_stealthy_trajectory": {"link": "1-2", "current_a": 0.5},
    "luenberger_stealthy": {"links": ["2-4", "3-4"], "voltage_v": 0.1},
    "covert": {"link": "1-2", "load_a": 2},
    "spoof": {"link": "1-2", "falsify": {"kind": "freeze"}},
}
FIXED = {"settle_sec": 0.2, "calibrate_sec": 0.5, "margin": 2.0}
LIMITS = {"settle_sec": 0.2, "calibrate_sec": 0.5, "range": [0.1, 0.02]}
LOCAL = {"load_sec": 0.2, "detector": {"kind": "fixed", "options": {**FIXED, "calibrate_sec": 0.3}}}
PARTS: dict[str, dict[str, Any]] = {
    "links": {},
    "combined": {"local": LOCAL, "plausibility": {"limits": LIMITS}},
}


RUNS = [  # tests, message that counts, attacks
    ("links", "newest", tuple(ATTACKS)),
    ("combined", "newest", tuple(ATTACKS)),
    ("combined", "known_publisher", ("spoof",)),
]


@pytest.fixture(name="cell", scope="module", params=RUNS)
def _cell(request: pytest.FixtureRequest) -> StudyCell:
    part, accept, kinds = request.param
    study = Study.model_validate(
        {
            "name": "agreement",
            "scenario": "gallo_six_dgu",
            "set": [f"duration_sec={END * 0.01}", f"receiver.accept={accept}"],
            "seeds": 1,
            "attack_start_sec": START * 0.01,
            "observers": [{"name": part, "kind": "full_order", **PARTS[part]}],
            "detectors": [{"name": "fixed", "kind": "fixed", "options": FIXED}],
            "attacks": [{"name": kind, "kind": kind, **ATTACKS[kind]} for kind in kinds],
        }
    )
    (cell,) = cells_of(study, "agreement.yaml", scenario_path)
    return cell


def test_every_attack_stands_here() -> None:
    """A new attack cannot be forgotten."""
    assert set(ATTACKS) == set(KINDS)


def test_a_study_concludes_as_a_run(cell: StudyCell, tmp_path: Path) -> None:
    """For every attack, by residuals alone and by all tests: the alarms of a bag of the same scenario and seed."""
    table = evaluate(cell).to_pylist()
    for attack, base in cell.scenarios.items():
        document = base.model_dump(mode="json")
        document["monitor"] = {"detector": {"kind": "fixed", "options": FIXED}, **PARTS[cell.observer.name]}
        record = read_run(simulate_to_bag(Scenario.model_validate(document), tmp_path / attack))
        alarm = record.alarm
        if record.combined is not None:
            alarm = record.combined.verdict.accused | record.combined.verdict.suspected
        rows = [row for row in table if row["attack"] == attack]
        during, clean = alarm[START:], END if attack == "none" else START
        first = np.where(during.any(axis=0), during.argmax(axis=0) * 0.01, np.nan)
        assert [row["attack_alarm_steps"] for row in rows] == during.sum(axis=0).tolist(), attack
        assert [row["clean_alarm_steps"] for row in rows] == alarm[:clean].sum(axis=0).tolist(), attack
        found = [np.nan if row["delay_sec"] is None else row["delay_sec"] for row in rows]
        if attack != "none":
            np.testing.assert_allclose(found, first, rtol=0.0, atol=1e-9, err_msg=attack)  # k T_s, in floats
        if attack == "spoof" and record.combined is not None:
            (attacked,) = (row for row in rows if row["attacked"])
            assert attacked["delay_sec"] == 0.0  # the guard of the stream accuses at once
