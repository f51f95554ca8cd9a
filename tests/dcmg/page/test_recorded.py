"""A recorded run as what is shown: the bag's own numbers at every moment, the report's counts."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.reporting.documents import run_document
from bags.reporting.judged import judge
from bags.reporting.timeline import gather
from bags.runs.reader import open_run, read_run
from dcmg.cli import main
from dcmg.page.messages import Attack, View
from dcmg.page.pace import Pace
from dcmg.page.recorded import Recorded
from dcmg.page.source import RefusalError
from dcmg.page.viewer import Viewer

if TYPE_CHECKING:
    from collections.abc import Iterator

GOLDEN = Path(str(files("bags.golden")))


@pytest.fixture(name="source")
def _source() -> Iterator[Recorded]:
    source = Recorded(GOLDEN / "biased")
    yield source
    source.close()


@pytest.mark.parametrize("name", ["biased", "denial_of_service", "partial_output", "attack_free"])
def test_it_shows_what_the_bag_holds(name: str) -> None:
    """Every number of every step, and as many alarms on each link as the report counts."""
    path = GOLDEN / name
    source, record = Recorded(path), read_run(path)
    source.seek(record.steps)
    board, channels = source.board, source.board.channels
    for at in range(len(record.links)):
        for what, wanted in (("residual", record.residual), ("threshold", record.threshold)):
            found = board.trace.span(channels.vector(what, at), 0, record.steps).T
            assert np.array_equal(found, wanted[:, at], equal_nan=True)
    assert np.array_equal(board.trace.span(channels.dgu("voltage"), 0, record.steps).T, record.y[..., 0])
    run = open_run(path)
    timeline = gather(run.windows(), run.steps)
    told = run_document(timeline, judge(timeline))
    for link in told["links"]:
        began = [one for one in board.log if one.what == "alarm" and one.link == link["link"]]
        quiet = [one for one in began if not _attacked(source, one.link, one.step)]
        assert len(quiet) >= link["alarms"]
    assert {str(one.link) for one in record.events} == {one.link for one in board.log if one.what == "attack"}
    source.close()


def _attacked(source: Recorded, link: str | None, step: int) -> bool:
    at = [str(one) for one in source.board.links].index(str(link))
    return bool(source.board.trace.at(step)[source.board.channels.link("attacked")[at]])


def test_time_goes_back_and_what_is_shown_with_it(source: Recorded) -> None:
    """The log, the attacks and the curves are those of the moment that is shown, not of what was seen before."""
    pace = Pace(source, running=False)
    viewer = Viewer(pace)
    viewer.look(View(panels=["1-2", "heat"], span_sec=1.0, pixels=200))
    shown = {}
    for step in (120, 50, 120):
        source.seek(step)
        pace.touch()
        frame = viewer.frame()
        assert frame is not None
        assert frame.time.step == step
        (first, *_) = frame.series
        assert first.first_bin + len(first.low[0]) == step
        shown[step] = [(one.links, one.since_step) for one in frame.attacks]
        assert all(one.step < step for one in frame.log)
    assert shown == {120: [(["1-2"], 100)], 50: []}


def test_playing_ends_where_the_bag_does(source: Recorded) -> None:
    """At any speed: no step behind the last, and an attack on what is over is refused."""
    assert source.advance(150) == 150
    assert source.advance(150) == 50
    assert source.advance(1) == 0
    with pytest.raises(RefusalError, match="recorded run"):
        source.attack(Attack(id=1, action="start", links=["1-2"], attack="bias"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((str(GOLDEN / "biased"), "--seed", "3"), "--seed"),
        ((str(GOLDEN),), "metadata.yaml"),
        (("gallo_six_dg",), "gallo_six_dgu"),
        (("gallo_six_dgu", "--host", "256.1.1.1"), "--host"),
    ],
)
def test_what_cannot_be_shown_is_a_line(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2 and one line that names what is wrong."""
    monkeypatch.setattr("sys.argv", ["dcmg", "page", *words, "--no-browser"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
