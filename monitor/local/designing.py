"""From the own history to an observer of the own state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from monitor.backstop import guarded
from monitor.carrying import parsed
from monitor.certificate import Certificate, DataReport
from monitor.errors import HistoryError
from monitor.history import Experiment
from monitor.linear_observer import LinearObserver
from monitor.options import parse_options
from monitor.proof import hold_back, noise, prove, rounding
from monitor.rank import LOST
from monitor.regression import regress_states
from monitor.riccati import dual_lqr
from monitor.scaling import norms, spreads
from monitor.settings import LocalSettings
from monitor.sight import measure_dynamics, noise_covariance
from monitor.trials import try_observer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from monitor.history import History
    from monitor.proof import Proof, Split
    from monitor.regression import Fit
    from monitor.scaling import Scaling

KIND = "luenberger"
_RUNNING = ("A", "G", "L", "conductances", "load")
_REFERENCE = 1  # column of d that holds the DGU's own reference
_SURE = 3.0  # standard errors that a coefficient must stand above 0 to be known
_MISFIT = 1e-9  # relative: a history that misses the plant by less carries rounding only
_EXACT = 1e-10  # relative rounding of exact samples


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalDesign:
    """The observer of the own state, or the reason why there is none.

    Attributes:
        observer: known inputs are the neighbours' voltages, the reference and the load; None when refused.
        certificate: what the data showed.
        error: (n, n) A - L, how the residual goes on by itself.
        load_direction: (n,) how one ampere of load moves the state in a sample.
        conductances: (neighbours,) 1/R_ij as the history shows them [S]; 0 where it does not show any.
        load: mean load in the history [A].
        recorded: the document that it was carried in; "": it was designed here.
    """

    observer: LinearObserver | None
    certificate: Certificate
    error: NDArray[np.float64]
    load_direction: NDArray[np.float64]
    conductances: NDArray[np.float64]
    load: float
    recorded: str = ""

    @property
    def kind(self) -> str:
        """Name of the design method."""
        return self.certificate.kind

    @property
    def document(self) -> str:
        """The certificate, which has everything that runs, as JSON."""
        return self.recorded or self.certificate.to_json()

    @property
    def accepted(self) -> bool:
        """Whether there is an observer."""
        return self.observer is not None

    @property
    def verdict(self) -> str:
        """One line in plain words."""
        return self.certificate.verdict


def design(history: History, neighbours: int, options: Mapping[str, object]) -> LocalDesign:
    """Design z+ = A z + G u + L (y - z), r = y - z with u = [neighbours' voltages, reference, load] (G, section III).

    A and G are those of x_t+1 = A x_t + G u_t on the DGU's own history (its x, w and d: the DGU measures its own state,
    load and, in the offline experiment, its neighbours' voltages); L is the dual LQR's. Every input is known, so this
    is a plain regression and no truncation decides anything; what can go wrong is said in the refusal.

    Args:
        history: the DGU's own.
        neighbours: how many links it receives on.
        options: decay, load_sec and load_range_a of `LocalSettings`.

    Raises:
        MonitorError: unknown option.
    """
    parsed = parse_options(LocalSettings, options, KIND)
    try:
        return guarded(lambda: _design(history, neighbours, parsed), refused)
    except HistoryError as error:
        return refused(str(error))


def _design(history: History, neighbours: int, parsed: LocalSettings) -> LocalDesign:
    split = hold_back(_known(history, neighbours))
    spread = spreads(split.seen)
    norm = norms(split.seen, spread)
    return _accept(_Fitted(split=split, spread=spread, norm=norm, fit=_fit(norm.scaled(split.seen))), parsed)


def refused(reason: str) -> LocalDesign:
    """Return a design without an observer, and why."""
    nothing = np.zeros(0)
    return LocalDesign(
        observer=None,
        certificate=Certificate(kind=KIND, accepted=False, verdict=f"refused: {reason}"),
        error=np.zeros((0, 0)),
        load_direction=nothing,
        conductances=nothing,
        load=float("nan"),
    )


def carried(document: str) -> LocalDesign | None:
    """Take a design from its document; None where that does not hold everything."""
    found = parsed(document)
    verdict, matrices = str(found.get("verdict", "")), found.get("matrices")
    if found and not found.get("accepted"):
        return replace(
            refused(""), certificate=Certificate(kind=KIND, accepted=False, verdict=verdict), recorded=document
        )
    if not isinstance(matrices, dict) or not set(_RUNNING) <= set(matrices):
        return None
    arrays = {name: np.asarray(matrices[name], dtype=np.float64) for name in _RUNNING}
    certificate = Certificate(kind=KIND, accepted=True, verdict=verdict)
    return replace(_running(certificate, arrays), recorded=document)


def _running(certificate: Certificate, matrices: Mapping[str, NDArray[np.float64]]) -> LocalDesign:
    """What follows from the matrices, without a rounding that could differ between processors."""
    A, G, L = (matrices[symbol] for symbol in ("A", "G", "L"))
    return LocalDesign(
        observer=_observer(A, G, L),
        certificate=certificate,
        error=A - L,
        load_direction=G[:, -1],
        conductances=matrices["conductances"],
        load=float(matrices["load"]),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fitted:
    """The history with everything that acts on the DGU as known input, and A and G in units in which norms are taken.

    Attributes:
        split: in the user's units; u = [neighbours' voltages, reference, load], y = x.
        spread: of the signals.
        norm: units in which norms are taken.
        fit: x_t+1 = [A G] [x_t; u_t] in these.
    """

    split: Split
    spread: Scaling
    norm: Scaling
    fit: Fit

    @property
    def neighbours(self) -> int:
        """How many of them."""
        return self.split.seen.inputs - 2


def _known(history: History, neighbours: int) -> History:
    """Everything that acts on the DGU as known input.

    Raises:
        HistoryError: it is not all recorded.
    """
    first = history.experiments[0]
    recorded = first.w.shape[1] - 1
    if recorded < 0 or first.d.shape[1] <= _REFERENCE:
        raise HistoryError("the own history holds no load, neighbours' voltages (w) and reference (d): record them")
    if recorded == 0:
        raise HistoryError("no neighbour's voltage acts on this DGU: its own state says nothing about any link")
    if recorded != neighbours:
        raise HistoryError(f"the own history holds {recorded} neighbours' voltages, expected one a link: {neighbours}")
    reference = slice(_REFERENCE, _REFERENCE + 1)
    experiments = (
        Experiment(np.hstack([one.w[:, 1:], one.d[:, reference], one.w[:, :1]]), one.x, one.x)
        for one in history.experiments
    )
    return replace(history, experiments=tuple(experiments))


def _fit(seen: History) -> Fit:
    voltages = [f"neighbour {number + 1}'s voltage" for number in range(seen.inputs - 2)]
    names = [*(f"x[{row}]" for row in range(seen.states)), *voltages, "the reference", "the load"]
    return regress_states(seen, [(one.u,) for one in seen.experiments], names)


def _accept(found: _Fitted, options: LocalSettings) -> LocalDesign:
    fit, norm, spread, neighbours = found.fit, found.norm, found.spread, found.neighbours
    n = len(norm.x)
    A, G = fit.Theta[:, :n], fit.Theta[:, n:]
    conductances = _conductances(found)
    gain = dual_lqr(A / options.decay, np.eye(n))  # never None: everything is measured
    if gain is None or not conductances.any():
        raise HistoryError("blind: the history does not show how any neighbour's voltage acts on the own state")
    A, G, L = (norm.x[:, None] * one / by for one, by in ((A, norm.x), (G, norm.u), (options.decay * gain, norm.x)))
    load = float(np.nanmean(np.concatenate([one.u[:, -1] for one in found.split.seen.experiments])))
    unseen = [str(number + 1) for number in np.flatnonzero(conductances == 0.0)]
    lasting = np.asarray(np.linalg.solve(np.eye(n) - A + L, G[:, -1]), dtype=np.float64)
    matrices = {"A": A, "G": G, "L": L, "conductances": conductances, "gain": lasting, "load": np.asarray(load)}
    proof = _prove(found, _observer(A, G, L))
    if not proof.holds:
        return replace(refused(""), certificate=_refusal(proof))
    scaled = (A - L) * spread.x / spread.x[:, None]
    certificate = Certificate(
        kind=KIND,
        accepted=True,
        verdict=f"{_words(neighbours, fit, unseen)}; {proof.words()}",
        data=_report(found.split.seen, neighbours, fit),
        dynamics=measure_dynamics(scaled, "dual_lqr", fit.misfit, found.split.seen.sampling_period_sec),
        proof=proof,
        matrices=matrices,
    )
    return _running(certificate, matrices)


def _refusal(proof: Proof) -> Certificate:
    return Certificate(kind=KIND, accepted=False, verdict=f"refused: {proof.refusal()}", proof=proof)


def _conductances(found: _Fitted) -> NDArray[np.float64]:
    """1/R_ij of every neighbour in the user's units; 0 where the history shows none beyond rounding and noise.

    What is shown is decided in shares of the spread.

    Raises:
        HistoryError: the load does not show.
    """
    fit, neighbours = found.fit, found.neighbours
    n, into = len(found.norm.x), found.spread.relative_to(found.norm)
    G, error = (one[:, n:] * into.u / into.x[:, None] for one in (fit.Theta, fit.error))
    rounding_left = LOST * max(fit.misfit, float(np.finfo(float).eps))
    if np.linalg.norm(G[:, -1]) <= _SURE * np.linalg.norm(error[:, -1]) + rounding_left:
        raise HistoryError("the history does not show how the load acts: excite it more or record with less noise")
    load_direction = fit.Theta[:, -1]
    toward = load_direction / (load_direction @ load_direction)  # b^+
    found_ones = -(toward @ fit.Theta[:, n : n + neighbours])
    doubt = np.abs(toward) @ fit.error[:, n : n + neighbours]
    share = into.u[:neighbours] / into.u[-1]
    shown = np.abs(found_ones) * share > _SURE * doubt * share + rounding_left
    return np.where(shown, found_ones * found.norm.u[-1] / found.norm.u[:neighbours], 0.0)


def _prove(found: _Fitted, observer: LinearObserver) -> Proof:
    """Run the predictor over the samples that were held back."""
    spread, n, k = found.spread, len(found.norm.x), found.fit.Theta.shape[1]
    state = spread.x
    inside = replace(spread, u=1.0 / spread.u, y=1.0 / spread.y, x=1.0 / spread.x).observer(observer, 1.0 / state)
    unseen = try_observer(inside, spread.scaled(found.split.unseen), found.split.overlap)
    gain = float(np.sqrt(np.max(np.diag(noise_covariance(inside, np.eye(n))))))
    allowed = rounding(_EXACT, gain, unseen)
    if found.fit.misfit > _MISFIT:
        allowed = noise(try_observer(inside, spread.scaled(found.split.seen), found.split.overlap), k, allowed)
    return prove(unseen, allowed, (spread.x, spread.y), spare_columns=found.fit.columns - k)


def _observer(A: NDArray[np.float64], G: NDArray[np.float64], L: NDArray[np.float64]) -> LinearObserver:
    """The predictor in running form: xhat = z, r = y - z, started from z_0 = y_0."""
    n, m = len(A), G.shape[1]
    return LinearObserver(
        A=A - L,
        B=np.hstack([G, L]),
        M=np.eye(n),
        D=np.zeros((n, m + n)),
        H=-np.eye(n),
        J=np.hstack([np.zeros((n, m)), np.eye(n)]),
        Z=np.hstack([np.zeros((n, m)), np.eye(n)]),
        inputs=m,
        outputs=n,
    )


def _report(history: History, neighbours: int, fit: Fit) -> DataReport:
    n, m = history.states, neighbours + 2
    return DataReport(
        states=n,
        known_inputs=m,
        outputs=n,
        experiments=len(history.experiments),
        columns=fit.columns,
        dropped=sum(len(one.x) - 1 for one in history.experiments) - fit.columns,
        sampling_period_sec=history.sampling_period_sec,
        unknown_inputs=0,
        rank=n + m,
        rank_basis="regression",
        rank_confidence=1.0,
        rank_reason="every input is recorded, so the regressors alone decide",
        exciting=True,
        excitation=fit.excitation,
        innovation_values=np.array([fit.misfit]),
        singular_values=fit.excitation,
    )


def _words(neighbours: int, fit: Fit, unseen: list[str]) -> str:
    sees = f"sees what the voltages of {neighbours - len(unseen)} of {neighbours} neighbours leave unexplained"
    blind = f", not those of neighbour {', '.join(unseen)}" if unseen else ""
    return f"accepted: {sees}{blind}; misfit {fit.misfit:.2g} over {fit.columns} columns"
