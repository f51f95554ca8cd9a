"""Inputs and attacks on a link of a recorded run."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bags.mcap.errors import BagError
from bags.reconstruct.estimate import reconstruct_link
from bags.reconstruct.reconstruction_plot import draw_reconstruction
from bags.runs.offline import simulate_to_bag
from bags.watch.scenarios import load_scenario
from dcmg.cli import app
from dcmg.shipped import scenario_path
from dgu_sim.grid import Link

LINK = Link(1, 2)


@pytest.fixture(scope="module", name="run")
def _run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped scenario, without waiting: 6 s with the attacks brought forward."""
    attacks = (
        "[{kind: bias, link: 2-1, start_sec: 3.5, bias: [0, 1, 0]}, "
        "{kind: bias, link: 1-2, start_sec: 4.5, stop_sec: 5.5, bias: [0.1, 0, 0]}]"
    )
    scenario = load_scenario(scenario_path("reconstruct_six_dgu"), ["duration_sec=6.0", f"attacks={attacks}"])
    return simulate_to_bag(scenario, tmp_path_factory.mktemp("reconstruct") / "bag")


@pytest.mark.parametrize("kind", ["delayed", "cl_uie"])
def test_load_reference_and_attack_come_out_of_the_bag(run: Path, kind: str) -> None:
    """Inputs within their uncertainty before the attack; the false V measured, alone and as one of all outputs."""
    found = reconstruct_link(run, LINK, estimator=kind, noise_std=(1e-3, 1e-3, 1e-4))
    assert np.all(found.input_error() < found.input_uncertainty)  # rms against two standard deviations
    assert np.all(found.input_error() > 0.25 * found.input_uncertainty)
    on_v = found.hypotheses[0]
    assert abs(on_v.magnitude - found.truth(0)) < on_v.uncertainty
    assert found.vector is not None
    truth = np.array([found.truth(channel) for channel in range(3)])
    assert np.all(np.abs(found.vector.magnitude - truth) < found.vector.uncertainty)


def test_where_two_outputs_are_sent_only_inputs_come_out(tmp_path: Path) -> None:
    """V and I_t: loads and references exactly, no attack, and that is said."""
    scenario = load_scenario(scenario_path("gallo_six_dgu_partial"), ["duration_sec=2.0", "attacks=[]"])
    found = reconstruct_link(simulate_to_bag(scenario, tmp_path / "bag"), Link(3, 1))
    np.testing.assert_allclose(found.inputs[100:-1], found.applied[100:-1], rtol=0.0, atol=1e-6)
    assert all("no exact decoupling" in one.verdict for one in found.hypotheses)
    assert found.vector is None
    assert json.loads(json.dumps(found.document(), allow_nan=False))["hypotheses"][0]["magnitude"] is None


def test_a_link_that_is_not_there_is_named(run: Path) -> None:
    """One line with the links that are."""
    with pytest.raises(BagError, match="no link 1-4, expected one of"):
        reconstruct_link(run, Link(1, 4))


def test_the_command_prints_and_draws(run: Path, tmp_path: Path) -> None:
    """`dcmg reconstruct` as table and as JSON; the picture is a PNG."""
    shown = CliRunner().invoke(app, ["reconstruct", str(run), "--link", "1-2", "--out", str(tmp_path)])
    assert shown.exit_code == 0, shown.output
    assert "V alone [V]" in shown.output
    assert (tmp_path / "reconstruction_1-2.png").read_bytes().startswith(b"\x89PNG")
    told = CliRunner().invoke(
        app, ["reconstruct", str(run), "--link", "1-2", "--start", "4.6", "--stop", "5.4", "--json"]
    )
    document = json.loads(told.stdout)
    assert (document["attack_start_sec"], document["attack_stop_sec"]) == pytest.approx((4.6, 5.4))
    assert document["hypotheses"][0]["magnitude"] == pytest.approx(0.1, abs=5e-3)


def test_a_run_without_attack_is_drawn_too(run: Path, tmp_path: Path) -> None:
    """No alarm: inputs only, nothing measured."""
    found = reconstruct_link(run, Link(4, 2))
    assert found.spans.attack[0] == found.spans.attack[1]
    assert "no alarm" in found.vector_reason
    assert draw_reconstruction(found, tmp_path).exists()
