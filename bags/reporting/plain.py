"""Measures as plain JSON data."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass

import numpy as np

from dgu_sim.grid import Link


def plain(value: object) -> object:
    """Dataclasses as objects, arrays as lists, NaN and infinity, which JSON does not know, as null."""
    match value:
        case bool() | int() | str() | None:
            found: object = value
        case float():
            found = value if math.isfinite(value) else None
        case Link():
            found = str(value)
        case np.ndarray() | np.generic():
            found = plain(value.tolist())
        case Mapping():
            found = {str(key): plain(one) for key, one in value.items()}
        case Sequence():
            found = [plain(one) for one in value]
        case _ if is_dataclass(value):
            found = {one.name: plain(getattr(value, one.name)) for one in fields(value)}
        case _:
            raise TypeError(f"{type(value).__name__} has no place in a JSON document")
    return found
