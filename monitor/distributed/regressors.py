"""The data matrices of one node, in four forms that obey the same linear relation.

D (20) relates values at one instant: Xdot = T_x X + T_u U + T_y Ydot. The relation is linear, so it holds as well for

- `derivatives`: the values themselves, when derivatives are measured (the paper);
- `integral`: integrals over stretches of samples, Xdot -> x(b) - x(a), X -> int x (De Persis et al. 2024), by the
  trapezoidal rule: error O(h^2), no derivative of noise;
- `filtered`: values and derivatives behind the same low-pass 1 / (tau s + 1): x_f' = (x - x_f) / tau;
- `sampled`: Xdot -> x_t+1, X -> x_t. For inputs held over a sample this is the integral over one sample without any
  error, (x_t+1 - x_t) = (A_d - I) x_t + …, because T_x = I + (integral's T_x) - T_y C is only another way to write it.
  A design from it is a design for the sampled plant: Schur takes the place of Hurwitz.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import Experiment, History


@dataclass(frozen=True, slots=True, kw_only=True)
class Regressors:
    """D (14): U, Y, Ydot, X, Xdot of one node, a column an instant (or a stretch).

    Attributes:
        U: (m, N) known inputs.
        Y: (p, N) outputs.
        Ydot: (p, N) their derivatives, increments or next values.
        X: (n, N) states.
        Xdot: (n, N) likewise.
        sampled: the dots are next values: the design is for the sampled plant.
        comparable: units are comparable as they are, as those of D are: norms, weights and D (13) are taken in them;
            else in the spread of each signal. Spreads more than four decades apart are never comparable.
    """

    U: NDArray[np.float64]
    Y: NDArray[np.float64]
    Ydot: NDArray[np.float64]
    X: NDArray[np.float64]
    Xdot: NDArray[np.float64]
    sampled: bool = False
    comparable: bool = True

    @property
    def columns(self) -> int:
        """Number N of columns."""
        return int(self.X.shape[1])

    def part(self, start: int, stop: int) -> Regressors:
        """Columns from one to before another."""
        cut = {name: getattr(self, name)[:, start:stop] for name in ("U", "Y", "Ydot", "X", "Xdot")}
        return replace(self, **cut)

    def in_units(self, u: NDArray[np.float64], y: NDArray[np.float64], x: NDArray[np.float64]) -> Regressors:
        """The same with every signal divided by its scale, (m,), (p,), (n,)."""
        scales = {"U": u, "Y": y, "Ydot": y, "X": x, "Xdot": x}
        return replace(self, **{name: getattr(self, name) / scale[:, None] for name, scale in scales.items()})


def derivatives(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    x: NDArray[np.float64],
    ydot: NDArray[np.float64],
    xdot: NDArray[np.float64],
) -> Regressors:
    """Take measured values and derivatives, one row an instant; the instants may be anywhere."""
    return Regressors(U=u.T, Y=y.T, Ydot=ydot.T, X=x.T, Xdot=xdot.T)


def sampled(history: History) -> Regressors:
    """Pairs of consecutive samples of all experiments; pairs with a gap are dropped."""
    parts = [
        _whole(
            Regressors(U=one.u[:-1].T, Y=one.y[:-1].T, Ydot=one.y[1:].T, X=one.x[:-1].T, Xdot=one.x[1:].T, sampled=True)
        )
        for one in history.experiments
    ]
    return replace(_joined(parts), comparable=history.comparable)


def integral(history: History, samples: int) -> Regressors:
    """Integrals over stretches of `samples` samples that start at every sample; inputs are held over a sample.

    Raises:
        HistoryError: stretches that do not fit into the experiments.
    """
    h, parts = history.sampling_period_sec, []
    for one in history.experiments:
        starts = len(one.x) - samples
        if samples < 1 or starts < 1:
            raise HistoryError(f"stretches of {samples} samples do not fit into an experiment of {len(one.x)} samples")
        held = np.vstack([np.zeros((1, one.u.shape[1])), np.cumsum(one.u, axis=0)[:-1] * h])
        parts.append(
            _whole(
                Regressors(
                    U=(held[samples:] - held[:starts]).T,
                    Y=_trapezoid(one.y, samples, h).T,
                    Ydot=(one.y[samples:] - one.y[:starts]).T,
                    X=_trapezoid(one.x, samples, h).T,
                    Xdot=(one.x[samples:] - one.x[:starts]).T,
                )
            )
        )
    return _joined(parts)


def filtered(history: History, time_constant_sec: float) -> Regressors:
    """Everything behind a low-pass of this time constant, discretised by the trapezoidal rule.

    The filters of all signals start at 0; what the start leaves behind decays with the time constant, so columns
    before ten time constants are left out (e^-10 = 5e-5).

    Raises:
        HistoryError: nothing is left then.
    """
    h, parts = history.sampling_period_sec, []
    settled = int(np.ceil(10.0 * time_constant_sec / h))
    for one in history.experiments:
        if len(one.x) <= settled + 1:
            raise HistoryError(
                f"an experiment of {len(one.x)} samples is shorter than ten filter time constants, {settled} samples"
            )
        x, y = _low_pass(one.x, time_constant_sec, h), _low_pass(one.y, time_constant_sec, h)
        u = _low_pass_held(one.u, time_constant_sec, h)
        parts.append(
            _whole(
                Regressors(
                    U=u[settled:].T,
                    Y=y[settled:].T,
                    Ydot=((one.y - y)[settled:] / time_constant_sec).T,
                    X=x[settled:].T,
                    Xdot=((one.x - x)[settled:] / time_constant_sec).T,
                )
            )
        )
    return _joined(parts)


def differences(history: History) -> Regressors:
    """Central differences instead of derivatives: what one would do first; for comparison."""
    h = history.sampling_period_sec
    return _joined([_whole(_central(one, h)) for one in history.experiments])


def _central(one: Experiment, h: float) -> Regressors:
    return Regressors(
        U=one.u[1:-1].T,
        Y=one.y[1:-1].T,
        Ydot=((one.y[2:] - one.y[:-2]) / (2.0 * h)).T,
        X=one.x[1:-1].T,
        Xdot=((one.x[2:] - one.x[:-2]) / (2.0 * h)).T,
    )


def _trapezoid(signal: NDArray[np.float64], samples: int, h: float) -> NDArray[np.float64]:
    """Integral over `samples` samples from every sample on."""
    total = np.vstack([np.zeros((1, signal.shape[1])), np.cumsum((signal[1:] + signal[:-1]) * (h / 2.0), axis=0)])
    return np.asarray(total[samples:] - total[: len(total) - samples])


def _low_pass(signal: NDArray[np.float64], time_constant_sec: float, h: float) -> NDArray[np.float64]:
    """Low-pass with the signal taken as linear between samples (exact for such a signal)."""
    decay, ratio = np.exp(-h / time_constant_sec), time_constant_sec / h
    before, now = ratio * (1.0 - decay) - decay, 1.0 - ratio * (1.0 - decay)
    rows = [np.zeros(signal.shape[1])]
    for earlier, later in pairwise(signal):
        rows.append(decay * rows[-1] + before * earlier + now * later)
    return np.array(rows)


def _low_pass_held(signal: NDArray[np.float64], time_constant_sec: float, h: float) -> NDArray[np.float64]:
    """Low-pass with the signal held over a sample (exact for inputs)."""
    decay = np.exp(-h / time_constant_sec)
    rows = [np.zeros(signal.shape[1])]
    for sample in signal[:-1]:
        rows.append(decay * rows[-1] + (1.0 - decay) * sample)
    return np.array(rows)


def _whole(data: Regressors) -> Regressors:
    """Columns without a gap."""
    kept = np.isfinite(np.vstack([data.U, data.Y, data.Ydot, data.X, data.Xdot])).all(axis=0)
    return Regressors(
        U=data.U[:, kept],
        Y=data.Y[:, kept],
        Ydot=data.Ydot[:, kept],
        X=data.X[:, kept],
        Xdot=data.Xdot[:, kept],
        sampled=data.sampled,
        comparable=data.comparable,
    )


def _joined(parts: list[Regressors]) -> Regressors:
    """Experiments side by side."""
    return Regressors(
        U=np.hstack([part.U for part in parts]),
        Y=np.hstack([part.Y for part in parts]),
        Ydot=np.hstack([part.Ydot for part in parts]),
        X=np.hstack([part.X for part in parts]),
        Xdot=np.hstack([part.Xdot for part in parts]),
        sampled=parts[0].sampled,
        comparable=parts[0].comparable,
    )
