"""The reduced-order example and its negative counterpart."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dcmg.papers import ruio_example

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("seed", range(5))
def test_numbers_of_the_page(seed: int) -> None:
    """Order 2, eigenvalues .55 and .40, C identified, error gone, the impossible system refused by name."""
    failed = [check for check in ruio_example.checks(ruio_example.run(seed)) if not check.ok]
    assert not failed


def test_figure_is_written(tmp_path: Path) -> None:
    """The error curves become one PNG file."""
    (path,) = ruio_example.plot(ruio_example.run(0), tmp_path)
    assert path.read_bytes().startswith(b"\x89PNG")
