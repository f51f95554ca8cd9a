"""How a table is written as text, found out from its beginning."""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from bags.foreign.cells import is_missing, is_number, is_time
from bags.mcap.errors import BagError

BLANK: Final = " "  # any number of them, tabs included
_SEPARATORS = (",", ";", "\t", "|")
_HEAD_LINES = 50
_COMMENT = ("#", "%")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How a table is written.

    Attributes:
        separator: Between cells; BLANK: any number of blanks.
        decimal: "." or ",".
        encoding: Of the text.
        skipped: Lines before the first row of values: comments, names, units.
        names: Of the columns, without white space around them.
        units: Of the columns, "" where nothing says it.
    """

    separator: str
    decimal: str
    encoding: str
    skipped: int
    names: tuple[str, ...]
    units: tuple[str, ...]


def dialect_of(raw: bytes, *, whole: bool) -> tuple[Dialect, list[list[str]]]:
    """How a table is written, and its first rows of values.

    Args:
        raw: How it begins.
        whole: Whether that is all.

    Raises:
        BagError: There are no rows, or no names.
    """
    encoding = _encoding(raw)
    text = raw.decode(encoding, "replace").lstrip("\ufeff")
    if "\0" in text:
        raise BagError("holds bytes that are no text, expected a table with names in the first row")
    lines = text.splitlines()[: None if whole else -1]
    skipped, separator = 0, ""
    if lines and (stated := re.fullmatch(r"sep=(.)", lines[0].strip())):
        separator, skipped = stated[1], 1
    while skipped < len(lines) and (not lines[skipped].strip() or lines[skipped].lstrip().startswith(_COMMENT)):
        skipped += 1
    body = lines[skipped : skipped + _HEAD_LINES]
    if not body:
        raise BagError("holds no row of names, expected one")
    separator = separator or _separator(body)
    if separator == BLANK and encoding == "utf-16":
        raise BagError("has blanks between its cells, in UTF-16: expected UTF-8, or another separator")
    numbered = list(rows_of(body, separator))
    _check_preamble(numbered, skipped)
    rows = [row for _, row in numbered]
    decimal = "," if _decimal_comma(rows[1:], separator) else "."
    names, values = _names(lines[:skipped], rows, separator, decimal)
    skipped += len(rows) - len(values)
    units = ("",) * len(names)
    if _is_unit_row(values, decimal):
        units = tuple(cell.strip().strip("[]()").strip() for cell in values[0])
        units = (*units, *[""] * (len(names) - len(units)))[: len(names)]
        values, skipped = values[1:], skipped + 1
    found = Dialect(separator=separator, decimal=decimal, encoding=encoding, skipped=skipped, names=names, units=units)
    return found, values


def rows_of(lines: Iterable[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the number of the line in which they end, from 1 on; empty lines are left out."""
    plain = (BLANK.join(line.split()) for line in lines) if separator == BLANK else lines
    reader = csv.reader(plain, delimiter=separator)
    for row in reader:
        if row:
            yield reader.line_num, row


def _check_preamble(rows: Sequence[tuple[int, list[str]]], skipped: int) -> None:
    """Refuse lines about the device or the like above the names.

    Raises:
        BagError: There are some.
    """
    widths = Counter(len(row) for _, row in rows)
    width, often = widths.most_common(1)[0]
    place, names = next((line, row) for line, row in rows if len(row) == width)
    above = rows[0][0] < place and len(rows[0][1]) < width and often > len(rows) / 2
    if above and not any(is_number(cell, ".") or is_number(cell, ",") for cell in names):
        raise BagError(
            f"line {place + skipped} looks like the names of the columns, expected them in the first row: put # before "
            "the lines above it"
        )


def _names(
    comments: Sequence[str], rows: list[list[str]], separator: str, decimal: str
) -> tuple[tuple[str, ...], list[list[str]]]:
    """The names of the columns and the rows below them; names may stand in the last comment, as numpy writes them.

    Raises:
        BagError: There are none.
    """
    names = tuple(name.strip() for name in rows[0])
    if not all(is_number(name, decimal) for name in names):
        return names, rows[1:]
    last = comments[-1].lstrip().lstrip("".join(_COMMENT)).strip() if comments else ""
    told = [tuple(name.strip() for name in row) for _, row in rows_of([last], separator)]
    if told and len(told[0]) == len(names) and not any(is_number(name, decimal) for name in told[0]):
        return told[0], rows
    raise BagError(f"the first row holds numbers ({', '.join(names):.60}), expected the names of the columns")


def _encoding(raw: bytes) -> str:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:
        raw[:-4].decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(raw) - 8:
            return "cp1252"
    return "utf-8"


def _separator(lines: Sequence[str]) -> str:
    """The separator that gives every line the same number of cells, the more the better; blanks where none does."""

    def counts(separator: str) -> list[int]:
        return [len(row) for _, row in rows_of(lines, separator)]

    def score(separator: str) -> tuple[bool, int]:
        found = counts(separator)
        return len(set(found)) == 1 and found[0] > 1, found[0] if found else 0

    best = max(_SEPARATORS, key=score)
    if score(best)[1] > 1:
        return best
    rows = [row for _, row in rows_of(lines, BLANK)]
    alike = [len(row) == len(rows[0]) > 1 for row in rows]
    numbers = [all(is_number(cell, ".") or is_missing(cell) or is_time(cell) for cell in row) for row in rows[1:]]
    return BLANK if sum(alike) > len(rows) / 2 and sum(numbers) > len(numbers) / 2 else best


def _decimal_comma(rows: Sequence[Sequence[str]], separator: str) -> bool:
    """Whether more numbers have a decimal comma than a point."""
    cells = [cell.strip() for row in rows for cell in row]
    commas = [cell for cell in cells if re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell)]
    points = sum(re.fullmatch(r"[-+]?\d*\.\d+([eE][-+]?\d+)?", cell) is not None for cell in cells)
    # beside separating commas, numbers in quotes: 1,234 may as well be a thousand and more
    thousands = separator == "," and all(re.fullmatch(r"[-+]?\d{1,3},\d{3}", cell) for cell in commas)
    return len(commas) > points and not thousands


def _is_unit_row(rows: Sequence[Sequence[str]], decimal: str) -> bool:
    """Whether the first row says in which units the following ones are."""
    if len(rows) < 2:  # noqa: PLR2004 - units, and values to tell them from
        return False
    first = [cell.strip() for cell in rows[0]]
    texts = [cell for cell in first if cell and not is_missing(cell)]
    plain = not any(is_number(cell, decimal) or is_time(cell) for cell in texts)
    below = zip(first, rows[1], strict=False)
    return bool(texts) and plain and any(cell and is_number(under, decimal) for cell, under in below)
