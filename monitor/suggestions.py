"""What was probably meant by a word that nobody knows."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["meant"]


def meant(word: object, known: Iterable[str]) -> str:
    """Return "did you mean NAME?" of the nearest known name, or nothing when none is near."""
    names = list(known)
    close = get_close_matches(str(word), names, 1)
    if not close:  # part of a name, as in trajectory of uio_stealthy_trajectory
        close = [name for name in names if len(str(word)) > 2 and str(word) in name][:1]  # noqa: PLR2004 - "is" is in much
    return f"did you mean {close[0]}?" if close else ""
