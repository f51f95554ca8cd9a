"""Two workers against one on a study of 32 cells: `make bench` prints it."""

from __future__ import annotations

import time
from contextlib import nullcontext
from typing import TYPE_CHECKING

import pytest

from bags.study import LocalPool, Study, cells_of, run_study
from bags.study.cluster import dask_pool
from dcmg.shipped import scenario_path

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from bags.study import Pool

pytestmark = [pytest.mark.bench, pytest.mark.timeout(600)]
FLOOR = 1.7
DETECTOR = {"kind": "calibrated", "options": {"rate": 0.002}, "sweep": {"option": "rate", "values": [0.01, 0.05]}}
STUDY = {
    "name": "bench",
    "scenario": "gallo_six_dgu",
    "set": ["duration_sec=18.0", "noise={kind: gaussian, std: [0.002, 0.004, 0.0005]}"],
    "seeds": 64,
    "attack_start_sec": 12.0,
    "observers": [
        {"name": "minimum norm", "kind": "full_order"},
        {"name": "most sensitive", "kind": "full_order", "options": {"strategy": "max_sensitivity"}},
        {"name": "model-based", "kind": "model_based"},
        {"name": "identified", "kind": "identify_then_design"},
    ],
    "detectors": [{"name": "calibrated", **DETECTOR}],
    "attacks": [
        {"name": "bias", "kind": "bias", "link": "1-2", "bias": [0.0, 0.1, 0.0]},
        {"name": "ramp", "kind": "bias_ramp", "link": "1-2", "rate": [0.0, 0.1, 0.0]},
    ],
}


@pytest.mark.parametrize("where", ["processes", "dask"])
def test_two_workers_against_one(tmp_path: Path, where: str) -> None:
    """The whole study, its table included; a cluster is up before."""
    cells = cells_of(Study.model_validate(STUDY), "bench", scenario_path)
    assert len(cells) == 32
    spent = {}
    for workers in (1, 2):
        with _pool(where, workers) as pool:
            began = time.monotonic()
            run_study(cells, tmp_path / str(workers), pool)
            spent[workers] = time.monotonic() - began
    ratio = spent[1] / spent[2]
    line = f"study of 32 cells, {where}: {spent[1]:.1f} s on one worker, {spent[2]:.1f} s on two"
    print(f"\n{line}: {ratio:.2f} x (wanted: {FLOOR:g} x)", end="")  # noqa: T201
    assert ratio >= FLOOR


def _pool(where: str, workers: int) -> AbstractContextManager[Pool]:
    return nullcontext(LocalPool(workers)) if where == "processes" else dask_pool(f"local:{workers}")
