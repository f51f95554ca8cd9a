"""Input reconstruction from outputs alone, UIE (I): op-UIE and cl-UIE designed from a record of inputs and outputs."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass
from scipy.linalg import null_space

from monitor.certificate import Certificate
from monitor.errors import HistoryError, MonitorError
from monitor.input_reconstruction.poles import Solutions, place
from monitor.input_reconstruction.realisation import Gains, realise
from monitor.input_reconstruction.report import InputDesign, InputReport
from monitor.input_reconstruction.sizes import Sizes, fit_windows, larger_future
from monitor.input_reconstruction.uncertainty import noise_gain
from monitor.input_reconstruction.zeros import invariant_zeros, invisible, visibility
from monitor.options import parse_options
from monitor.riccati import filter_gain
from monitor.sight import measure_dynamics, measure_residual
from monitor.wording import sees

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.history import History
    from monitor.input_reconstruction.behaviour import Behaviour
    from monitor.input_reconstruction.windows import Windows

OPEN_LOOP = "op_uie"
CLOSED_LOOP = "cl_uie"
_SCHUR = 1.0 - 1e-9
_CIRCLE = 1e-6  # zeros this close to the unit circle are borderline


class Poles(Enum):
    """How op-UIE picks one of all solutions."""

    MINIMUM_NORM = "minimum_norm"
    LMI = "lmi"


class Fit(Enum):
    """How noise in the record is met."""

    TRUNCATED = "truncated"
    LEAST_SQUARES = "least_squares"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class InputOptions:
    """Options of both estimators.

    Attributes:
        past: N_ini; longer than the lag of the plant, by default 5 or what the lag asks for.
        future: output samples used from t on; the estimate lags the newest output by future - 1; by default as few as
            condition (8) asks for.
        order: order of the plant, if it is known; needed for noisy records without a clear gap.
        fit: `truncated` keeps the trajectories above the noise (total least squares; falls back to the other without a
            gap); `least_squares` is the paper's plain pseudo-inverse of noisy data, which shows neither (8) nor zeros.
        relative_tolerance: what counts as rounding in exact data.
        poles: op-UIE only.
        output_weight: cl-UIE only: R = output_weight I in the dual LQR with Q = I; larger trusts the outputs less.
        threshold: the residual threshold that the certificate's smallest bias refers to.
    """

    past: int | None = Field(default=None, ge=2)
    future: int | None = Field(default=None, ge=1)
    order: int | None = Field(default=None, ge=1)
    relative_tolerance: float = Field(default=1e-10, gt=0.0, lt=1.0)
    fit: Fit = Fit.TRUNCATED
    poles: Poles = Poles.MINIMUM_NORM
    output_weight: float = Field(default=1.0, gt=0.0)
    threshold: float = Field(default=1e-3, gt=0.0)


def design(kind: str, history: History, options: Mapping[str, object]) -> InputDesign:
    """Design an estimator of unknown inputs from a record in which they are known; a refusal is a value.

    Args:
        kind: `op_uie` or `cl_uie`.
        history: u holds the inputs that will be unknown online; x may have no column.
        options: see InputOptions.

    Raises:
        MonitorError: unknown kind or option.
    """
    if kind not in {OPEN_LOOP, CLOSED_LOOP}:
        raise MonitorError(f"input reconstruction is {kind!r}, expected one of {CLOSED_LOOP}, {OPEN_LOOP}")
    chosen = parse_options(InputOptions, options, kind)
    sizes = Sizes(
        past=chosen.past,
        future=chosen.future,
        order=chosen.order,
        tolerance=chosen.relative_tolerance,
        truncated=chosen.fit is Fit.TRUNCATED,
    )
    try:
        windows, behaviour = fit_windows(history, sizes)
    except HistoryError as error:
        return _refused(kind, InputReport(past=chosen.past or 0, delay=0, columns=0, dropped=0), str(error))
    report = _report(windows, behaviour)
    if invisible(behaviour):
        return _refused(kind, report, _unseen(report, behaviour, larger_future(history, sizes, windows)))
    if report.zeros is not None and (reason := _unstable(report.zeros, behaviour)):
        return _refused(kind, report, reason)
    return _design(kind, windows, behaviour, chosen, report, history.sampling_period_sec)


def _design(
    kind: str,
    windows: Windows,
    behaviour: Behaviour,
    options: InputOptions,
    report: InputReport,
    sampling_period_sec: float,
) -> InputDesign:
    """Solve for the gains once condition (8) and the zeros are checked."""
    W0 = behaviour.u_now @ np.linalg.pinv(behaviour.H, rcond=options.relative_tolerance)
    zeros = None if report.zeros is None else float(np.max(np.abs(report.zeros), initial=0.0))
    if kind == OPEN_LOOP:
        chosen = _open_loop(W0, behaviour, windows, options, zeros)
        if chosen is None:
            return _refused(kind, report, "the LMI of I, (16) finds no stable op-UIE: use cl_uie")
        gains = _gains(chosen, behaviour, windows)
    else:
        gains, failure = _closed_loop(_gains(W0, behaviour, windows), options.output_weight)
        if failure:
            return _refused(kind, report, failure)
    u_now = np.linalg.norm(windows.u_now)
    misfit = windows.u_now - np.hstack([gains.U1, gains.Y1]) @ windows.H
    report = replace(report, fit=float(np.linalg.norm(misfit) / u_now))
    return _finish(kind, gains, report, options, sampling_period_sec)


def _report(windows: Windows, behaviour: Behaviour) -> InputReport:
    report = InputReport(
        past=windows.past,
        delay=windows.future - 1,
        columns=windows.columns,
        dropped=windows.dropped,
        order=behaviour.order,
        rank=behaviour.rank if behaviour.decided else None,
        rank_basis=behaviour.basis.value,
        noise=behaviour.noise,
    )
    if not behaviour.decided:
        return report
    report = replace(report, visibility=visibility(behaviour))
    if invisible(behaviour):
        return report
    return replace(report, zeros=invariant_zeros(behaviour, windows.past))


def _unseen(report: InputReport, behaviour: Behaviour, future: int | None) -> str:
    """Condition (8) fails, as far as the record tells, and what would mend it."""
    shown = f"visibility {report.visibility:.1g}"
    if behaviour.noise:
        return (
            f"condition (8) of I cannot be told from noise: the input at t shows as {report.visibility:.1g} in the "
            f"outputs up to t + {report.delay}, noise as {behaviour.noise:.1g}; record longer, or try least_squares"
        )
    mend = "no larger future shows it: more outputs are needed" if future is None else f"future {future} shows it"
    return (
        "condition (8) of I fails, U_f ker H is not 0: the input at t does not show in the outputs up to "
        f"t + {report.delay} ({shown}); {mend}"
    )


def _unstable(zeros: NDArray[np.complex128], behaviour: Behaviour) -> str | None:
    """Why no stable estimator exists; None when all zeros lie in the unit circle."""
    unstable = zeros[np.abs(zeros) >= _SCHUR]
    if not len(unstable):
        return None
    listed = ", ".join(f"{zero:.4g}" if zero.imag else f"{zero.real:.4g}" for zero in unstable)
    noisy = " (noise moves them: try least_squares)" if behaviour.noise else ""
    edge = "borderline: " if np.all(np.abs(unstable) < 1.0 + _CIRCLE) else ""
    return f"{edge}no stable estimator exists: the record shows the zeros {listed}, expected modulus < 1{noisy}"


def _open_loop(
    W0: NDArray[np.float64], behaviour: Behaviour, windows: Windows, options: InputOptions, zeros: float | None
) -> NDArray[np.float64] | None:
    """The solution [U1 Y1] that the options ask for."""
    if options.poles is Poles.MINIMUM_NORM:
        return W0
    left_null: NDArray[np.float64] = null_space(behaviour.H.T, rcond=options.relative_tolerance)
    return place(Solutions(W0=W0, N=left_null.T, past_inputs=windows.past * windows.inputs), zeros or 0.0)


def _gains(W: NDArray[np.float64], behaviour: Behaviour, windows: Windows) -> Gains:
    """Add the prediction of y_t-1 from z and the outputs before it: [U2 Y2] = Y_row [U_p; Y_past]^+."""
    inputs, p = windows.past * windows.inputs, windows.outputs
    prediction = behaviour.H_past[-p:] @ np.linalg.pinv(behaviour.H_past[:-p], rcond=1e-10)
    U1, Y1 = np.split(W, [inputs], axis=1)
    U2, Y2 = np.split(prediction, [inputs], axis=1)
    L = np.zeros((inputs, p))
    return Gains(U1=U1, Y1=Y1, U2=U2, Y2=Y2, L=L, past=windows.past, future=windows.future)


def _closed_loop(gains: Gains, output_weight: float) -> tuple[Gains, str]:
    """Dual LQR on (A_op, U2): L = A_op P U2' (R + U2 P U2')^-1, Q = I, R = output_weight I."""
    n, p = len(gains.A_op), len(gains.U2)
    L = filter_gain(gains.A_op, gains.U2, np.eye(n, n + p), np.sqrt(output_weight) * np.eye(p, n + p, k=n))
    if L is None:
        return gains, "no stabilising gain of cl-UIE is found: record with less noise or give the order"
    return replace(gains, L=L), ""


def _finish(
    kind: str, gains: Gains, report: InputReport, options: InputOptions, sampling_period_sec: float
) -> InputDesign:
    """Measure the running form; refuse it when it is not stable."""
    observer = realise(gains)
    strategy = options.poles.value if kind == OPEN_LOOP else "dual_lqr"
    dynamics = measure_dynamics(gains.A_z, strategy, report.fit or 0.0, sampling_period_sec)
    radius = dynamics.spectral_radius
    if radius >= _SCHUR:
        return _refused(
            kind,
            report,
            f"{strategy} is not stable: spectral radius {radius:.4g}, expected < 1; try poles lmi or cl_uie",
        )
    report = replace(report, noise_gain=noise_gain(observer))
    matrices = {name: getattr(gains, name) for name in ("U1", "Y1", "U2", "Y2", "L", "A_op")}
    verdict = (
        f"accepted: reconstructs {len(gains.U1)} inputs {report.delay} steps late; errors shrink to 1 % in "
        f"{dynamics.convergence_steps} steps (radius {radius:.3g}); rank {report.rank_basis}"
    )
    residual = measure_residual(observer, np.full(observer.outputs, options.threshold))
    certificate = Certificate(
        kind=kind,
        accepted=True,
        verdict=f"{verdict}; residual: {sees(residual)}",
        lag=observer.lag,
        method=report,
        dynamics=dynamics,
        residual=residual,
        matrices=matrices,
    )
    return InputDesign(kind=kind, observer=observer, certificate=certificate, report=report)


def _refused(kind: str, report: InputReport, reason: str) -> InputDesign:
    certificate = Certificate(kind=kind, accepted=False, verdict=f"refused: {reason}", method=report)
    return InputDesign(kind=kind, observer=None, certificate=certificate, report=report)
