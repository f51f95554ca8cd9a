"""Is a trajectory compatible with the historical data? T, definition 5, also where the states were not sent.

T (5): [v_i; x_i; v_i+1; x_i+1] lies in the range of the historical [V_p; X_p; V_f; X_f] for every i, v = (u, y).
Without states a window of L samples is compatible when some states make all its pairs so: the windows of v that this
allows are a subspace, and the misfit of a window is its distance from it, in shares of the signals' spread in the
history.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.errors import HistoryError, MonitorError
from monitor.history import data_matrices, sent_outputs
from monitor.kernel import null_space
from monitor.options import STRICT, parse_options
from monitor.output_map import identify_output_map
from monitor.proof import stretches
from monitor.rank import RankBasis, RankOptions, decide_rank
from monitor.scaling import spreads
from monitor.subspace import Method, span

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.behaviour import Behaviour
    from monitor.history import History
    from monitor.scaling import Scaling

KIND = "compatible"
_RANK = 1e-9  # relative: below it a direction is rounding
_SIGMAS = 6.0  # Gaussian noise crosses it in two samples of a billion
_LONGEST = 12  # samples of a window unless more are asked for


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class CompatibilityOptions:
    """What is known beforehand.

    Attributes:
        unknown_inputs: m_d of the history, when it is known.
        noise_std: standard deviation of the noise on the history's x, one number or one a state, when it is known.
        received_std: standard deviation of the noise on the trajectory's y, one number or one an output.
        tolerance: what counts as rounding in the trajectory, relative to its signals.
        window: samples of a window; twice the states, at most 12, unless given.
    """

    unknown_inputs: int | None = Field(default=None, ge=0)
    noise_std: tuple[float, ...] | float | None = None
    received_std: tuple[float, ...] | float = 0.0
    tolerance: float = Field(default=1e-9, gt=0.0, lt=1.0)
    window: int | None = Field(default=None, ge=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compatibility:
    """Whether a trajectory fits its history.

    Attributes:
        fits: whether every window does; None when that cannot be told.
        verdict: one line in words.
        window: L, samples of a window.
        misfit: (T - L + 1,) distance of every window from what the history allows, shares of the spread; NaN where a
            sample is missing.
        allowed: likewise, what rounding and noise allow.
        first: first sample of the first window that does not fit, None when all do.
    """

    fits: bool | None
    verdict: str
    window: int = 0
    misfit: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    allowed: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    first: int | None = None


def compatible(
    history: History,
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    options: Mapping[str, object] | None = None,
    *,
    x: NDArray[np.float64] | None = None,
) -> Compatibility:
    """Decide T (5) for a trajectory.

    Args:
        history: the offline experiments; an output that is all NaN is not sent.
        u: (T, m) known inputs, SI units.
        y: (T, p) outputs as received; NaN where a sample is missing.
        options: see CompatibilityOptions.
        x: (T, n) states, when they are known; pairs of samples are judged then.

    Raises:
        MonitorError: another number of signals or samples than in the history, or an option that does not fit.
    """
    chosen = parse_options(CompatibilityOptions, options or {}, KIND)
    _check_shapes(history, u, y, x)
    for name, count in (("received_std", history.outputs), ("noise_std", history.states)):
        value = getattr(chosen, name)
        if isinstance(value, tuple) and len(value) != count:
            raise MonitorError(f"{KIND}: {name} has {len(value)} entries, expected 1 or {count}")
    try:
        sent, channels = sent_outputs(history)
        scaling = spreads(sent)
        behaviour, exact = _behaviour(sent, scaling, chosen)
        tables = [u / scaling.u, y[:, channels] / scaling.y, *([] if x is None else [x / scaling.x])]
        length = 2 if x is not None else chosen.window or min(max(2 * sent.states, 2), _LONGEST)
        F = _whole(behaviour) if x is not None else _without_states(behaviour, length)
        noise = 0.0 if exact else _learned(sent, scaling, F, length, states=x is not None)
    except HistoryError as error:
        return Compatibility(fits=None, verdict=f"refused: {error}")
    if not len(F):
        return Compatibility(
            fits=None,
            verdict=f"refused: every trajectory of {len(channels)} outputs is compatible: unknown inputs explain all",
        )
    std = np.broadcast_to(np.asarray(chosen.received_std, dtype=np.float64), y.shape[1:])[list(channels)] / scaling.y
    noise += _white(F, np.concatenate([np.zeros(u.shape[1]), std, *([] if x is None else [np.zeros(len(scaling.x))])]))
    windows = _windows(np.hstack(tables), length)
    return _judged(windows, F, length, noise, chosen.tolerance)


def _judged(
    windows: NDArray[np.float64], F: NDArray[np.float64], length: int, noise: float, tolerance: float
) -> Compatibility:
    misfit = np.linalg.norm(windows @ F.T, axis=1)
    allowed = np.maximum(noise, tolerance * np.linalg.norm(windows, axis=1))
    judged = np.isfinite(misfit)
    beyond = np.flatnonzero(judged & ~(misfit <= allowed))
    count, basis = int(np.count_nonzero(judged)), "noise" if noise else "rounding"
    if not count:
        return Compatibility(
            fits=None, verdict=f"refused: no {length} consecutive samples without a gap", window=length
        )
    ratio = misfit[judged] / np.maximum(allowed[judged], np.finfo(float).tiny)
    largest = f"misfit up to {np.max(ratio):.2g} of what {basis} allows"
    if not len(beyond):
        verdict, first = f"fits its history: {largest}, {count} windows of {length} samples", None
    else:
        first = int(beyond[0])
        verdict = f"does not fit its history from sample {first} on: {largest}, {len(beyond)} of {count} windows off"
    return Compatibility(
        fits=first is None, verdict=verdict, window=length, misfit=misfit, allowed=allowed, first=first
    )


def _check_shapes(
    history: History, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64] | None
) -> None:
    tables = {"u": (u, history.inputs), "y": (y, history.outputs)} | ({} if x is None else {"x": (x, history.states)})
    for name, (table, width) in tables.items():
        if table.shape != (len(y), width):
            raise MonitorError(f"{KIND}: {name} has shape {table.shape}, expected {(len(y), width)} as in the history")


def _behaviour(history: History, scaling: Scaling, options: CompatibilityOptions) -> tuple[Behaviour, bool]:
    """What the history spans, in shares of the spread, and whether it holds rounding only."""
    data = data_matrices(scaling.scaled(history))
    output = identify_output_map(data)
    std = None if options.noise_std is None else tuple(scaling.noise(options.noise_std).tolist())
    rank = RankOptions(unknown_inputs=options.unknown_inputs, noise_std=std)
    decision = decide_rank(data, rank, output.rest(data), output.rest_sizes(data))
    if decision.unknown_inputs is None:
        raise HistoryError(decision.reason)
    exact = decision.basis is RankBasis.EXACT
    method = Method.REGRESSION if exact else Method.STRUCTURED
    weights = np.ones(history.states) if std is None else min(std) / np.array(std)
    return span(data, decision.unknown_inputs, method, weights, output=output), exact


def _parity(behaviour: Behaviour) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Rows N of N_v [v_i; v_i+1] + N_x x_i + N_f x_i+1 = 0 on all trajectories: N_v, N_x, N_f."""
    m, p, n = len(behaviour.L_u), len(behaviour.C), len(behaviour.L_x)
    before = np.vstack([behaviour.L_u, behaviour.L_y])
    after = np.vstack([behaviour.L_uf, behaviour.L_yf])
    N = null_space(np.vstack([before, after, behaviour.L_x, behaviour.L_xf]).T, rcond=_RANK).T
    N_v, N_x, N_f = np.split(N, [2 * (m + p), 2 * (m + p) + n], axis=1)
    return N_v, N_x, N_f


