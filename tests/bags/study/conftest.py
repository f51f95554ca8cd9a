"""A study that takes a second or two."""

from collections.abc import Callable
from pathlib import Path

import pytest

from bags.study import Study, StudyCell, cells_of, load_study
from dcmg.shipped import scenario_path

TINY = """
name: tiny
scenario: gallo_six_dgu
set: [duration_sec=4.0, "noise={kind: uniform, half_width: [0.001, 0.001, 0.001]}"]
seeds: 4
attack_start_sec: 3.0
observers:
  - {name: data-driven, kind: full_order}
  - {name: model-based, kind: model_based}
detectors:
  - name: fixed
    kind: fixed
    options: {settle_sec: 0.5, calibrate_sec: 1.5, margin: 2.0}
    sweep: {option: margin, values: [0.2]}
attacks:
  - {name: bias, kind: bias, link: "1-2", bias: [0.1, 0.1, 0.1]}
  - {name: stealthy, kind: uio_stealthy_trajectory, link: "1-2", current_a: 0.5}
"""


@pytest.fixture(scope="session")
def tiny_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """File of the tiny study."""
    path = tmp_path_factory.mktemp("study") / "tiny.yaml"
    path.write_text(TINY)
    return path


@pytest.fixture
def tiny(tiny_file: Path) -> Study:
    """The tiny study."""
    return load_study(tiny_file)


@pytest.fixture
def cells(tiny: Study) -> tuple[StudyCell, ...]:
    """Its cells."""
    return cells_of(tiny, "tiny.yaml", scenario_path)


@pytest.fixture
def refuse(tmp_path: Path) -> Callable[[str, str], Path]:
    """Write the tiny study with one text in the place of another."""

    def write(old: str, new: str) -> Path:
        assert old in TINY
        path = tmp_path / "wrong.yaml"
        path.write_text(TINY.replace(old, new, 1))
        return path

    return write
