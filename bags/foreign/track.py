"""The wanted numbers of one topic, or of a table, as they stand there."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bags.foreign.spill import Rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Numbers with their instants: raw, unordered, ungridded.

    Attributes:
        name: Topic, or name of the table's file.
        fields: As the mapping names them, one a column.
        stamps_ns: Instants in the order of the file, shape (messages,).
        values: Shape (messages, fields); NaN where a value is missing.
        units: Unit of each field as the file states it, "" where it does not.
    """

    name: str
    fields: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    values: Rows = field(repr=False)
    units: tuple[str, ...] = ()

    def unit_of(self, name: str) -> str:
        """Unit of a field, "" where the file does not state it."""
        return self.units[self.fields.index(name)] if self.units else ""
