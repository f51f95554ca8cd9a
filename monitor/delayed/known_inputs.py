"""The delayed observer from a history in which the inputs that are unknown online were recorded.

x_f = A x_p + E d_p is then a plain regression: nothing is left of the freedom of `coordinates`, and the reconstructed
input comes in the units of d. Where the inputs cannot be cancelled exactly, what is bounded is their deviation from the
operating point of the history, d = mean + reach w with |w| <= 1 over the history.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.behaviour import identify_output
from monitor.delayed.coordinates import with_attacks
from monitor.delayed.designing import DelayedOptions, Goal, design_for, refuse
from monitor.delayed.model import Model, model_of
from monitor.delayed.realisation import ConstantInput
from monitor.errors import HistoryError
from monitor.history import data_matrices
from monitor.observers.linear_observer import LinearObserver
from monitor.regression import regress_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.report import DelayedDesign
    from monitor.history import History

KIND = "delayed"


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=ConfigDict(extra="forbid"))
class KnownInputOptions(DelayedOptions):
    """Options of the delayed observer with recorded inputs, besides those of every delayed observer.

    Attributes:
        attacked: positions in y of outputs that may be falsified; the attack is then reconstructed next to d.
        attack_bound: size [units of y] of an attack that counts as |w| = 1.
    """

    attacked: tuple[int, ...] = ()
    attack_bound: float = Field(default=1.0, gt=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownInputDesign:
    """The reconstruction of inputs and attacks, or the reason why there is none.

    Attributes:
        design: of the state.
        observer: estimate = [d; phi] in the units of the record, `design.guarantee.delay` steps late; None when
            refused.
        noise_gain: (m_d + attacked, m_d + attacked) steady covariance of it under white noise of unit covariance on y.
        reach: (m_d + attacked,) how much of each counts as |w| = 1 in the guarantee.
        misfit: |X_f - A X_p - E D_p| / |X_f| on the history.
    """

    design: DelayedDesign
    observer: LinearObserver | ConstantInput | None
    noise_gain: NDArray[np.float64]
    reach: NDArray[np.float64]
    misfit: float


def design_known(history: History, options: KnownInputOptions) -> KnownInputDesign:
    """Design the delayed observer of a history with d; a refusal is a value.

    Raises:
        HistoryError: the history does not determine A, E and C.
    """
    n, m_d = history.states, history.experiments[0].d.shape[1]
    if history.inputs:
        raise HistoryError(f"{history.inputs} known inputs, expected none: a link carries none")
    C = identify_output(data_matrices(history))
    if not all(0 <= channel < len(C) for channel in options.attacked):
        raise HistoryError(f"attacked is {options.attacked}, expected positions 0 to {len(C) - 1}")
    names = [*(f"x[{row}]" for row in range(n)), *(f"d[{row}]" for row in range(m_d))]
    fit = regress_states(history, [(one.d,) for one in history.experiments], names)
    A, E = fit.Theta[:, :n], fit.Theta[:, n:]
    attacks = len(options.attacked)
    nothing = KnownInputDesign(
        design=refuse(KIND, ""),
        observer=None,
        noise_gain=np.full((m_d + attacks, m_d + attacks), np.nan),
        reach=np.ones(m_d + attacks),
        misfit=fit.misfit,
    )
    exact = _exact(history, options, with_attacks(model_of(A, E, C), options.attacked, 1.0))
    if exact.accepted or options.goal is Goal.EXACT:
        return _finished(nothing, exact, np.ones(m_d + attacks), np.zeros(m_d))
    mean, reach = _spread(history)
    around = with_attacks(_around(A, E, C, mean, reach), options.attacked, options.attack_bound)
    chosen = replace(options, goal=Goal.BOUNDED)
    unit = f"d - mean of the size it had in the history ({', '.join(f'{one:.3g}' for one in reach)})"
    bounded = design_for(KIND, around, chosen, history.sampling_period_sec, unit=unit, constant=True)
    return _finished(nothing, bounded, np.concatenate([reach, np.full(attacks, options.attack_bound)]), mean)


def _exact(history: History, options: KnownInputOptions, model: Model) -> DelayedDesign:
    """Cancel d itself: no operating point enters."""
    if options.goal is Goal.BOUNDED:
        return refuse(KIND, "a bounded design is asked for")
    chosen = replace(options, goal=Goal.EXACT)
    return design_for(KIND, model, chosen, history.sampling_period_sec, unit="an input of norm 1")


def _spread(history: History) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean of d, and how much of each input makes |w| = 1 the largest deviation of the history."""
    d = np.vstack([one.d for one in history.experiments])
    d = d[np.isfinite(d).all(axis=1)]
    mean = d.mean(axis=0)
    each = np.max(np.abs(d - mean), axis=0)
    return mean, each * float(np.max(np.linalg.norm((d - mean) / each, axis=1)))


def _around(
    A: NDArray[np.float64],
    E: NDArray[np.float64],
    C: NDArray[np.float64],
    mean: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> Model:
    """x+ = A x + E reach w + E mean 1, y = C x."""
    return Model(
        A=A,
        B=E * reach,
        C=C,
        D=np.zeros((len(C), len(reach))),
        B_u=(E @ mean)[:, None],
        D_u=np.zeros((len(C), 1)),
    )


def _finished(
    nothing: KnownInputDesign, made: DelayedDesign, reach: NDArray[np.float64], mean: NDArray[np.float64]
) -> KnownInputDesign:
    """Turn w of the design into d and phi: [d; phi] = reach w + [mean; 0]."""
    found = made.input_observer
    if found is None or made.input_noise_gain is None:
        return replace(nothing, design=made)
    inner = found.inner if isinstance(found, ConstantInput) else found
    assert isinstance(inner, LinearObserver)  # noqa: S101 - designs are made of single observers
    M, D = reach[:, None] * inner.M, reach[:, None] * inner.D
    if isinstance(found, ConstantInput):
        D[: len(mean), 0] += mean  # the first known input is the constant 1
    scaled = replace(inner, M=M, D=D)
    return replace(
        nothing,
        design=made,
        observer=ConstantInput(scaled) if isinstance(found, ConstantInput) else scaled,
        noise_gain=made.input_noise_gain * np.outer(reach, reach),
        reach=reach,
    )
