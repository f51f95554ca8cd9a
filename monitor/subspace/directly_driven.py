"""Unknown inputs that act on the outputs as well as on the states: x+ = A x + B u + E d, y = C x + D u + G d."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from monitor.behaviour import Behaviour
from monitor.rank import project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices
    from monitor.output_map import OutputMap


def directly_driven(data: DataMatrices, unknown_inputs: int, output: OutputMap, tolerance: float) -> Behaviour:
    """Regress [X_f; Y_p] on [X_p; U_p]: what is left is [E; G] d, one d for both, and d at t + 1 is free.

    A, B, C, D of one regression belong together: each holds its part of d that follows (x, u) in this history, which is
    no loss, for d is free.
    """
    m, n, p = len(data.U_p), len(data.X_p), len(data.Y_p)
    driven = output.driven
    known = np.vstack([data.X_p, data.U_p])
    target = np.vstack([data.X_f, data.Y_p[driven]])
    spread = _moved(data.Y_p)[:, None]
    sizes = np.vstack([_moved(np.hstack([data.X_p, data.X_f]))[:, None], spread[driven]])
    rest = sizes * project(known, target / sizes, 0.0).rest
    gains = _solved(known, target - rest)
    directions = sizes * np.linalg.svd(rest / sizes, full_matrices=False)[0][:, :unknown_inputs]
    CD, G = np.hstack([output.C, output.D]), np.zeros((p, unknown_inputs))
    CD[driven], G[driven] = gains[n:], directions[n:]
    left, values, _ = np.linalg.svd(G / spread, full_matrices=False)
    at_end = spread * left[:, values > tolerance]  # columns of [E; G] have length 1: what is shorter is rounding
    widths = np.cumsum([n, m, unknown_inputs, m, at_end.shape[1]])
    x, u, d, u_f, d_f = np.split(np.eye(widths[-1]), widths[:-1])
    free = Behaviour(
        L_u=u,
        L_x=x,
        L_uf=u_f,
        L_xf=gains[:n] @ np.vstack([x, u]) + directions[:n] @ d,
        C=CD[:, :n],
        D=CD[:, n:],
        unknown_inputs=unknown_inputs,
        L_g=G @ d,
        L_gf=at_end @ d_f,
    )
    return free.in_units(np.ones(m), np.ones(p), np.ones(n))


def _moved(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) standard deviations, 1 for a row that never moves."""
    spread = np.std(rows, axis=1)
    return np.where(spread > 0.0, spread, 1.0)


def _solved(known: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of target on known, rows scaled to their spread."""
    sizes = np.maximum(np.max(np.abs(known), axis=1), np.finfo(float).tiny)
    return np.asarray(np.linalg.lstsq((known / sizes[:, None]).T, target.T, rcond=None)[0].T / sizes)