def _whole(behaviour: Behaviour) -> NDArray[np.float64]:
    """Orthonormal rows F with F [v_i; x_i; v_i+1; x_i+1] = 0 on all trajectories."""
    N_v, N_x, N_f = _parity(behaviour)
    width = N_v.shape[1] // 2
    return np.hstack([N_v[:, :width], N_x, N_v[:, width:], N_f])


def _without_states(behaviour: Behaviour, length: int) -> NDArray[np.float64]:
    """Orthonormal rows F with F [v_0; …; v_L-1] = 0 exactly when some states make all pairs compatible."""
    N_v, N_x, N_f = _parity(behaviour)
    k, n, width = len(N_v), N_x.shape[1], N_v.shape[1] // 2
    on_states, on_samples = np.zeros(((length - 1) * k, length * n)), np.zeros(((length - 1) * k, length * width))
    for i in range(length - 1):
        rows = slice(i * k, (i + 1) * k)
        on_states[rows, i * n : (i + 2) * n] = np.hstack([N_x, N_f])
        on_samples[rows, i * width : (i + 2) * width] = N_v
    F = null_space(on_states.T, rcond=_RANK).T @ on_samples
    if not F.size:
        return np.zeros((0, length * width))
    _, values, right = np.linalg.svd(F, full_matrices=False)
    return np.asarray(right[values > _RANK * max(float(values[0]), 1.0)])


def _white(F: NDArray[np.float64], std: NDArray[np.float64]) -> float:
    """Misfit that white noise of these deviations on the samples causes: its mean square, and six deviations more."""
    moved = F * np.tile(std, F.shape[1] // len(std))
    return float(np.linalg.norm(moved) + _SIGMAS * np.linalg.norm(moved, 2))


def _windows(samples: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """(windows, L (m + p)), the samples of each one after the other."""
    count = max(len(samples) - length + 1, 0)
    return np.hstack([samples[shift : shift + count] for shift in range(length)])


def _learned(history: History, scaling: Scaling, F: NDArray[np.float64], length: int, *, states: bool) -> float:
    """Six times the root mean square of the misfits of the history itself, with the directions that the fit used up."""
    found = []
    for one in stretches(scaling.scaled(history)):
        tables = [one.u, one.y, *([one.x] if states else [])]
        found.append(np.linalg.norm(_windows(np.hstack(tables), length) @ F.T, axis=1))
    misfits = np.concatenate(found) if found else np.empty(0)
    if len(misfits) < length:
        raise HistoryError(f"{len(misfits)} windows of {length} samples in the history, expected at least {length}")
    return _SIGMAS * float(np.sqrt(np.mean(misfits**2)))
