"""Cells of a table as text: numbers, times, and what stands for a missing one."""

import math
import re
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

# what spreadsheets, historians, MATLAB, R and C write for "none", in lower case
MISSING: Final = frozenset(
    {"", "-", "--", "---", "?", ".", "na", "n/a", "#n/a", "#n/a n/a", "#na", "<na>", "null", "none", "missing", "nat"}
    | {"nan", "-nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan"}
    | {"#div/0!", "#value!", "#ref!", "#num!", "#name?", "#null!", "no data", "nodata", "bad", "bad input"}
)
_TRUTHS = {"true": 1.0, "false": 0.0}
_DATE = r"\d{4}-\d{2}-\d{2}"
_CLOCK = r"\d{2}:\d{2}(:\d{2}([.,]\d{1,9})?)?"
_ZONE = r"(Z|[+-]\d{2}(:?\d{2})?)"
_TIME = re.compile(rf"({_DATE}[T ]{_CLOCK} ?{_ZONE}?|{_CLOCK})")
_ZONED = re.compile(rf"{_DATE}[T ]{_CLOCK} ?{_ZONE}")
_SECOND_NS = 1_000_000_000


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.strip().lower() in MISSING


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, infinite ones included."""
    return not math.isnan(_number(cell, decimal))


def is_time(cell: str) -> bool:
    """Whether a cell is an instant as ISO 8601 writes it, or a time of day."""
    return bool(_TIME.fullmatch(cell.strip()))


def numbers_of(cells: Any, decimal: str) -> tuple[NDArray[np.float64], int | None]:  # noqa: ANN401 - an Arrow array
    """Cells as numbers, NaN where one is missing or infinite, and the row of the first one that is none."""
    trimmed = pc.utf8_trim_whitespace(cells)
    known = pc.if_else(pc.is_in(pc.utf8_lower(trimmed), value_set=pa.array(sorted(MISSING))), None, trimmed)
    if decimal == "," and pc.any(pc.match_substring(known, ".")).as_py():
        return _one_by_one(known, decimal)
    try:
        plain = pc.replace_substring(known, ",", ".") if decimal == "," else known
        found = plain.cast(pa.float64())
    except pa.ArrowInvalid:
        return _one_by_one(known, decimal)
    return _finite(found.fill_null(float("nan")).to_numpy(zero_copy_only=False)), None


def times_of(cells: Any) -> tuple[NDArray[np.int64], int | None]:  # noqa: ANN401 - an Arrow array
    """Cells as instants [ns since 1970 in UTC, or since midnight], and the row of the first one that is none."""
    texts = [text.strip() for text in cells.to_pylist()]
    for row, text in enumerate(texts):
        # with a zone and without one: who knows which of them is local time?
        if not _TIME.fullmatch(text) or _form(text) != _form(texts[0]):
            return np.empty(0, dtype=np.int64), row
    found = np.empty(len(texts), dtype=np.int64)
    for row, text in enumerate(texts):
        try:
            found[row] = _instant_ns(text)
        except (ValueError, OverflowError):
            return np.empty(0, dtype=np.int64), row
    return found, None


def _form(text: str) -> tuple[bool, bool]:
    """Whether an instant has a zone, and whether it has a date."""
    return _ZONED.fullmatch(text) is not None, "-" in text[:8]


def _instant_ns(text: str) -> int:
    """An instant to the nanosecond."""
    match = re.search(r"[.,](\d{1,9})", text)
    fraction = int(match[1].ljust(9, "0")) if match else 0
    whole = (text[: match.start()] + text[match.end() :] if match else text).replace(" Z", "Z").replace(" +", "+")
    stamp = np.datetime64(0, "s")
    if len(whole) < len("2000-01-01"):
        hours, minutes, *seconds = (int(part) for part in whole.split(":"))
        return (hours * 3600 + minutes * 60 + (seconds[0] if seconds else 0)) * _SECOND_NS + fraction
    zone = re.search(_ZONE + "$", whole[10:])
    offset = 0
    if zone:
        whole = whole[: len(whole) - len(zone[0])].rstrip()
        if zone[0] != "Z":
            digits = zone[0][1:].replace(":", "").ljust(4, "0")
            offset = (int(digits[:2]) * 3600 + int(digits[2:]) * 60) * (-1 if zone[0][0] == "-" else 1)
    stamp = np.datetime64(whole.replace(" ", "T"), "s")
    return (int(stamp.astype(np.int64)) - offset) * _SECOND_NS + fraction


def _one_by_one(cells: Any, decimal: str) -> tuple[NDArray[np.float64], int | None]:  # noqa: ANN401
    found = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells.to_pylist()):
        if cell is None:
            continue
        found[row] = _number(cell, decimal)
        if math.isnan(found[row]):
            return found, row
    return _finite(found), None


def _number(cell: str, decimal: str) -> float:
    """The number, NaN when it is none."""
    text = cell.strip()
    if text.lower() in _TRUTHS:
        return _TRUTHS[text.lower()]
    if decimal == ",":
        if "." in text:
            return math.nan
        text = text.replace(",", ".")
    try:
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def _finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Infinite is as good as missing."""
    if np.isinf(values).any():
        return np.where(np.isinf(values), np.nan, values)
    return np.asarray(values)
