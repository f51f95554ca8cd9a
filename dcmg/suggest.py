"""What was probably meant."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["did_you_mean"]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Name the nearest known words, and all of them: the end of a line that refuses `word`."""
    names = sorted(known)
    close = get_close_matches(word, names, n=1)
    nearest = f"did you mean {close[0]}? " if close else ""
    return f"{nearest}expected one of {', '.join(names)}"
