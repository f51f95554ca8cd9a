"""What every estimator of the unknown inputs and every design of one is, whatever the method."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from monitor.linear import Component, Vector
    from monitor.proof import Proof


class InputEstimator(Protocol):
    """A running estimator: holds parameters only; its state is a vector of components in which NaN spreads.

    A sample that is all NaN makes the whole state NaN; whoever steps it starts it again with `init` from the next one.
    """

    @property
    def inputs(self) -> int:
        """Number m_d of unknown inputs that it reconstructs: the columns of `d` in the history, in their order."""

    @property
    def outputs(self) -> int:
        """Number p of outputs it needs."""

    @property
    def lag(self) -> int:
        """Samples by which the estimate is behind: step t gives the input that acted from t - lag to t - lag + 1."""

    def init(self, y: Sequence[Component]) -> Vector:
        """State before the first sample y is used."""

    def step(self, state: Vector, y: Sequence[Component]) -> tuple[Vector, Vector]:
        """Take the sample of step t: the next state and dhat_(t - lag); right once the start has died out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorDesign:
    """The estimator designed from a history, or the reason why there is none.

    Attributes:
        kind: name of the design method.
        estimator: the running estimator, None when refused.
        verdict: one line in plain words.
        channels: positions in the received vector of the outputs that the estimator was designed on.
        numbers: what the design knows about itself, by name; JSON values.
    """

    kind: str
    estimator: InputEstimator | None
    verdict: str
    channels: tuple[int, ...] = ()
    numbers: Mapping[str, object] = field(default_factory=dict)

    @property
    def accepted(self) -> bool:
        """Whether there is an estimator."""
        return self.estimator is not None

    @property
    def document(self) -> str:
        """What the design knows about itself, and what its estimator is made of, as one JSON document."""
        return json.dumps(
            {"kind": self.kind, "accepted": self.accepted, "verdict": self.verdict, **self.numbers}, allow_nan=False
        )


def figures(proof: Proof) -> dict[str, object]:
    """A proof as JSON values."""
    return {
        "samples": proof.samples,
        "spare_columns": proof.spare_columns,
        "worst_error": proof.worst_error,
        "worst_residual": proof.worst_residual,
        "allowed_error": proof.allowed_error,
        "hardly": proof.hardly,
        "errors": proof.errors.tolist(),
        "basis": proof.basis,
    }
