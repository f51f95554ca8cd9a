"""Golden bags of papers whose plants are no DGUs: the history that the paper learns from, and what it must give."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.writer import BagWriter
from bags.watch.histories import read_histories
from bags.wire.convert import history_of
from bags.wire.records import HistoryRecord
from bags.wire.schema import run_topics
from monitor import input_reconstruction, observers
from monitor.history import History
from monitor.input_reconstruction import InputDesign
from monitor.observers import Design

_DGU = 1  # the plant goes by this number on its topic
_PERIOD_NS = 1_000_000_000  # the papers' time has no unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A plant, its record and the method that learns from it.

    Attributes:
        kind: Design method.
        learn: Learns from the history.
        record: Makes known inputs u (T, m), outputs y (T, p) and states x (T, n) or (T, 0).
    """

    kind: str
    learn: Callable[[History], Design | InputDesign]
    record: Callable[[], tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]


def write_example(example: Example, path: Path) -> Path:
    """Record the history as a bag.

    Raises:
        BagError: The bag cannot be written.
    """
    codec = run_topics((_DGU,), (), _PERIOD_NS).history(_DGU)
    u, y, x = example.record()
    none = np.empty((len(u), 0))
    period_sec = _PERIOD_NS * 1e-9
    with BagWriter(path, [codec.topic], max_chunk_age_sec=None) as writer:
        record = HistoryRecord(
            dgu=_DGU, experiment=0, experiments=1, sampling_period_sec=period_sec, u=u, y=y, x=x, d=none, w=none
        )
        writer.write(codec.topic.name, 0, codec.encode(record))
    return path


def result_of(example: Example, path: Path) -> dict[str, Any]:
    """What the method makes of a recorded history.

    Raises:
        BagError: The bag cannot be read.
    """
    made = example.learn(history_of(read_histories(path, _DGU)))
    dynamics = made.certificate.dynamics
    return {
        "observer": example.kind,
        "accepted": made.accepted,
        "order": None if dynamics is None else int(dynamics.order),
        "spectral_radius": None if dynamics is None else float(dynamics.spectral_radius),
    }


def _reduced_order() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Theory section 4: order 2, poles .55 and .40, whatever the record."""
    A = np.array([[0.5, 0.2, 0.0, 0.1], [0.1, 0.4, 0.3, 0.0], [0.0, 0.2, 0.6, 0.1], [0.2, 0.0, 0.1, 0.3]])
    B = np.array([[1.0], [0.0], [0.5], [0.0]])
    E = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    C = np.array([[1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    generator = np.random.default_rng(7)
    u, d = generator.uniform(-5.0, 5.0, (50, 1)), generator.uniform(-2.0, 2.0, (50, 2))
    rows = [generator.uniform(-1.0, 1.0, 4)]
    for known, unknown in zip(u[:-1], d[:-1], strict=True):
        rows.append(A @ rows[-1] + B @ known + E @ unknown)
    x = np.array(rows)
    return u, x @ C.T, x


def _input_reconstruction() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Theory section 6, the plant with D: the best radius is its largest zero, .6751; no states are recorded."""
    A = np.array([[0.9, 1.4, 0.2], [0.5, 1.5, 1.5], [1.6, 0.6, 0.4]])
    B = np.array([[0.5, 1.0], [0.9, 0.3], [0.4, 0.3]])
    C = np.array([[1.5, 1.0, 1.4], [0.6, 0.3, 0.3]])
    D = np.array([[1.3, 1.8], [0.4, 0.7]])
    # any gain that stabilises A will do: places the poles of A + B K at 0.2, 0.3 and 0.4
    K = _stabilising(A, B)
    generator = np.random.default_rng(7)
    x, inputs, outputs = generator.uniform(-1.5, 1.5, 3), [], []
    for drawn in generator.uniform(-1.5, 1.5, (50, 2)):
        u = drawn + K @ x
        inputs.append(u)
        outputs.append(C @ x + D @ u)
        x = A @ x + B @ u
    return np.array(inputs), np.array(outputs), np.empty((50, 0))


def _stabilising(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.signal import place_poles  # noqa: PLC0415 - heavy, and needed for recording only

    return -np.asarray(place_poles(A, B, [0.2, 0.3, 0.4]).gain_matrix)


EXAMPLES: dict[str, Example] = {
    "paper_reduced_order": Example(
        kind="reduced_order",
        learn=lambda history: observers.design("reduced_order", history, {"allow_blind": True}),
        record=_reduced_order,
    ),
    "paper_input_reconstruction": Example(
        kind="cl_uie",
        learn=lambda history: input_reconstruction.design("cl_uie", history, {"past": 5, "future": 1}),
        record=_input_reconstruction,
    ),
}
"""The examples by name."""
