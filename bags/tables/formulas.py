"""Texts that a spreadsheet would take for formulas."""

from typing import Any, Final

from bags.tables.tabular import library

_STARTS: Final = r"^[=+\-@\t\r]"
_NUMBER: Final = r"^[+-]?[0-9.]+([eE][+-]?[0-9]+)?$"


def harmless(table: Any) -> tuple[Any, int]:  # noqa: ANN401 - pyarrow ships no types
    """A table in which no text begins like a formula, numbers left alone, and how many texts had to be changed."""
    arrow, compute = library("pyarrow"), library("pyarrow.compute")
    changed = 0
    for position, name in enumerate(table.column_names):
        column = table[name]
        if not arrow.types.is_string(column.type):
            continue
        odd = compute.and_not(
            compute.match_substring_regex(column, _STARTS), compute.match_substring_regex(column, _NUMBER)
        )
        count = compute.sum(odd).as_py() or 0
        if count:
            quoted = compute.binary_join_element_wise("'", column, "")
            table = table.set_column(position, name, compute.if_else(odd, quoted, column))
            changed += count
    return table, changed
