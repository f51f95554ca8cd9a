"""What monitors that draw one conclusion from several tests said over some steps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.watch.monitors import MonitorArrays
from bags.wire.arrays import group, room
from bags.wire.forms import MASKS
from bags.wire.schema import RunTopics
from monitor.combined import DguOutput


@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictArrays:
    """Which links lie; shape (steps, links) where not said otherwise. The fields are those of Verdict.msg."""

    accused: NDArray[np.bool_]
    by_residual: NDArray[np.bool_]
    by_plausibility: NDArray[np.bool_]
    by_stream: NDArray[np.bool_]
    by_local: NDArray[np.bool_]
    suspected: NDArray[np.bool_]
    dropped: NDArray[np.bool_]
    local: NDArray[np.bool_]
    """Shape (steps, monitors)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InputArrays:
    """Reconstructed inputs, shape (steps, links) and (steps, links, 2); the fields are those of InputEstimate.msg."""

    lag: NDArray[np.uint32]
    phase: NDArray[np.uint8]
    alarm: NDArray[np.bool_]
    input: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    rate: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedArrays:
    """Everything besides the residuals of the links.

    Attributes:
        verdict: Which links lie.
        local: What the local modules concluded, shape (steps, monitors, ...), None without them.
        inputs: Reconstructed inputs, None without plausibility tests.
    """

    verdict: VerdictArrays
    local: MonitorArrays | None
    inputs: InputArrays | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedFields:
    """The fields of the messages of some steps on their way between messages and arrays: masks are numbers here.

    Attributes:
        verdict: Shape (steps, monitors).
        local: Shape (steps, monitors, ...).
        inputs: Shape (steps, links, ...).
    """

    verdict: Mapping[str, NDArray[Any]]
    local: Mapping[str, NDArray[Any]]
    inputs: Mapping[str, NDArray[Any]]

    @classmethod
    def empty(cls, topics: RunTopics, steps: int) -> "CombinedFields":
        """Room for the messages of some steps."""
        arrays = room(topics, steps)
        verdict, local, inputs = (group(arrays, key) for key in ("verdict", "own_residual", "input"))
        return cls(verdict=verdict, local=local, inputs=inputs)

    def arrays(self, topics: RunTopics) -> CombinedArrays:
        """The arrays, masks opened up."""
        flags = {name: _flags(self.verdict[name], topics) for name in MASKS}
        return CombinedArrays(
            verdict=VerdictArrays(**flags, local=self.verdict["local"]),
            local=MonitorArrays(**self.local) if self.local else None,
            inputs=InputArrays(**self.inputs) if self.inputs else None,
        )


def fields_of(rows: Sequence[Sequence[DguOutput]], lags: Sequence[int], topics: RunTopics) -> CombinedFields:
    """Put what all monitors said at some steps into message fields.

    Args:
        rows: One output for each monitor at each step.
        lags: Of the input estimator on each link.
        topics: The topics.
    """
    fields = CombinedFields.empty(topics, len(rows))
    if not rows:
        return fields
    for name in MASKS[:-1]:
        flags = [[getattr(one.verdict.isolation, name) for one in row] for row in rows]
        fields.verdict[name][:] = _masks(flags)
    fields.verdict["dropped"][:] = _masks([[one.verdict.dropped for one in row] for row in rows])
    fields.verdict["local"][:] = [[one.verdict.isolation.local for one in row] for row in rows]
    for name, array in fields.local.items():
        array[:] = [[getattr(one.local.monitor, name) for one in row if one.local is not None] for row in rows]
    for name, array in fields.inputs.items():
        if name == "lag":
            array[:] = lags
        else:
            array[:] = [[getattr(said, name) for one in row for said in one.inputs] for row in rows]
    return fields


def _masks(flags: list[list[Any]]) -> list[list[int]]:
    return [[sum(1 << bit for bit, flag in enumerate(one) if flag) for one in row] for row in flags]


def _flags(masks: NDArray[np.uint64], topics: RunTopics) -> NDArray[np.bool_]:
    """Masks (steps, monitors) as flags (steps, links)."""
    columns = [
        (masks[:, position] >> np.uint64(bit)) & np.uint64(1) > 0
        for position, monitor in enumerate(topics.monitors)
        for bit in range(len(topics.sources(monitor)))
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((len(masks), 0), dtype=np.bool_)
