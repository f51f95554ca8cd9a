"""Input reconstruction from outputs alone, UIE (I): op-UIE and cl-UIE designed from a record of inputs and outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.backstop import guarded
from monitor.certificate import Certificate
from monitor.errors import HistoryError, MonitorError
from monitor.input_reconstruction.proving import Claim, prove_inputs
from monitor.input_reconstruction.realisation import Gains, realise
from monitor.input_reconstruction.report import InputDesign, InputReport
from monitor.input_reconstruction.sizes import Sizes, fit_windows, larger_future, without_zeros
from monitor.input_reconstruction.solving import Poles, corrected, least_norm, placed
from monitor.input_reconstruction.uncertainty import noise_gain
from monitor.input_reconstruction.zeros import invariant_zeros, invisible, visibility
from monitor.options import STRICT, parse_options
from monitor.proof import hold_back
from monitor.scaling import norms, spreads
from monitor.sight import measure_dynamics, measure_residual
from monitor.wording import sees

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.history import History
    from monitor.input_reconstruction.behaviour import Behaviour
    from monitor.input_reconstruction.windows import Windows
    from monitor.scaling import Scaling

OPEN_LOOP = "op_uie"
CLOSED_LOOP = "cl_uie"
_SCHUR = 1.0 - 1e-9
_TOLERANCE = 1e-10
_CIRCLE = 1e-6  # zeros this close to the unit circle are borderline


class Fit(Enum):
    """How noise in the record is met."""

    TRUNCATED = "truncated"
    LEAST_SQUARES = "least_squares"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class InputOptions:
    """Options of both estimators.

    Attributes:
        past: N_ini; longer than the lag of the plant, by default 5 or what the lag asks for.
        future: output samples used from t on; the estimate lags the newest output by future - 1; by default as few as
            condition (8) asks for.
        order: order of the plant, if it is known; needed for noisy records without a clear gap.
        fit: `truncated` keeps the trajectories above the noise (total least squares; falls back to the other without a
            gap); `least_squares` is the paper's plain pseudo-inverse of noisy data, which shows neither (8) nor zeros.
        relative_tolerance: what counts as rounding in exact data; None: 1e-10, and the order is called ambiguous where
            something lies between that and double precision.
        poles: op-UIE only.
        output_weight: cl-UIE only: R = output_weight I in the dual LQR with Q = I; larger trusts the outputs less.
        threshold: the residual threshold that the certificate's smallest bias refers to.
    """

    past: int | None = Field(default=None, ge=2)
    future: int | None = Field(default=None, ge=1)
    order: int | None = Field(default=None, ge=1)
    relative_tolerance: float | None = Field(default=None, gt=0.0, lt=1.0)
    fit: Fit = Fit.TRUNCATED
    poles: Poles = Poles.MINIMUM_NORM
    output_weight: float = Field(default=1.0, gt=0.0)
    threshold: float = Field(default=1e-3, gt=0.0)

    @property
    def tolerance(self) -> float:
        """What counts as rounding."""
        return self.relative_tolerance or _TOLERANCE

    @property
    def sizes(self) -> Sizes:
        """What is said about the windows."""
        return Sizes(
            past=self.past,
            future=self.future,
            order=self.order,
            tolerance=self.tolerance,
            truncated=self.fit is Fit.TRUNCATED,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Record:
    """The record in two parts and its windows; the windows are in the units in which norms are taken."""

    history: History
    spread: Scaling
    norm: Scaling
    windows: Windows
    behaviour: Behaviour

    @property
    def claim(self) -> tuple[bool, int, int]:
        """Whether the windows are exact, the directions that they span, and the windows beyond those."""
        exact = self.behaviour.decided and not self.behaviour.noise
        return exact, self.behaviour.rank, self.windows.columns - self.behaviour.rank


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
    nothing = InputReport(past=chosen.past or 0, delay=0, columns=0, dropped=0)
    return guarded(lambda: _design(kind, history, chosen), lambda reason: _refused(kind, nothing, reason))


def _design(kind: str, history: History, chosen: InputOptions) -> InputDesign:
    seen = hold_back(history).seen
    spread = spreads(seen)
    norm = norms(seen, spread)
    scaled = norm.scaled(seen)
    try:
        windows, behaviour = fit_windows(scaled, chosen.sizes)
    except HistoryError as error:
        return _refused(kind, InputReport(past=chosen.past or 0, delay=0, columns=0, dropped=0), str(error))
    report = _report(windows, behaviour)
    if behaviour.hidden and chosen.relative_tolerance is None and chosen.order is None:
        return _refused(kind, report, _ambiguous(behaviour))
    if invisible(behaviour):
        return _refused(kind, report, _unseen(report, behaviour, larger_future(scaled, chosen.sizes, windows)))
    if report.zeros is not None and (reason := _unstable(report.zeros, behaviour)):
        longer = without_zeros(scaled, chosen.sizes, windows, _SCHUR)
        if longer is None:
            return _refused(kind, report, reason)
        if chosen.past is not None:
            mend = f"past {windows.past} is too short, expected past >= {longer[0].past}"
            return _refused(kind, report, f"windows show zeros that longer ones do not: {mend}")
        windows, behaviour = longer
        report = _report(windows, behaviour)
    record = _Record(history=history, spread=spread, norm=norm, windows=windows, behaviour=behaviour)
    return _solve(kind, record, report, chosen)


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
    return report if invisible(behaviour) else replace(report, zeros=invariant_zeros(behaviour, windows.past))


def _ambiguous(behaviour: Behaviour) -> str:
    return (
        f"ambiguous order, borderline: the record shows order {behaviour.order}, and a direction of "
        f"{behaviour.hidden:.2g} of the largest lies above the rounding of double precision: a mode or an input that "
        "is hardly excited, or samples with fewer digits; give order or relative_tolerance, or excite more"
    )


def _unseen(report: InputReport, behaviour: Behaviour, future: int | str) -> str:
    """Condition (8) fails, as far as the record tells, and what would mend it."""
    if behaviour.noise:
        return (
            f"condition (8) of I cannot be told from noise: the input at t shows as {report.visibility:.1g} in the "
            f"outputs up to t + {report.delay}, noise as {behaviour.noise:.1g}; record longer, or try least_squares"
        )
    mend = future if isinstance(future, str) else f"future {future} shows it"
    return (
        "condition (8) of I fails, U_f ker H is not 0: the input at t does not show in the outputs up to "
        f"t + {report.delay} (visibility {report.visibility:.1g}); {mend}"
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


def _solve(kind: str, record: _Record, report: InputReport, options: InputOptions) -> InputDesign:
    """Choose the gains once condition (8) and the zeros are checked."""
    windows, behaviour = record.windows, record.behaviour
    found: Gains | None = least_norm(behaviour, windows, options.tolerance)
    assert found is not None  # noqa: S101 - a pseudo-inverse always is
    if kind == CLOSED_LOOP:
        found = corrected(found, options.output_weight)
        if found is None:
            reason = "no stabilising gain of cl-UIE is found: record with less noise or give the order"
            return _refused(kind, report, reason)
    elif options.poles is Poles.LMI:
        fastest = 0.0 if report.zeros is None else float(np.max(np.abs(report.zeros), initial=0.0))
        found = placed(found, behaviour, windows, options.tolerance, fastest)
        if found is None:
            return _refused(kind, report, "the LMI of I, (16) finds no stable op-UIE: use cl_uie")
    misfit = windows.u_now - np.hstack([found.U1, found.Y1]) @ windows.H
    fit = float(np.linalg.norm(misfit) / np.linalg.norm(windows.u_now))
    return _finish(kind, found, record, replace(report, fit=fit), options)


def _finish(kind: str, gains: Gains, record: _Record, report: InputReport, options: InputOptions) -> InputDesign:
    """Measure the running form; refuse it when it is not stable or does not hold on unseen windows."""
    strategy = options.poles.value if kind == OPEN_LOOP else "dual_lqr"
    dynamics = measure_dynamics(gains.A_z, strategy, report.fit or 0.0, record.history.sampling_period_sec)
    radius = dynamics.spectral_radius
    if radius >= _SCHUR:
        mend = "expected < 1; try poles lmi or cl_uie"
        return _refused(kind, report, f"{strategy} is not stable: spectral radius {radius:.4g}, {mend}")
    spread, norm = record.spread, record.norm
    final = gains.in_units(norm.u, norm.y)
    observer = realise(final)
    exact, unknowns, spare = record.claim
    proof = prove_inputs(
        realise(final.in_units(1.0 / spread.u, 1.0 / spread.y)),
        gains,
        hold_back(record.history, gains.past + gains.future - 1),
        spread,
        Claim(exact=exact, unknowns=unknowns, spare_columns=spare, tolerance=options.tolerance),
    )
    residual = measure_residual(realise(gains), np.full(observer.outputs, options.threshold), norm.y)
    report = replace(report, noise_gain=noise_gain(observer))
    certificate = Certificate(
        kind=kind,
        accepted=proof.holds,
        verdict=f"refused: {proof.refusal()}",
        lag=observer.lag,
        method=report,
        dynamics=dynamics,
        residual=residual,
        proof=proof,
        matrices={name: getattr(final, name) for name in ("U1", "Y1", "U2", "Y2", "L", "A_op")},
    )
    if not proof.holds:
        return InputDesign(kind=kind, observer=None, certificate=certificate, report=report)
    verdict = (
        f"accepted: reconstructs {len(gains.U1)} inputs {report.delay} steps late; errors shrink to 1 % in "
        f"{dynamics.convergence_steps} steps (radius {radius:.3g}); rank {report.rank_basis}; "
        f"residual: {sees(residual)}; {proof.words()}"
    )
    certificate = replace(certificate, verdict=verdict)
    return InputDesign(kind=kind, observer=observer, certificate=certificate, report=report)


def _refused(kind: str, report: InputReport, reason: str) -> InputDesign:
    certificate = Certificate(kind=kind, accepted=False, verdict=f"refused: {reason}", method=report)
    return InputDesign(kind=kind, observer=None, certificate=certificate, report=report)
