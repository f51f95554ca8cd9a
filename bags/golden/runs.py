"""What the golden bags are and how they are made."""

import json
import shutil
from pathlib import Path
from typing import Any

from bags.golden.examples import EXAMPLES, result_of, write_example
from bags.reporting.documents import run_document
from bags.reporting.judged import judge
from bags.reporting.timeline import gather
from bags.runs.offline import simulate_to_bag
from bags.runs.reader import read_run
from bags.runs.run_record import RunRecord
from bags.watch.scenarios import load_scenario

_FOLDER = Path(__file__).parent
_THREE = "three_dgus.yaml"
_TURAN = "turan_2021.yaml"

_BIASES = (
    "[{kind: bias, link: 1-2, start_sec: 1.0, stop_sec: 1.4, bias: [0.1, 0.1, 0.1]}, "
    "{kind: bias, link: 3-1, start_sec: 1.6, bias: [0.5, 0.0, 0.0]}]"
)
# without noise, so that what cannot be seen is zero to rounding; shorter, because a few hundred kB are enough for all
_EXACT = ("noise={kind: none}", "duration_sec=1.5", "monitor.detector.options.calibrate_sec=0.5")
_DROPS = (
    "[{kind: drop, link: 1-2, start_sec: 0.9, stop_sec: 1.1}, "
    "{kind: drop, link: 3-1, start_sec: 1.0, probability: 0.3}]"
)
_TRAJECTORY = (
    "[{kind: uio_stealthy_trajectory, link: 1-2, start_sec: 0.8, rise_sec: 0.5, voltage_v: 0.5, current_a: 1.0}]"
)
_TEAM = (
    "{samples: 80, settle_sec: 0.6, calibrate_sec: 0.3, "
    "events: [{member: 3, kind: lies, start_sec: 1.1, stop_sec: 1.3, bias: [1.0, 0.0, 0.0]}]}"
)
GOLDEN: dict[str, tuple[str, tuple[str, ...]]] = {
    "attack_free": (_THREE, ("duration_sec=1.0",)),
    "biased": (_THREE, (f"attacks={_BIASES}",)),
    "stealthy": (
        _THREE,
        (
            *_EXACT,
            f"attacks={_TRAJECTORY}",
        ),
    ),
    "denial_of_service": (_THREE, (*_EXACT, f"attacks={_DROPS}")),
    "partial_output": (
        _THREE,
        (
            *_EXACT,
            "dgus.2.output=[V, I_t]",
            "monitor.observer={kind: reduced_order, options: {allow_blind: true}}",
            "attacks=[{kind: bias, link: 1-2, start_sec: 1.0, bias: [0.1, 0.1, 0.1]}]",
        ),
    ),
    "paper_turan_2021": (_TURAN, ()),
    "paper_delayed": (
        _THREE,
        (
            *_EXACT,
            "dgus.2.output=[V]",
            "history.samples=200",
            "monitor.observer={kind: delayed, options: {delay: 2, unknown_inputs: 2}}",
            "attacks=[{kind: bias, link: 1-2, start_sec: 1.0, bias: [0.1, 0.1, 0.1]}]",
        ),
    ),
    "paper_distributed": (_THREE, (*_EXACT, f"monitor.team={_TEAM}")),
}
"""Name of each recorded run, its scenario and how it differs from it."""


def golden_path(name: str, folder: Path = _FOLDER) -> Path:
    """The bag of a name; the expected results stand beside it as `<name>.json`."""
    return folder / name


def expected_of(name: str, folder: Path = _FOLDER) -> dict[str, Any]:
    """The expected results: the report of the run, without its path; of an example, what the method finds."""
    document: dict[str, Any] = json.loads((folder / f"{name}.json").read_text("utf-8"))
    return document


def record_golden(folder: Path = _FOLDER) -> tuple[Path, ...]:
    """Record all golden bags and their expected results, in place of older ones.

    Args:
        folder: Where to.

    Returns:
        The bags.

    Raises:
        BagError: A bag cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name in (*GOLDEN, *EXAMPLES):
        path = golden_path(name, folder)
        shutil.rmtree(path, ignore_errors=True)
        document = _record_run(name, path) if name in GOLDEN else _record_example(name, path)
        (folder / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    return tuple(golden_path(name, folder) for name in (*GOLDEN, *EXAMPLES))


def _record_run(name: str, path: Path) -> dict[str, Any]:
    scenario, overrides = GOLDEN[name]
    simulate_to_bag(load_scenario(_FOLDER / scenario, (f"name={name}", *overrides)), path)
    return result_of_run(read_run(path))


def result_of_run(record: RunRecord) -> dict[str, Any]:
    """The rows of a run, without the path of its bag."""
    timeline = gather([record], record.steps)
    document = run_document(timeline, judge(timeline))
    del document["bag"]
    return document


def _record_example(name: str, path: Path) -> dict[str, Any]:
    write_example(EXAMPLES[name], path)
    return result_of(EXAMPLES[name], path)
