"""What an observer can and cannot see, at the thresholds of one moment: its certificate in words."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from monitor.certificate import smallest_crossing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def view(certificate: str, threshold: NDArray[np.float64], bias: Sequence[float] | None) -> list[str]:
    """Say what the observer sees.

    Args:
        certificate: JSON document of a design.
        threshold: of the moment, (p,); NaN where there is none.
        bias: the constant bias that acts, (p,), None without one.
    """
    try:
        found: Any = json.loads(certificate)
    except ValueError:
        return []
    if not isinstance(found, dict):
        return []
    residual = found.get("residual")
    if not residual:
        return [str(found.get("verdict", ""))]
    if residual["blind"]:
        return ["it is blind: its residual stays zero whatever is falsified"]
    rank, free = residual["residual_rank"], residual["stealthy_inputs"]
    lines = [f"its residual holds {rank} independent signal(s); {free} dimension(s) a step stay free to an attacker"]
    basis = np.array(residual["invisible_bias"], dtype=np.float64)
    if basis.size:
        columns = ", ".join(f"({', '.join(f'{one:.3g}' for one in column)})" for column in basis.T)
        lines.append(f"constant biases along {columns} leave no steady residual")
    else:
        lines.append("every constant bias leaves a steady residual")
    gain = np.array(residual["peak_gain"], dtype=np.float64)
    if gain.shape == (len(threshold), len(threshold)) and np.isfinite(threshold).all():
        least = smallest_crossing(gain, threshold)
        lines.append(
            f"smallest bias on one output alone seen at this threshold: {', '.join(f'{b:.3g}' for b in least)}"
        )
    if bias is not None and basis.size and len(bias) == len(basis) and np.any(bias):
        vector = np.asarray(bias, dtype=np.float64)
        share = float(np.linalg.norm(basis.T @ vector) / np.linalg.norm(vector))
        lines.append(f"of the bias that acts, {share:.0%} lies along those directions")
    return lines
