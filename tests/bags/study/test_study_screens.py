"""Pictures of the page of a study, taken with Chromium, as wide as a phone and as a screen, light and dark."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from matplotlib.image import imread

from bags.study import LocalPool, cells_of, compare, load_study, operating_points, run_study, tables_of
from bags.study.page import write_page
from dcmg.shipped import scenario_path

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# a window of Chromium is at least 500 pixels wide, a frame is not
FRAME = """<!doctype html><title>waiting</title><script>
addEventListener("message", (told) => { document.title = `probe ${told.data}`; });
</script><iframe src="study.html" style="width: WIDTHpx; height: 2000px; border: 0"></iframe>"""
PROBE = """<script>addEventListener("load", () => parent.postMessage(document.documentElement.scrollWidth, "*"));
</script></body>"""

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium here: apt-get install chromium")


@pytest.fixture(name="page", scope="module")
def _page(tiny_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a tiny study, which also tells how wide it became."""
    tiny, folder = load_study(tiny_file), tmp_path_factory.mktemp("study")
    points = operating_points(tables_of(run_study(cells_of(tiny, "tiny.yaml", scenario_path), folder, LocalPool(1))))
    made = write_page(tiny, points, compare(points, 1e-2), folder)
    made.write_text(made.read_text(encoding="utf-8").replace("</body>", PROBE), encoding="utf-8")
    return made


def _browse(page: Path, width: int, *options: str, dark: bool = False) -> str:
    scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
    fixed = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=4000")
    command = [str(BROWSER), *fixed, scheme, f"--window-size={width},1200", *options, page.as_uri()]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=200, cwd=page.parent).stdout


@pytest.mark.parametrize("width", [390, 1280])
def test_the_page_follows_the_scheme_and_fits(page: Path, width: int) -> None:
    """As light or dark as the reader wants, and never wider than its window: the matrix scrolls in its own frame."""
    shares = {}
    for dark in (False, True):
        shot = page.parent / f"study-{width}-{'dark' if dark else 'light'}.png"
        _browse(page, width, f"--screenshot={shot}", dark=dark)
        shares[dark] = float((imread(shot)[300:, 4:-4, :3].mean(axis=-1) > 0.8).mean())
    assert shares[False] > 0.6
    assert shares[True] < 0.1
    frame = page.with_name(f"frame-{width}.html")
    frame.write_text(FRAME.replace("WIDTH", str(width)))
    assert re.findall(r"<title>probe (\d+)</title>", _browse(frame, 1400, "--dump-dom")) == [str(width)]
