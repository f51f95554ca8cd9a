"""The figure that a design states about itself: what it was off by on samples that it had not seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from monitor.certificate import Certificate


def stated_error(certificate: Certificate) -> float | None:
    """Largest error or residual on unseen samples, in shares of the signals' spread; None where none is stated.

    A doubt that the verdict calls borderline is stated, too.
    """
    proof = certificate.proof
    if proof is None:
        return None
    return max(proof.worst_error or 0.0, proof.worst_residual or 0.0, proof.hardly)


def stated_figure(numbers: Mapping[str, object]) -> float | None:
    """The same of an input estimator, from what it knows about itself."""
    proof = numbers.get("proof")
    worst = [proof.get(name) for name in ("worst_error", "worst_residual", "hardly")] if isinstance(proof, dict) else []
    found = [one for one in worst if isinstance(one, float)]
    return max(found) if found else None
