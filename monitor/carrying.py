"""What runs as a document, and back: every float as it is, so that a carried design has the bits of the designed one.

A design ends in LAPACK, whose last bits differ between processors. What steps afterwards is multiply-adds in a fixed
order: whoever takes the matrices from a document repeats a run bit for bit wherever it is.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from monitor.constant_input import ConstantInput
from monitor.linear_observer import LinearObserver

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.observer import Observer

SYMBOLS = ("A", "B", "M", "D", "H", "J", "Z")
RUNNING = "running"


def running_document(observer: Observer | None) -> dict[str, object]:
    """What an observer is made of, for JSON; {} for one that is not linear, or none."""
    inner = observer.inner if isinstance(observer, ConstantInput) else observer
    if not isinstance(inner, LinearObserver):
        return {}
    matrices = {symbol: matrix.tolist() for symbol, matrix in inner.matrices().items()}
    return {"constant_input": inner is not observer, "lag": inner.lag, "matrices": matrices}


def running_observer(document: Mapping[str, object]) -> LinearObserver | ConstantInput | None:
    """The observer that a document was made of; None where it does not say."""
    matrices, lag = document.get("matrices"), document.get("lag", 0)
    if not isinstance(matrices, dict) or not set(SYMBOLS) <= set(matrices) or not isinstance(lag, int):
        return None
    p, q, width = len(matrices["J"]), len(matrices["A"]), len(matrices["J"][0])
    n = len(matrices["M"])
    shapes = {"A": (q, q), "B": (q, width), "M": (n, q), "D": (n, width), "H": (p, q), "J": (p, width), "Z": (q, width)}
    arrays = {symbol: matrix_of(matrices[symbol], shape) for symbol, shape in shapes.items()}
    found = LinearObserver(**arrays, inputs=width - p, outputs=p, lag=lag)
    return ConstantInput(found) if document.get("constant_input") else found


def matrix_of(rows: object, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The array of nested lists; one without entries keeps its shape."""
    return np.asarray(rows, dtype=np.float64).reshape(shape)


def parsed(document: str) -> dict[str, object]:
    """The document as a mapping; {} for one that is not ours."""
    try:
        found = json.loads(document)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
