"""Pictures of the pages that people see, taken with Chromium, as wide as a phone and as a screen, light and dark."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from bags.reporting.options import ReportOptions
from bags.reporting.write import write_report
from bags.runs.run_record import RunRecord

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PROBE = """<script>addEventListener("load", () => setTimeout(() => {
  const lefts = [...document.querySelectorAll(".grid3 > div")].map((one) => one.offsetLeft);
  parent.postMessage(`${document.documentElement.scrollWidth} ${new Set(lefts).size}`, "*");
}, 1500));</script></body>"""
# a window of Chromium is at least 500 pixels wide, a frame is not
FRAME = """<!doctype html><title>waiting</title><script>
addEventListener("message", (told) => { document.title = `probe ${told.data}`; });
</script><iframe src="report.html" style="width: WIDTHpx; height: 2000px; border: 0"></iframe>"""

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium here: apt-get install chromium")


@pytest.fixture(name="page", scope="module")
def _page(record: RunRecord, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the recorded run, which also tells how wide it became."""
    made = write_report([record], record.steps, tmp_path_factory.mktemp("screens"), ReportOptions())
    made.html.write_text(made.html.read_text(encoding="utf-8").replace("</body>", PROBE), encoding="utf-8")
    return made.html


def _browse(page: Path, width: int, *options: str, dark: bool = False) -> str:
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    fixed = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=8000")
    command = [str(BROWSER), *fixed, scheme, f"--window-size={width},2400", *options, page.as_uri()]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=200, cwd=page.parent)
    return done.stdout


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("dark", [False, True])
def test_the_page_follows_the_scheme_and_fits(page: Path, width: int, *, dark: bool) -> None:
    """The picture is as wide as asked and as light or dark as the reader wants, plots included."""
    shot = page.parent / f"report-{width}-{'dark' if dark else 'light'}.png"
    _browse(page, width, f"--screenshot={shot}", dark=dark)
    picture = imread(shot)[..., :3]
    assert picture.shape[1] == width
    below_the_header = picture[300:, 4:-4]
    light = float((below_the_header.mean(axis=-1) > 0.8).mean())
    assert light < 0.1 if dark else light > 0.6
    assert len(np.unique((below_the_header * 15).astype(int).reshape(-1, 3), axis=0)) > 20  # something is drawn


@pytest.mark.parametrize(("width", "columns"), [(390, 1), (1280, 3)])
def test_nothing_sticks_out(page: Path, width: int, columns: int) -> None:
    """The page is never wider than its window: tables scroll in their own frames, panels stand below each other."""
    frame = page.with_name(f"frame-{width}.html")
    frame.write_text(FRAME.replace("WIDTH", str(width)))
    text = _browse(frame, 1400, "--dump-dom")
    assert re.findall(r"<title>probe (\d+) (\d+)</title>", text) == [(str(width), str(columns))]


def test_it_prints(page: Path) -> None:
    """Printing gives a PDF of some pages."""
    target = page.parent / "report.pdf"
    _browse(page, 1280, f"--print-to-pdf={target}")
    assert target.read_bytes().startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", target.read_bytes())) <= 12
