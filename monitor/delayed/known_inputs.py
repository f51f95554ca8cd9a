"""The delayed observer from a history in which the inputs that are unknown online were recorded.

x_f = A x_p + E d_p and y = C x + G d are then plain regressions: nothing is left of the freedom of `coordinates`, and
the reconstructed input comes in the units of d. Where the inputs cannot be cancelled exactly, what is bounded is their
deviation from the operating point of the history, d = mean + reach w with |w| <= 1 over the history.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from monitor.behaviour import identify_direct
from monitor.constant_input import ConstantInput, linear_part
from monitor.delayed.coordinates import with_attacks
from monitor.delayed.designing import DelayedOptions, Goal, Units, design_for, refuse
from monitor.delayed.model import Model, model_of
from monitor.delayed.proving import Claim, prove_inputs
from monitor.delayed.units import in_units
from monitor.errors import HistoryError, MonitorError
from monitor.options import STRICT
from monitor.proof import SIGMAS, hold_back
from monitor.regression import regress_states
from monitor.scaling import norms, spreads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.delayed.report import DelayedDesign
    from monitor.history import History
    from monitor.linear_observer import LinearObserver
    from monitor.proof import Proof
    from monitor.scaling import Scaling

KIND = "delayed"
_EXACT = 1e-9  # relative: a history that misses the plant by less carries rounding only
_ROUNDING = 1e-10  # relative rounding of exact samples
_RANK = 1e-9  # relative: smaller singular values are zero
_IDLE = 1e-12  # shares of the spread: what moves states and outputs by less is rounding
_DEPENDENT = 1e-8  # relative: inputs that act more alike than this are the same
_NOISE_SAFETY, _COARSE = 3.0, 0.1  # directions closer than this to the error of the model are not told from noise


@checked_dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class KnownInputOptions(DelayedOptions):
    """Options of the delayed observer with recorded inputs, besides those of every delayed observer.

    Attributes:
        attacked: positions in y of outputs that may be falsified; the attack is then reconstructed next to d.
        attack_bound: size [units of y] of an attack that counts as |w| = 1.
    """

    attacked: tuple[int, ...] = ()
    attack_bound: float = Field(default=1.0, gt=0.0)


def check_acting(acting: NDArray[np.float64]) -> None:
    """Check that inputs act, and each in its own way.

    Args:
        acting: (n + p, m_d) [E; G] in shares of the spread of states, outputs and inputs.

    Raises:
        HistoryError: an input acts on nothing, or some act alike.
    """
    sizes = np.linalg.norm(acting, axis=0)
    for idle in np.flatnonzero(sizes <= _IDLE):
        raise HistoryError(
            f"d[{idle}] acts on nothing that was recorded ({sizes[idle]:.1g} of the spread): leave it out, or measure "
            "what it moves"
        )
    values = np.linalg.svd(acting / sizes, compute_uv=False)
    if acting.shape[1] > len(acting) or values[-1] <= _DEPENDENT * values[0]:
        raise HistoryError(f"rank [E; G] < {len(sizes)}: some unknown inputs act alike, leave them out")


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
        proof: the reconstructed inputs on unseen samples, None when it did not come so far.
    """

    design: DelayedDesign
    observer: LinearObserver | ConstantInput | None
    noise_gain: NDArray[np.float64]
    reach: NDArray[np.float64]
    misfit: float
    proof: Proof | None = None


def design_known(history: History, options: KnownInputOptions) -> KnownInputDesign:
    """Design the delayed observer of a history with d; a refusal is a value.

    Raises:
        HistoryError: the history does not determine A, E and C.
    """
    if history.inputs:
        raise HistoryError(f"{history.inputs} known inputs, expected none: a link carries none")
    split = hold_back(history, max(options.delay, 1))
    spread = spreads(split.seen)
    norm = norms(split.seen, spread)
    plant = _identify(norm.scaled(split.seen), spread.relative_to(norm), norm)
    p, m_d, attacks = len(plant.C), plant.E.shape[1], len(options.attacked)
    if not all(0 <= channel < p for channel in options.attacked):
        raise HistoryError(f"attacked is {options.attacked}, expected positions 0 to {p - 1}")
    nothing = KnownInputDesign(
        design=refuse(KIND, ""),
        observer=None,
        noise_gain=np.full((m_d + attacks, m_d + attacks), np.nan),
        reach=np.ones(m_d + attacks),
        misfit=plant.misfit,
    )
    claim = Claim(
        split=split,
        spread=spread,
        exact=plant.misfit <= _EXACT,
        unknowns=history.states + m_d,
        spare_columns=plant.columns - history.states - m_d,
        tolerance=_ROUNDING,
        hardly=SIGMAS * plant.doubt,
    )
    mean, reach = _spread(split.seen)
    try:
        made = _exact(history, options, plant)
        if made.observer is not None or options.goal is Goal.EXACT:
            own = np.concatenate([norm.d, np.ones(attacks)])
            found = _finished(nothing, made, norm, own, np.zeros(m_d))
            found = _proved(found, claim, None, own)
            if found.observer is not None or options.goal is Goal.EXACT:
                return found
        own = np.concatenate([reach, np.full(attacks, options.attack_bound)])
        made = _bounded(history, options, plant, mean, reach)
    except MonitorError as error:
        raise HistoryError(str(error)) from error
    return _proved(_finished(nothing, made, norm, own, mean), claim, mean, own)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plant:
    """x+ = A x + E d, y = C x + G d in the units in which norms are taken."""

    A: NDArray[np.float64]
    E: NDArray[np.float64]
    C: NDArray[np.float64]
    G: NDArray[np.float64]
    norm: Scaling
    units: Units
    misfit: float
    doubt: float
    columns: int


