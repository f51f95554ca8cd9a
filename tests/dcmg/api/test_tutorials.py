"""docs/tutorials: what a newcomer types runs, page by page, and its types are right."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mypy import api as mypy

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "docs" / "tutorials"
PAGES = sorted(path for path in FOLDER.glob("*.md") if path.name != "index.md")


def _code(page: Path) -> str:
    """All snippets of a page, one after the other, as a person types them."""
    return "\n".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every page has code, and it does what the page says: the asserts are in it."""
    monkeypatch.chdir(tmp_path)
    code = _code(page)
    assert "assert " in code
    exec(compile(code, page.name, "exec"), {})  # noqa: S102 (our own page)


def test_the_index_lists_every_tutorial_and_every_link_leads_somewhere() -> None:
    """No page is forgotten, and none points at nothing."""
    listed = re.findall(r"\]\((\w+\.md)\)", (FOLDER / "index.md").read_text(encoding="utf-8"))
    assert sorted(listed) == [page.name for page in PAGES]
    for page in FOLDER.glob("*.md"):
        for link in re.findall(r"\]\(([^)#:]+\.md)", page.read_text(encoding="utf-8")):
            assert (FOLDER / link).is_file(), (page.name, link)


def test_types_of_the_tutorials_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`mypy --strict`, as whoever copies the code may have it."""
    monkeypatch.chdir(ROOT)  # where the cache of `make lint` is
    files = []
    for page in PAGES:
        files.append(tmp_path / f"{page.stem}.py")
        files[-1].write_text(_code(page), encoding="utf-8")
    out, err, code = mypy.run(["--strict", *map(str, files)])
    assert code == 0, out + err
