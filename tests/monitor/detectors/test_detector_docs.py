"""docs/detectors.md names every detector, and its worked example is executed."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from monitor.detectors import KINDS, build, registry

if TYPE_CHECKING:
    from collections.abc import Callable

    from monitor.detectors import Detector


@pytest.fixture(name="page", scope="module")
def _page() -> str:
    return (Path(__file__).parents[3] / "docs" / "detectors.md").read_text(encoding="utf-8")


def test_every_detector_stands_in_the_table(page: str) -> None:
    """One row for each kind, in the order of the registry."""
    table = page.split("| detector | promise")[1].split("\n\n", maxsplit=1)[0]
    assert re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE) == list(KINDS)


def test_worked_example_is_one_file_and_one_line(
    page: str, judge: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file and the line of the page make a detector that a scenario can name."""
    file, line = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    module = types.ModuleType("sudden")
    monkeypatch.setitem(sys.modules, "sudden", module)  # dataclasses look their module up
    exec(compile(file, "sudden.py", "exec"), module.__dict__)  # noqa: S102 - the page's own code
    added: dict[str, Any] = eval(f"{{{line}}}", {"sudden": module})  # noqa: S307 - idem
    monkeypatch.setattr(registry, "KINDS", {**KINDS, **added})
    detector: Detector[Any] = build("sudden", {"jump": 0.5, "settle_sec": 0.1}, 0.01)
    residuals = np.zeros((40, 3, 1))
    residuals[20:, 1] = 1.0
    alarm = judge(detector, residuals).alarm[:, 0]
    assert np.flatnonzero(alarm).tolist() == [20]
    assert "no false alarm while" in detector.promise