def _identify(seen: History, into: Scaling, norm: Scaling) -> _Plant:
    """Regress the states; `into` brings what is seen into shares of the spread.

    Raises:
        HistoryError: the history does not determine A, E and C, or inputs act alike.
    """
    n, m_d = seen.states, seen.experiments[0].d.shape[1]
    C, G = identify_direct(seen)
    names = [*(f"x[{row}]" for row in range(n)), *(f"d[{row}]" for row in range(m_d))]
    fit = regress_states(seen, [(one.d,) for one in seen.experiments], names)
    A, E = fit.Theta[:, :n], fit.Theta[:, n:]
    check_acting(np.vstack([E / into.x[:, None], G / into.y[:, None]]) * into.d)
    tolerance = max(_RANK, min(_NOISE_SAFETY * fit.misfit, _COARSE))
    units = Units(x=norm.x, y=norm.y, tolerance=tolerance)
    return _Plant(A=A, E=E, C=C, G=G, norm=norm, units=units, misfit=fit.misfit, doubt=fit.doubt, columns=fit.columns)


def _exact(history: History, options: KnownInputOptions, plant: _Plant) -> DelayedDesign:
    """Cancel d itself: no operating point enters."""
    if options.goal is Goal.BOUNDED:
        return refuse(KIND, "a bounded design is asked for")
    chosen = replace(options, goal=Goal.EXACT)
    model = with_attacks(model_of(plant.A, plant.E, plant.C, plant.G), options.attacked, 1.0 / plant.norm.y)
    unit = "an input of norm 1"
    return design_for(KIND, model, chosen, history.sampling_period_sec, unit=unit, units=plant.units)


def _bounded(
    history: History,
    options: KnownInputOptions,
    plant: _Plant,
    mean: NDArray[np.float64],
    reach: NDArray[np.float64],
) -> DelayedDesign:
    """Bound what the deviations of d from its mean in the history do."""
    around = _around(plant, mean / plant.norm.d, reach / plant.norm.d)
    model = with_attacks(around, options.attacked, options.attack_bound / plant.norm.y)
    unit = f"d - mean of the size it had in the history ({', '.join(f'{one:.3g}' for one in reach)})"
    return design_for(
        KIND,
        model,
        replace(options, goal=Goal.BOUNDED),
        history.sampling_period_sec,
        unit=unit,
        constant=True,
        units=plant.units,
    )


def _proved(
    found: KnownInputDesign, claim: Claim, mean: NDArray[np.float64] | None, own: NDArray[np.float64]
) -> KnownInputDesign:
    """Hold the reconstructed inputs against those recorded in unseen samples; mean: of a bounded design."""
    if found.observer is None or found.design.guarantee is None:
        return found
    proof = prove_inputs(found.observer, found.design.guarantee, claim, None if mean is None else (mean, own))
    if proof.holds:
        return replace(found, proof=proof)
    return replace(found, design=refuse(KIND, proof.refusal()), observer=None, proof=proof)


def _spread(history: History) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean of d, and how much of each input makes |w| = 1 the largest deviation of the history."""
    d = np.vstack([one.d for one in history.experiments])
    d = d[np.isfinite(d).all(axis=1)]
    mean = d.mean(axis=0)
    each = np.max(np.abs(d - mean), axis=0)
    return mean, each * float(np.max(np.linalg.norm((d - mean) / each, axis=1)))


def _around(plant: _Plant, mean: NDArray[np.float64], reach: NDArray[np.float64]) -> Model:
    """x+ = A x + E reach w + E mean 1, y = C x + G reach w + G mean 1."""
    return Model(
        A=plant.A,
        B=plant.E * reach,
        C=plant.C,
        D=plant.G * reach,
        B_u=(plant.E @ mean)[:, None],
        D_u=(plant.G @ mean)[:, None],
    )


def _finished(
    nothing: KnownInputDesign,
    made: DelayedDesign,
    norm: Scaling,
    reach: NDArray[np.float64],
    mean: NDArray[np.float64],
) -> KnownInputDesign:
    """Turn w of the design into d and phi, everything in the user's units: [d; phi] = reach w + [mean; 0]."""
    if made.observer is None:
        return replace(nothing, design=made)
    made = in_units(made, norm)
    found, gain = made.input_observer, made.input_noise_gain
    assert found is not None  # noqa: S101 - an accepted design has both
    assert gain is not None  # noqa: S101 - an accepted design has both
    inner = linear_part(found)
    M, D = reach[:, None] * inner.M, reach[:, None] * inner.D
    if isinstance(found, ConstantInput):
        D[: len(mean), 0] += mean  # the first known input is the constant 1
    scaled = replace(inner, M=M, D=D)
    return replace(
        nothing,
        design=made,
        observer=ConstantInput(scaled) if isinstance(found, ConstantInput) else scaled,
        noise_gain=gain * np.outer(reach, reach),
        reach=reach,
    )
