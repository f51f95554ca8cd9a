"""The documentation site: every page has its place, and every link leads somewhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MADE = {"reference.md", "keys.md"}  # by docs/site_pages.py, when the site is built


def _pages(part: Any) -> list[str]:  # noqa: ANN401 - nested lists and mappings of YAML
    if isinstance(part, str):
        return [part]
    return [page for one in (part.values() if isinstance(part, dict) else part) for page in _pages(one)]


def test_every_page_stands_in_the_navigation_once_and_in_order() -> None:
    """Tutorials, how-to, reference, explanation; nothing else, nothing twice, nothing forgotten."""
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert [next(iter(part)) for part in nav] == ["Home", "Tutorials", "How to", "Reference", "Explanation"]
    pages = _pages(nav)
    assert len(pages) == len(set(pages))
    assert set(pages) == {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} | MADE


def test_links_between_pages_lead_somewhere() -> None:
    """What `make site` would refuse."""
    for page in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\((?!https?:)([^)#\s]+)", page.read_text(encoding="utf-8")):
            found = (page.parent / link).resolve()
            assert found.exists() or (page.parent == DOCS and link in MADE), (page.name, link)
            assert DOCS in found.parents, f"{page.name}: {link} is outside the site"
