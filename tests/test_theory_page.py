"""The theory page: whatever cites it finds what it cites, and what it names is there."""

from __future__ import annotations

import re
from pathlib import Path

from dcmg.commands.measure import MEASURES
from dcmg.commands.paper import EXPERIMENTS
from dgu_sim.attacks import KINDS

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/theory.md").read_text("utf-8")
SECTIONS = set(re.findall(r"^## (\d)\. ", PAGE, re.MULTILINE))
_CITED = re.compile(r"theory(?:\.md\))?(?:\.md)?,? sections? (\d)(?: and (\d))?")


def _files() -> list[Path]:
    folders = ("bags", "dcmg", "dgu_sim", "docs", "monitor", "ros_ws/src", "tests")
    return [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".md"}]


def test_every_section_that_is_cited_is_there() -> None:
    """Docstrings, help and pages cite sections by number."""
    cited = {
        number: path
        for path in _files()
        for found in _CITED.findall(path.read_text("utf-8").replace("](theory.md)", ""))
        for number in found
        if number
    }
    assert len(cited) >= 6
    assert set(cited) <= SECTIONS, cited


def test_what_it_names_exists() -> None:
    """Files, pages, commands and kinds of attacks on the page are those of this repository."""
    for link in re.findall(r"\]\(([^)#]+\.md)\)", PAGE):
        assert (ROOT / "docs" / link).is_file(), link
    named = set(re.findall(r"`([\w/.-]+)`", PAGE))
    for path in (one for one in named if "/" in one):
        assert (ROOT / path).exists(), path
    for group, known in (("paper", EXPERIMENTS), ("measure", MEASURES)):
        assert set(re.findall(rf"`dcmg {group} ([\w-]+)", PAGE)) <= set(known)
    attacks = re.findall(r"attack\s`(\w+)`", PAGE)
    assert attacks
    assert set(attacks) <= set(KINDS)


def test_every_equation_that_is_cited_stands_there() -> None:
    """What a docstring cites by paper and number, T (13) say, can be read on the page."""
    cited = {
        (paper, number): path.name
        for path in _files()
        for paper, number in re.findall(r"\b([TDRIC]) \((\d+)\)", path.read_text("utf-8"))
    }
    there = set(re.findall(r"\b([TDRIC]) \((\d+)\)", PAGE))
    listed = re.findall(r"\b([TDRIC]) \((\d+)\)(?:, \((\d+)\)|-\((\d+)\))", PAGE)
    there |= {(paper, last or other) for paper, _, other, last in listed}
    assert len(cited) > 20
    assert set(cited) <= there, {one: cited[one] for one in set(cited) - there}
