"""Cells of a table as text: numbers, times, and what stands for a missing one."""

import math
import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

# what spreadsheets, historians, MATLAB, R and C write for "none", in lower case
MISSING: Final = frozenset(
    {"", "-", "--", "---", "?", ".", "na", "n/a", "#n/a", "#n/a n/a", "#na", "<na>", "null", "none", "missing", "nat"}
    | {"nan", "-nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "-1.#qnan"}
    | {"\\n", "n.a.", "n/d", "nil", "undefined", "undef", "(null)", "(blank)", "*", "...", "err", "error", "overflow"}
    | {"#nv", "#n/d", "#wert!", "#bezug!", "#zahl!", "#valeur!", "#nombre!", "#valor!", "#¡valor!"}
    | {"#div/0!", "#value!", "#ref!", "#num!", "#name?", "#null!", "no data", "nodata", "bad", "bad input"}
)
_MINUS = "\N{MINUS SIGN}"  # as typesetters write it
_TRUTHS = {"true": 1.0, "false": 0.0}
_TIME = re.compile(
    r"(?:(?P<date>\d{4}-\d\d-\d\d|\d{4}/\d\d/\d\d|\d\d\.\d\d\.\d{4})(?:[T ]|$))?"
    r"(?:(?P<hour>\d{1,2}):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:[.,](?P<fraction>\d{1,9}))?)?"
    r"(?: ?(?P<zone>Z|UTC|GMT|[+-]\d\d(?::?\d\d)?))?)?"
)
_BASIC = re.compile(r"^(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)(?=$|[.,Z+-])")  # of ISO 8601
_SECOND_NS = 1_000_000_000


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    return cell.strip().lower() in MISSING


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, infinite ones included."""
    return not math.isnan(_number(cell, decimal))


def is_time(cell: str) -> bool:
    """Whether a cell is an instant with year, month and day in an order that leaves no doubt, or a time of day."""
    return _time(cell) is not None


def numbers_of(cells: Any, decimal: str) -> tuple[NDArray[np.float64], int | None]:  # noqa: ANN401 - an Arrow array
    """Cells as numbers, NaN where one is missing or infinite, and the row of the first one that is none."""
    trimmed = pc.replace_substring(pc.utf8_trim_whitespace(cells), _MINUS, "-")
    known = pc.if_else(pc.is_in(pc.utf8_lower(trimmed), value_set=pa.array(sorted(MISSING))), None, trimmed)
    if decimal == "," and pc.any(pc.match_substring(known, ".")).as_py():
        return _one_by_one(known, decimal)
    try:
        plain = pc.replace_substring(known, ",", ".") if decimal == "," else known
        found = plain.cast(pa.float64())
    except pa.ArrowInvalid:
        return _one_by_one(known, decimal)
    return _finite(found.fill_null(float("nan")).to_numpy(zero_copy_only=False)), None


def times_of(texts: Sequence[str]) -> tuple[NDArray[np.int64], int | None]:
    """Cells as instants [ns since 1970 in UTC, or since midnight], and the row of the first one that is none."""
    matches = [_time(text) for text in texts]
    found = np.empty(len(matches), dtype=np.int64)
    for row, match in enumerate(matches):
        # with a zone and without one: who knows which of them is local time?
        if match is None or _form(match) != _form(matches[0]):
            return np.empty(0, dtype=np.int64), row
        try:
            found[row] = _instant_ns(match)
        except (ValueError, OverflowError):
            return np.empty(0, dtype=np.int64), row
    return found, None


def _time(cell: str) -> re.Match[str] | None:
    match = _TIME.fullmatch(_BASIC.sub(r"\1-\2-\3T\4:\5:\6", cell.strip()))
    if match is None or not (match["date"] or match["hour"]) or (match["zone"] and not match["date"]):
        return None
    return match


def _form(match: re.Match[str] | None) -> tuple[bool, bool]:
    """Whether an instant has a zone, and whether it has a date."""
    return (False, False) if match is None else (match["zone"] is not None, match["date"] is not None)


def _instant_ns(match: re.Match[str]) -> int:
    """An instant to the nanosecond.

    Raises:
        ValueError: There is no such day or time.
    """
    hour, minute, second = (int(match[name] or 0) for name in ("hour", "minute", "second"))
    if hour > 23 or minute > 59 or second > 59:  # noqa: PLR2004 - a clock
        raise ValueError(match[0])
    seconds = hour * 3600 + minute * 60 + second
    if match["date"]:
        day, dot, rest = match["date"].partition(".")
        date = "-".join([*reversed(rest.split(".")), day]) if dot else match["date"].replace("/", "-")
        seconds += int(np.datetime64(date, "D").astype(np.int64)) * 86_400
    zone = match["zone"] or ""
    if zone[:1] in {"+", "-"}:
        digits = zone[1:].replace(":", "").ljust(4, "0")
        seconds -= (int(digits[:2]) * 3600 + int(digits[2:]) * 60) * (-1 if zone[0] == "-" else 1)
    return seconds * _SECOND_NS + int((match["fraction"] or "0").ljust(9, "0"))


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
    text = cell.strip().replace(_MINUS, "-")
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
