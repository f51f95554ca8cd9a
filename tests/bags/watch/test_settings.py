"""What a monitor is told is checked by the monitor, before anything starts, and said where it was written."""

from pathlib import Path

import pytest

from dcmg.commands.checking import check_monitors
from dcmg.commands.scenario_options import ScenarioOptions
from dgu_sim.errors import ScenarioError

WRONG = [
    ("monitor.observer={kind: fullorder}", "monitor.observer.kind = 'fullorder': expected one of", "full_order?"),
    (
        "monitor.observer.options={stratgy: dual_lqr}",
        "monitor.observer.options.stratgy = 'dual_lqr': no such",
        "strategy?",
    ),
    ("monitor.observer.options={decay: 2}", "monitor.observer.options.decay = 2: ", "less than 1"),
    ("monitor.detector={kind: oracle}", "monitor.detector.kind = 'oracle': expected one of", "fixed"),
    ("monitor.detector.options.margn=3", "monitor.detector.options.margn = 3: no such option", "margin?"),
    (
        "monitor.detector={kind: n_of_m, options: {kind: cusum, options: {drift: x}}}",
        "monitor.detector.options.options.drift = 'x': ",
        "number",
    ),
    (
        "monitor.detector={kind: n_of_m, options: {kind: cusm}}",
        "monitor.detector.options.kind = 'cusm': expected one of",
        "cusum?",
    ),
    ("monitor.detector={kind: n_of_m, options: {n: 9}}", "monitor.detector.options.n = 9: expected at most m", "5"),
    ("monitor.local.detector={kind: oracle}", "monitor.local.detector.kind = 'oracle': expected one of", "fixed"),
    ("monitor.local.detector={kind: noise_bound, options: {noise: 1}}", "monitor.local.detector: ", "own load"),
    ("monitor.local.decay=2", "monitor.local.decay = 2", "less than"),
    (
        "monitor.plausibility.estimator={kind: onestep}",
        "monitor.plausibility.estimator.kind = 'onestep': expected one of",
        "one_step?",
    ),
    (
        "monitor.plausibility.estimator.options={observr: full_order}",
        "monitor.plausibility.estimator.options.observr = 'full_order': no such option",
        "observer?",
    ),
    ("monitor.plausibility.limits.range=[-1, 0]", "monitor.plausibility.limits.range = [-1", "not negative"),
    ("monitor.plausibility.limits.magin=1", "monitor.plausibility.limits.magin = 1: no such key", "margin?"),
    ("monitor.response.quiet_sec=-1", "monitor.response.quiet_sec = -1", "greater than or equal to 0"),
    ("monitor.team.structure=flat", "monitor.team.structure = 'flat'", "mutual"),
    (
        "monitor.detector.options.floor=[1, 2]",
        "monitor.detector.options.floor = (1.0, 2.0)",
        "expected one number, or 3: one an output",
    ),
    (
        "monitor.detector={kind: n_of_m, options: {n: 1, m: 2, kind: cusum, options: {floor: [1, 2]}}}",
        "monitor.detector.options.options.floor = (1.0, 2.0)",
        "expected one number, or 3",
    ),
    (
        "monitor.local.detector={kind: chi_squared, options: {floor: [1, 2]}}",
        "monitor.local.detector.options.floor = (1.0, 2.0)",
        "expected one number, or 3",
    ),
]


@pytest.mark.parametrize(("override", "said", "meant"), WRONG)
def test_a_wrong_setting_is_one_line_before_anything_starts(override: str, said: str, meant: str) -> None:
    """The line names what set it, the key, the value and what was expected, near names included."""
    changes = ["monitor.local={}", "monitor.plausibility={}", "monitor.response={}", override]
    chosen = ScenarioOptions(name="gallo_six_dgu", duration_sec=0.1, seed=None, out=None, overrides=changes)
    with pytest.raises(ScenarioError) as caught:
        check_monitors(chosen.load(), chosen)
    line = str(caught.value)
    assert line.startswith(f"override {override!r}: {said}"), line
    assert meant in line
    assert "\n" not in line


def test_a_wrong_setting_in_a_file_names_the_file(tmp_path: Path) -> None:
    """Without an override it is the file's."""
    text = (Path(__file__).parents[3] / "dcmg/scenarios/gallo_six_dgu.yaml").read_text("utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(f"{text}\nmonitor: {{detector: {{kind: oracle}}}}\n", "utf-8")
    chosen = ScenarioOptions(name=str(path), duration_sec=None, seed=None, out=None, overrides=["attacks=[]"])
    with pytest.raises(ScenarioError, match=r"mine\.yaml: monitor\.detector\.kind = 'oracle': expected one of"):
        check_monitors(chosen.load(), chosen)
