"""What was probably meant."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dgu_sim.suggestions import meant

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["did_you_mean"]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Name the nearest known words, and all of them: the end of a line that refuses `word`."""
    names = sorted(known)
    return f"{meant(word, names)} expected one of {', '.join(names)}".lstrip()
