"""A bag → its report: one HTML and one JSON file."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from bags.mcap.errors import BagError
from bags.reporting.assessment import Assessment, assess
from bags.reporting.documents import report_document
from bags.reporting.options import ReportOptions
from bags.reporting.page import page
from bags.reporting.timeline import Timeline, gather
from bags.reporting.unanswered import unanswered
from bags.runs.run_record import RunRecord

HTML_NAME, JSON_NAME = "report.html", "report.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What was measured and where it was written.

    Attributes:
        timeline: The run, gathered.
        assessment: Its measures.
        html: The page.
        json: The document.
    """

    timeline: Timeline
    assessment: Assessment
    html: Path
    json: Path


def write_report(windows: Iterable[RunRecord], steps: int, folder: Path | str, options: ReportOptions) -> Report:
    """Measure a run and write its report.

    Args:
        windows: Consecutive windows of the run; at least one.
        steps: Its complete steps.
        folder: Where to; made if it does not exist, an earlier report there is replaced.
        options: Choices behind the measures.

    Raises:
        BagError: A window cannot be read, or the folder cannot be written.
    """
    folder = Path(folder)
    html, document = folder / HTML_NAME, folder / JSON_NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        timeline = gather(windows, steps, options)
        assessment = assess(timeline, options, unanswered(timeline))
        text = page(timeline, assessment)
        html.write_text(text, encoding="utf-8")
        document.write_text(json.dumps(report_document(timeline, assessment), allow_nan=False), encoding="utf-8")
    except OSError as error:
        raise BagError(f"{folder}: the report cannot be written: {error.strerror}") from None
    return Report(timeline=timeline, assessment=assessment, html=html, json=document)
