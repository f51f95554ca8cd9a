"""Units of foreign numbers, with their value in SI units."""

import re
from typing import Final

from bags.mcap.errors import BagError

_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
_BASES = ("V s", "V*s", "Vs", "Wb", "V", "A", "s", "W", "Ohm", "1")
_UNIT = re.compile(f"({'|'.join(_PREFIXES)})({'|'.join(re.escape(base) for base in _BASES)})")


# of clocks, beside s and its prefixes
LONG_TIMES: Final = {
    "minutes": 60.0,
    "minute": 60.0,
    "min": 60.0,
    "hours": 3600.0,
    "hour": 3600.0,
    "h": 3600.0,
    "days": 86400.0,
}
SHORT_TIMES: Final = {
    "seconds": "s",
    "second": "s",
    "sec": "s",
    "milliseconds": "ms",
    "msec": "ms",
    "microseconds": "us",
    "nanoseconds": "ns",
}
_IN_NAME = re.compile(r".*?[\[(]([^\[\]()]+)[\])]\s*")


def unit_in_name(name: str) -> str:
    """The unit behind a column's name, as in `V [mV]` or `t (min)`; "" unless it is one that is known."""
    match = _IN_NAME.fullmatch(name)
    word = match[1].strip() if match else ""
    known = word != "1" and (_UNIT.fullmatch(word) or word.lower() in LONG_TIMES or word.lower() in SHORT_TIMES)
    return word if known else ""


def factor_of(unit: str) -> float:
    """SI value of one unit, as in 0.001 for `mA`.

    Raises:
        BagError: The unit is unknown.
    """
    match = _UNIT.fullmatch(unit.strip())
    if match is None:
        raise BagError(f"unit {unit!r}: expected one of V, A, V s, s, W, Ohm, with n, u, m, k or M before it, or 1")
    return _PREFIXES[match[1]]


def stated_factor(unit: str) -> float:
    """SI value of one unit as a file states it; 1 for what is unknown or unstated."""
    try:
        return factor_of(unit) if unit else 1.0
    except BagError:
        return 1.0


def unit_note(name: str, unit: str) -> str:
    """What a person should know about a unit that a file states, "" when it changes nothing."""
    if not unit or unit == "1":
        return ""
    try:
        factor = factor_of(unit)
    except BagError:
        return f"{name}: the unit {unit!r} of the file is unknown, its numbers were taken as they are"
    return f"{name}: in {unit}, as the file says" if factor != 1.0 else ""
