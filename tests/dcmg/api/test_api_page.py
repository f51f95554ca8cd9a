"""docs/api.md says what is so: its snippets run, in order, and no public name is without an explanation."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import dcmg

PAGE = Path(__file__).parents[3] / "docs" / "api.md"


def test_the_snippets_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each goes on where the one before ended, as for a person who types them."""
    monkeypatch.chdir(tmp_path)
    snippets = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(snippets) > 4
    typed: dict[str, object] = {}
    for snippet in snippets:
        exec(compile(snippet, str(PAGE), "exec"), typed)  # noqa: S102 (our own page)
    assert (tmp_path / "report/report.html").is_file()


@pytest.mark.parametrize("name", dcmg.__all__)
def test_every_public_name_explains_itself(name: str) -> None:
    """It exists, has a docstring, and a function's docstring names every argument."""
    found = getattr(dcmg, name)
    text = inspect.getdoc(found)
    assert text
    if inspect.isfunction(found) and found.__module__.startswith("dcmg.api"):
        assert all(f"{argument}:" in text for argument in inspect.signature(found).parameters if argument != "bag")


def test_public_names_are_listed_and_others_refused() -> None:
    """`dir` is what an interpreter completes; a wrong name is an AttributeError."""
    assert dir(dcmg) == sorted(dcmg.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'desing'"):
        _ = dcmg.desing  # type: ignore[attr-defined]
