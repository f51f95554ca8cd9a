"""Tables of a scenario in CSV files of their own: whatever columns they have, one of them times."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dgu_sim.errors import DguSimError
from dgu_sim.explain import shown

__all__ = ["ATTACK_COLUMNS", "LOAD_COLUMNS", "TableFileError", "embed_table"]

LOAD_COLUMNS = ("time_sec", "current_a")
ATTACK_COLUMNS = ("time_sec", "voltage_v", "current_a", "integral_vs")
_TIME = "time_sec"
_DELIMITERS = ",;\t"


class TableFileError(DguSimError):
    """A table file that cannot be read, or lacks a column."""


def embed_table(
    entry: dict[str, Any], known: Sequence[str], directory: Path | None, needed: str | None = _TIME
) -> None:
    """Replace `file` (and `columns`) of an entry by the values, in place: what is resolved needs no other file.

    The delimiter is the one of the header: comma, semicolon or tabulator; numbers beside the latter two may have a
    decimal comma. Lines that are empty or begin with # do not count, nor does a byte-order mark, nor any other column.

    Args:
        entry: a load or the parameters of an attack; without `file` nothing is done.
        known: columns that are looked for; the needed one and another must be there.
        directory: where the file is; None: the entry must not name any.
        needed: column that must be there; None: any will do.

    Raises:
        TableFileError: the file cannot be read, or is no such table.
    """
    if "file" not in entry:
        return
    file, columns = entry.pop("file"), entry.pop("columns", {})
    try:
        found = _columns(file, columns, known, directory, needed)
    except TableFileError as error:
        raise TableFileError(f"file = {shown(file)}: {error}") from error
    for key, values in found.items():
        if key in entry:
            raise TableFileError(f"file = {shown(file)}: expected either a file or {key}, found both")
        entry[key] = values


def _columns(
    file: object, columns: object, known: Sequence[str], directory: Path | None, needed: str | None
) -> dict[str, list[float]]:
    """What the file says of each known column that it has."""
    names = _names(columns, known)
    header, lines = _lines(file, directory)
    wanted = {key: names.get(key, key) for key in known if key in names or key in header}
    least = "one" if needed is None else f"{needed} and another"
    if needed not in (None, *wanted) or len(wanted) < (1 if needed is None else 2):
        raise TableFileError(
            f"expected the columns {', '.join(known)} in the header, {least} at least, or `columns: "
            f"{{{known[0]}: NAME, …}}`; found {shown(','.join(header))}"
        )
    return {key: _column(name, header, lines) for key, name in wanted.items()}


def _names(columns: object, known: Sequence[str]) -> Mapping[str, str]:
    """What stands in `columns`: our key -> `name` or `name*factor` in the file."""
    if not isinstance(columns, dict) or not all(isinstance(name, str) for name in columns.values()):
        raise TableFileError(f"columns = {shown(columns)}: expected NAME or NAME*FACTOR for some of {', '.join(known)}")
    for key in columns:
        if key not in known:
            raise TableFileError(f"columns.{key}: expected one of {', '.join(known)}")
    return columns


def _lines(file: object, directory: Path | None) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The header, and each further line with its number and its cells."""
    if directory is None or not isinstance(file, str):
        raise TableFileError("expected the name of a CSV file beside the scenario file")
    beside = directory / file
    try:
        text = (beside if beside.exists() else Path(file)).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise TableFileError(f"expected a readable CSV file in {directory}") from error
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    delimiter = max(_DELIMITERS, key=first.count)
    rows = [
        (number, [cell.strip() for cell in row])
        for number, row in enumerate(csv.reader(text.splitlines(), delimiter=delimiter), start=1)
        if any(cell.strip() for cell in row) and not row[0].startswith("#")
    ]
    if delimiter != ",":
        rows = [(number, [cell.replace(",", ".") for cell in row]) for number, row in rows]
    return (rows[0][1] if rows else []), rows[1:]


def _column(name: str, header: Sequence[str], lines: Sequence[tuple[int, list[str]]]) -> list[float]:
    """The numbers of a column, times its factor."""
    field, star, factor = name.rpartition("*")
    field = field.strip() if star and name not in header else name
    if field not in header:
        raise TableFileError(f"expected a column {field}, found {shown(','.join(header))}")
    if header.count(field) > 1:
        raise TableFileError(f"expected one column {field}, found {header.count(field)}")
    at, values = header.index(field), []
    try:
        scale = float(factor) if field != name else 1.0
    except ValueError:
        raise TableFileError(f"columns: {name}: expected a number behind the *") from None
    for number, row in lines:
        cell = row[at] if at < len(row) else ""
        try:
            values.append(scale * float(cell))
        except ValueError:
            raise TableFileError(f"line {number}: {field}: expected a number, found {shown(cell)}") from None
    return values
