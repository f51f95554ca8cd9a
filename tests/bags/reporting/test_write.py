"""Reports as files."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bags.mcap.errors import BagError
from bags.reporting.options import ReportOptions
from bags.reporting.write import Report, write_report
from bags.runs.run_record import RunRecord
from bags.wire.arrays import grouped
from dgu_sim.grid import Link


@pytest.fixture(scope="module")
def report(record: RunRecord, tmp_path_factory: pytest.TempPathFactory) -> Report:
    """The report of the recorded run."""
    return write_report([record], record.steps, tmp_path_factory.mktemp("reported") / "new", ReportOptions())


def test_page_needs_no_network(report: Report) -> None:
    """The page loads nothing from anywhere, holds its plots, and stays small enough to send."""
    text = report.html.read_text(encoding="utf-8")
    markup = re.sub(r"(<script\b[^>]*>).*?</script>", r"\1</script>", text, flags=re.DOTALL)
    assert not re.findall(r"\b(?:src|href)\s*=|@import|url\((?!#)", markup)
    assert "Bokeh" in text
    assert text.count("data-root-id") == 4 + 4  # overview, states, impact, ROC, and a panel for each link
    assert report.html.stat().st_size < 6e6


def test_page_says_what_happened(report: Report) -> None:
    """Attacked links, the verdict of each design, the promise of the detector and the seed are there in words."""
    text = report.html.read_text(encoding="utf-8")
    for words in ("2 of 2", "1 → 2", "accepted: ", "none that can be stated", "three_dgus", "Who was attacked"):
        assert words in text
    assert report.timeline.run.scenario_text.splitlines()[-1].strip() in text


def test_document_is_plain_json(report: Report) -> None:
    """The document holds every measure, and nothing that JSON does not know."""

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    document = json.loads(report.json.read_text(encoding="utf-8"), parse_constant=refuse)
    assert (document["scenario"], document["steps"], document["truth"]) == ("three_dgus", 240, True)
    assert [one["link"] for one in document["links"]] == ["2-1", "3-1", "1-2", "1-3"]
    assert [(one["from_sec"], one["to_sec"], one["seen"]) for one in document["attacks"]] == [
        (1.0, 1.5, True),
        (2.0, None, True),
    ]
    assert document["overall"]["residual"]["missed"]["interval"]["method"] == "Clopper-Pearson"
    assert set(document["attacks"][0]["impact"]) == {"mean_voltage", "voltage", "sharing"}


def test_sparse_runs_have_a_report_too(record: RunRecord, tmp_path: Path) -> None:
    """No truth, no scenario, no design, no residual, or not a single step: the report says so instead of failing."""
    nothing = np.full_like(record.residual, np.nan)
    said: dict[str, Any] = dict.fromkeys(("residual", "threshold", "estimate"), nothing)
    said |= {"phase": 0 * record.phase, "alarm": record.alarm & False}
    foreign = replace(
        record.with_arrays({"state.x": np.full_like(record.x, np.nan), **grouped("residual", said)}),
        attachments={},
        designs={Link(1, 2): replace(record.designs[Link(1, 2)], accepted=False, verdict="refused: no data")},
        events=(),
    )
    text = write_report([foreign], record.steps, tmp_path / "a", ReportOptions()).html.read_text(encoding="utf-8")
    assert "No ground truth" in text
    assert "not known whether attacked" in text
    assert "No attack in this run" not in text
    assert "accused without attack" not in text
    assert "refused: no data" in text
    empty = replace(record.rows(0, 0), events=(), alarms=())
    made = write_report([empty], 0, tmp_path / "b", ReportOptions())
    assert json.loads(made.json.read_text(encoding="utf-8"))["steps"] == 0


def test_folder_that_cannot_be_written(record: RunRecord, tmp_path: Path) -> None:
    """A file in the way of the folder is one line that names it."""
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match=r"file: the report cannot be written"):
        write_report([record], record.steps, tmp_path / "file", ReportOptions())
