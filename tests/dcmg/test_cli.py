"""The command line: what it teaches, what it prints, and how it refuses."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bags.runs.reader import read_run
from bags.watch.scenarios import load_scenario
from dcmg.cli import main
from dcmg.shipped import scenario_path, shipped_scenarios

Outcome = tuple[int, str, str]
Dcmg = Callable[..., Outcome]


@pytest.fixture
def dcmg(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Dcmg:
    """`dcmg` in this process: exit code, standard output, standard error."""

    def call(*arguments: str | Path) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["dcmg", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        captured = capsys.readouterr()
        code = ended.value.code
        return code if isinstance(code, int) else 0, captured.out, captured.err

    return call


@pytest.mark.parametrize(
    "command",
    [
        (),
        ("run",),
        ("simulate",),
        ("replay",),
        ("experiment",),
        ("node",),
        ("attack",),
        ("attack", "start"),
        ("paper",),
        ("player",),
    ],
)
def test_help_teaches(dcmg: Dcmg, command: tuple[str, ...]) -> None:
    """Every command explains itself."""
    code, out, _ = dcmg(*command, "--help")
    assert code == 0
    assert "Usage" in out
    assert len(out.splitlines()) > 8


def test_scenarios_lists_what_run_accepts(dcmg: Dcmg) -> None:
    """`dcmg scenarios` names every shipped scenario, and each of them is valid."""
    code, out, _ = dcmg("scenarios")
    assert code == 0
    for name, path in shipped_scenarios().items():
        assert name in out
        assert load_scenario(path).name == name


@pytest.mark.parametrize("command", ["simulate", "run"])
@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("no_such",), "no_such: no such scenario; expected one of"),
        (("./no_such.yaml",), "./no_such.yaml: no such file"),
        (("gallo_six_dgu", "--set", "coupling=loose"), "override 'coupling=loose': coupling = 'loose': expected"),
        (("gallo_six_dgu", "--set", "secondary.gain=0.5"), "secondary.gain = 0.5"),
        (("gallo_six_dgu", "--set", "colour=red"), "colour = 'red': no such key"),
        (("gallo_six_dgu", "--set", "dgus.0.capacitance_f=-1"), "dgus.0.capacitance_f = -1"),
        (("gallo_six_dgu", "--set", "nonsense"), "expected KEY=VALUE"),
        (("gallo_six_dgu", "--duration", "-3"), "duration_sec = -3.0"),
        (("gallo_six_dgu", "--set", "monitor.observer.kind=oracle"), "oracle"),
        (("gallo_six_dgu", "--set", "monitor.detector.options.margin=-1"), "margin"),
        (("gallo_six_dgu", "--history", "no_such_bag"), "no_such_bag"),
    ],
)
def test_bad_scenarios_end_in_one_line(
    dcmg: Dcmg, tmp_path: Path, command: str, arguments: tuple[str, ...], expected: str
) -> None:
    """What is wrong with a scenario is said in one line before anything starts, with exit code 2."""
    code, out, err = dcmg(command, *arguments, "--out", tmp_path / "run")
    assert (code, out) == (2, "")
    assert expected in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_folder_in_use_is_not_overwritten(dcmg: Dcmg, tmp_path: Path) -> None:
    """--out on a folder that holds something is refused, and what it holds stays."""
    (tmp_path / "precious.txt").write_text("data")
    code, _, err = dcmg("simulate", "gallo_six_dgu", "--out", tmp_path)
    assert code == 2
    assert "expected a new or empty folder" in err
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


def test_rate_needs_realtime(dcmg: Dcmg, tmp_path: Path) -> None:
    """--rate without --pacing realtime is a misunderstanding, and is said to be one."""
    code, _, err = dcmg("run", "gallo_six_dgu", "--rate", "2", "--out", tmp_path / "run")
    assert code == 2
    assert err == "dcmg: --rate 2: expected only together with --pacing realtime\n"


def test_simulate_prints_one_json_document(dcmg: Dcmg, tmp_path: Path) -> None:
    """--json leaves nothing but the document on standard output; the plots it names exist."""
    code, out, err = dcmg("simulate", "gallo_six_dgu", "--duration", "6", "--seed", "7", "--json", "--out", tmp_path)
    assert code == 0, err
    document = json.loads(out)
    assert (document["scenario"], document["seed"], document["steps"]) == ("gallo_six_dgu", 7, 600)
    assert document["bag"] == str(tmp_path / "bag")
    assert len(document["plots"]) == 2
    assert all(Path(plot).read_bytes().startswith(b"\x89PNG") for plot in document["plots"])
    assert [one["seen"] for one in document["attacks"]] == [True]


def test_monitors_are_designed_from_a_recorded_history(dcmg: Dcmg, tmp_path: Path) -> None:
    """`dcmg experiment` writes a bag from which `--history` designs the monitors that its seed would have given."""
    options = ("gallo_six_dgu", "--duration", "4", "--set", "attacks=[]", "--no-plots", "--json")
    assert dcmg("experiment", "gallo_six_dgu", "--seed", "11", "--out", tmp_path / "h")[0] == 0
    assert dcmg("simulate", *options, "--seed", "11", "--out", tmp_path / "experiment")[0] == 0
    code, _, err = dcmg(
        "simulate", *options, "--seed", "3", "--history", tmp_path / "h/history", "--out", tmp_path / "s"
    )
    assert code == 0, err
    recorded, expected = read_run(tmp_path / "s/bag"), read_run(tmp_path / "experiment/bag")
    assert recorded.designs == expected.designs


def test_a_history_of_other_dgus_is_refused(dcmg: Dcmg, tmp_path: Path) -> None:
    """A history that lacks a watched DGU ends in one line that names it."""
    assert dcmg("experiment", "gallo_six_dgu", "--dgu", "1", "--out", tmp_path / "h")[0] == 0
    code, _, err = dcmg("simulate", "gallo_six_dgu", "--history", tmp_path / "h/history", "--out", tmp_path / "s")
    assert code == 2
    assert "expected a recorded history of DGU 2" in err


def test_replay_needs_a_bag(dcmg: Dcmg, tmp_path: Path) -> None:
    """What is not a bag is said not to be one."""
    code, _, err = dcmg("replay", tmp_path / "nothing")
    assert code == 2
    assert "does not exist, expected a bag's directory" in err


def test_unknown_node_is_refused(dcmg: Dcmg, tmp_path: Path) -> None:
    """`dcmg node` with a name the scenario does not have lists those it has."""
    code, _, err = dcmg("node", "dgu_9", "--scenario", "gallo_six_dgu", "--out", tmp_path)
    assert code == 2
    assert "dgu_9: no such node; scenario gallo_six_dgu has clock, dgu_1" in err


@pytest.mark.parametrize("name", ["turan-fig2", "turan-fig3"])
def test_paper_figures_come_with_checked_numbers(dcmg: Dcmg, tmp_path: Path, name: str) -> None:
    """`dcmg paper` writes figure and numbers, and every published number is met."""
    code, out, err = dcmg("paper", name, "--seed", "4", "--out", tmp_path, "--json")
    assert code == 0, err
    document = json.loads(out)
    assert all(check["ok"] for check in document["checks"])
    assert len(document["pictures"]) == 1
    assert Path(document["pictures"][0]).read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / f"{name}.json").read_text()) == document


def test_shipped_name_and_path_are_the_same(tmp_path: Path) -> None:
    """A scenario file given by path is that file, wherever it lies."""
    copy = tmp_path / "copy.yaml"
    copy.write_text(load_scenario(scenario_path("gallo_six_dgu")).to_yaml())
    assert load_scenario(scenario_path(str(copy))) == load_scenario(scenario_path("gallo_six_dgu"))


def test_design_prints_a_certificate_and_refuses_with_exit_code_1(dcmg: Dcmg, tmp_path: Path) -> None:
    """An exact history gives an accepted certificate; a noisy one of unknown rank is refused, in words."""
    assert dcmg("experiment", "gallo_six_dgu", "--dgu", "1", "--out", tmp_path / "exact")[0] == 0
    code, out, _ = dcmg("design", tmp_path / "exact/history", "--dgu", "1", "--json")
    certificate = json.loads(out)
    assert (code, certificate["accepted"], certificate["residual"]["blind"]) == (0, True, False)
    noisy = ("--set", "history.noise_std=0.001")
    assert dcmg("experiment", "gallo_six_dgu", "--dgu", "1", *noisy, "--out", tmp_path / "noisy")[0] == 0
    code, out, _ = dcmg("design", tmp_path / "noisy/history", "--dgu", "1")
    assert code == 1
    assert "refused" in out
    code, out, _ = dcmg("design", tmp_path / "noisy/history", "--dgu", "1", "--option", "unknown_inputs=2", "--json")
    assert (code, json.loads(out)["residual"]["blind"]) == (0, False)


def test_design_explains_a_wrong_option(dcmg: Dcmg, tmp_path: Path) -> None:
    """An option that is not NAME=VALUE, or that no design has, ends in one line."""
    assert dcmg("experiment", "gallo_six_dgu", "--dgu", "1", "--out", tmp_path / "h")[0] == 0
    for option in ("nonsense", "colour=red"):
        code, _, err = dcmg("design", tmp_path / "h/history", "--option", option)
        assert code == 2
        assert len(err.strip().splitlines()) == 1


def test_bag_check_finds_a_fresh_bag_clean(dcmg: Dcmg, tmp_path: Path) -> None:
    """What `dcmg simulate` writes is intact; with a byte changed it is not."""
    assert dcmg("simulate", "gallo_six_dgu", "--duration", "6", "--no-plots", "--json", "--out", tmp_path / "s")[0] == 0
    assert dcmg("bag", "check", tmp_path / "s/bag")[0] == 0
    (file,) = (tmp_path / "s/bag").glob("*.mcap")
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    assert dcmg("bag", "check", tmp_path / "s/bag")[0] != 0
