"""The recorded runs in bags/golden: replayed, they give what they gave when they were recorded."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bags.golden import EXAMPLES, GOLDEN, expected_of, golden_path, record_golden
from bags.golden.examples import result_of
from bags.golden.runs import result_of_run
from bags.mcap.check import check
from bags.runs.reader import read_run
from bags.runs.replay import replay
from dgu_sim.grid import Link
from monitor.detectors import Phase

# T's experiment, published with it: whatever the history and the seed
ONSET, STEADY = (-0.0148, -0.0029, 0.0642), (-0.0178, -0.0035, 0.0769)
DIGITS = 1e-4
_REPEAT = """
import sys
from pathlib import Path
from bags.runs.reader import read_run
from bags.runs.replay import replay
for path in map(Path, sys.argv[1:]):
    run = read_run(path)
    assert replay(run).residual.tobytes() == run.residual.tobytes(), path
"""


@pytest.mark.parametrize("name", list(GOLDEN))
def test_replay_gives_the_expected_results(name: str) -> None:
    """Its own designs on a golden bag conclude what its JSON says, with the recorded residuals bit for bit."""
    assert check(golden_path(name)).clean
    recorded = read_run(golden_path(name))
    again = replay(recorded)
    document, expected = result_of_run(again), expected_of(name)
    assert document["attacks"] == expected["attacks"]
    assert len(document["links"]) == len(expected["links"]) > 1
    for link, wanted in zip(document["links"], expected["links"], strict=True):
        for key in ("link", "monitored", "observer", "attacks", "seen", "false_alarms", "first_alarm_sec"):
            assert link[key] == wanted[key], key
    assert (document["scenario"], document["seed"]) == (name, 7)
    assert document["steps"] == expected["steps"] == recorded.steps
    assert again.designs == recorded.designs
    assert again.residual.tobytes() == recorded.residual.tobytes()
    assert again.alarms == recorded.alarms


@pytest.mark.parametrize("kernel", ["Haswell", "Nehalem"])
def test_other_kernels_give_the_recorded_bits(kernel: str) -> None:
    """Whatever BLAS kernels the processor has, a golden bag brings what its monitors step."""
    bags = [str(golden_path(name)) for name in GOLDEN]
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    subprocess.run([sys.executable, "-c", _REPEAT, *bags], env=environment, check=True, timeout=300)


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_examples_give_the_expected_results(name: str) -> None:
    """The observer that a method learns from a golden history is the one that its JSON says."""
    assert check(golden_path(name)).clean
    found, expected = result_of(EXAMPLES[name], golden_path(name)), expected_of(name)
    assert found.pop("spectral_radius") == pytest.approx(expected.pop("spectral_radius"), abs=1e-6)
    assert found == expected
    assert found["accepted"]


def test_attacks_are_seen_as_theory_says() -> None:
    """Biases alarm at once; a stealthy trajectory and lost messages never do; nothing else alarms in any bag."""
    for name in GOLDEN:
        for link in expected_of(name)["links"]:
            assert not link["false_alarms"], name
            assert link["attacks"] or link["first_alarm_sec"] is None, name
    for name, seen, unseen in (
        ("attack_free", set(), set()),
        ("biased", {"1-2", "3-1"}, set()),
        ("stealthy", set(), {"1-2"}),
        ("denial_of_service", set(), {"1-2", "3-1"}),
        ("partial_output", {"1-2"}, set()),
        ("paper_turan_2021", {"1-2"}, set()),
        ("paper_delayed", {"1-2"}, set()),
        ("paper_distributed", set(), set()),
    ):
        attacks = expected_of(name)["attacks"]
        assert {one["links"][0] for one in attacks if one["seen"]} == seen, name
        assert {one["links"][0] for one in attacks if not one["seen"]} == unseen, name


def test_stealthy_attack_leaves_no_residual() -> None:
    """While the falsification reaches half a volt, the residual on exact data stays below 1e-9."""
    run = read_run(golden_path("stealthy"))
    link = run.links.index(Link(1, 2))
    falsified = run.received[:, link] - run.y[:, run.topics.dgus.index(1)]
    assert np.abs(falsified[-1, :2]).tolist() == pytest.approx([0.5, 1.0])
    assert np.nanmax(np.abs(run.residual[80:, link])) < 1e-9


def test_lost_samples_are_marked() -> None:
    """During a denial of service nothing is delivered, and the monitor settles anew behind every loss."""
    run = read_run(golden_path("denial_of_service"))
    link = run.links.index(Link(1, 2))
    lost = ~run.delivered[:, link]
    assert np.flatnonzero(lost).tolist() == list(range(90, 110))
    assert (run.phase[90:111, link] == Phase.SETTLING.value).all()
    assert 0 < (~run.delivered[100:, run.links.index(Link(3, 1))]).mean() < 1


def test_experiment_of_turan_2021() -> None:
    """The residual at the onset of the bias and its steady value are those published with the paper's experiment."""
    run = read_run(golden_path("paper_turan_2021"))
    residual = run.residual[:, run.links.index(Link(1, 2))]
    np.testing.assert_allclose(residual[50], ONSET, rtol=0.0, atol=DIGITS)
    np.testing.assert_allclose(residual[-1], STEADY, rtol=0.0, atol=DIGITS)


def test_oracles_of_the_examples() -> None:
    """R's poles are .55 and .40, I's best radius is the largest zero of its plant, .6751."""
    assert expected_of("paper_reduced_order")["order"] == 2
    assert expected_of("paper_reduced_order")["spectral_radius"] == pytest.approx(0.55, abs=1e-6)
    assert expected_of("paper_input_reconstruction")["spectral_radius"] == pytest.approx(0.6751, abs=5e-5)


def test_golden_bags_are_small() -> None:
    """No golden bag exceeds 300 kB, and all together not 1.6 MB."""
    total = 0
    for name in (*GOLDEN, *EXAMPLES):
        size = sum(file.stat().st_size for file in golden_path(name).iterdir())
        assert size < 300_000, name
        total += size
    assert total < 1_600_000


def test_recording_again(tmp_path: Path) -> None:
    """The command that makes the golden bags works, and makes the runs that are there."""
    bags = record_golden(tmp_path)
    assert [bag.name for bag in bags] == [*GOLDEN, *EXAMPLES]
    for name in GOLDEN:
        again, recorded = read_run(golden_path(name, tmp_path)), read_run(golden_path(name))
        assert again.x.tobytes() == recorded.x.tobytes()
        # what a stealthy attacker sends goes through LAPACK, as the designs do
        np.testing.assert_allclose(again.received, recorded.received, rtol=0.0, atol=1e-9)
        assert replay(again).residual.tobytes() == again.residual.tobytes()
