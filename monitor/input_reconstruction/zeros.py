"""Whether an input estimator exists, told from the record alone: the inputs that leave no trace in the outputs.

On a trajectory with y = 0 over the whole window the past inputs follow u_t = U1 u_past whatever the design. The shift
from (u_t-past, …, u_t-1) to (u_t-past+1, …, u_t) on the space of those inputs is a linear map; its eigenvalues are the
invariant zeros of the plant [R]. No choice of U1, Y1 or L moves them: an estimator exists iff they lie in the unit
circle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.input_reconstruction.behaviour import Behaviour

_EXACT = 1e-9  # an orthonormal trajectory whose outputs are smaller carries rounding only


def invisible_below(behaviour: Behaviour) -> float:
    """Size below which a part of an orthonormal trajectory is taken for zero: rounding, or what noise tilts it by."""
    return max(_EXACT, behaviour.noise)


def visibility(behaviour: Behaviour) -> float:
    """Smallest singular value of H on the orthonormal trajectories; condition (8) of I fails at 0."""
    if not behaviour.decided:
        return 0.0
    values = np.linalg.svd(behaviour.H, compute_uv=False)
    return float(values[-1]) if len(values) == behaviour.rank else 0.0


def invisible(behaviour: Behaviour) -> bool:
    """Whether condition (8) fails as far as the record tells; not known without a decided rank."""
    return behaviour.decided and visibility(behaviour) <= invisible_below(behaviour)


def invariant_zeros(behaviour: Behaviour, past: int) -> NDArray[np.complex128]:
    """Invariant zeros shown by trajectories with zero output; needs a decided rank and condition (8)."""
    m = len(behaviour.u_now)
    U_past, Y = np.split(behaviour.H, [past * m])
    _, values, directions = np.linalg.svd(Y)
    seen = int(np.count_nonzero(values > invisible_below(behaviour)))
    silent = directions[seen:].T
    before = U_past @ silent
    after = np.vstack([U_past[m:], behaviour.u_now]) @ silent
    left, sizes, right = np.linalg.svd(before, full_matrices=False)
    kept = sizes > invisible_below(behaviour)
    shift = (left[:, kept].T @ after) @ (right[kept].T / sizes[kept])
    return np.linalg.eigvals(shift).astype(np.complex128)
