"""What a design knows about itself: where it comes from, how fast it is, what its residual can and cannot see."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, is_dataclass
from math import isfinite
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.proof import Proof


@dataclass(frozen=True, slots=True, kw_only=True)
class DataReport:
    """What the history showed.

    Attributes:
        states: n.
        known_inputs: m.
        outputs: p.
        experiments: how many experiments.
        columns: N, pairs of consecutive samples used.
        dropped: columns left out because of missing values.
        sampling_period_sec: T_s [s].
        unknown_inputs: m_d, None when the data do not tell.
        rank: 2m + n + m_d, the rank of [U_p; X_p; U_f; X_f], None likewise.
        rank_basis: what the decision rests on.
        rank_confidence: 0 to 1.
        rank_reason: one line.
        exciting: T's assumption 6 as far as data can tell: [U_p; X_p; U_f] has full row rank and m_d is decided.
        excitation: singular values of [U_p; X_p; U_f] per sample, rows scaled to unit root mean square.
        innovation_values: singular values of what is left of X_f, per sample, in shares of the states' spread.
        singular_values: of the regressors [U_p; Y_p; X_p; U_f; Y_f] of T (13).
    """

    states: int
    known_inputs: int
    outputs: int
    experiments: int
    columns: int
    dropped: int
    sampling_period_sec: float
    unknown_inputs: int | None
    rank: int | None
    rank_basis: str
    rank_confidence: float
    rank_reason: str
    exciting: bool
    excitation: NDArray[np.float64]
    innovation_values: NDArray[np.float64]
    singular_values: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicsReport:
    """How the estimation error e+ = A e behaves.

    Attributes:
        strategy: how the free matrix Q was chosen.
        order: q, order of the observer.
        kernel_residual: |X_f - W S| / |X_f| on the recorded data, 0 when T (13) holds exactly.
        eigenvalues: of A_UIO, as pairs (real, imaginary).
        spectral_radius: largest modulus.
        convergence_steps: steps after which every initial error has shrunk to 1 %, None when not Schur.
        convergence_sec: the same in seconds.
    """

    strategy: str
    order: int
    kernel_residual: float
    eigenvalues: NDArray[np.float64]
    spectral_radius: float
    convergence_steps: int | None
    convergence_sec: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualReport:
    """What the residual shows of an additive falsification phi of the received output.

    Attributes:
        blind: no falsification whatever moves the residual.
        residual_rank: independent signals in the residual (normal rank of the map from phi to r).
        stealthy_inputs: p - residual_rank, dimensions per step in which phi can move freely without any residual.
        dc_gain: (p, p) steady residual of a constant bias, r = dc_gain phi.
        invisible_bias: (p, k) orthonormal basis of the constant biases that leave no steady residual.
        peak_gain: (p, p) largest |r_i| ever reached after a unit step in phi_j.
        threshold: (p,) the threshold that `smallest_bias` refers to, units of y.
        smallest_bias: (p,) smallest constant bias on one component alone that crosses the threshold at some step;
            infinite when none does.
        smallest_steady_bias: (p,) the same for a crossing that lasts.
        noise_gain: (p, p) covariance of the residual under white noise of unit covariance on y.
    """

    blind: bool
    residual_rank: int
    stealthy_inputs: int
    dc_gain: NDArray[np.float64]
    invisible_bias: NDArray[np.float64]
    peak_gain: NDArray[np.float64]
    threshold: NDArray[np.float64]
    smallest_bias: NDArray[np.float64]
    smallest_steady_bias: NDArray[np.float64]
    noise_gain: NDArray[np.float64]

    def smallest_bias_at(self, threshold: NDArray[np.float64]) -> NDArray[np.float64]:
        """Smallest constant bias on each component alone that crosses another threshold (p,) at some step."""
        return smallest_crossing(self.peak_gain, threshold)


class MethodReport(Protocol):
    """What only one method knows about its design: frozen data that can also say itself in words."""

    def lines(self) -> list[str]:
        """The report as lines of text for a terminal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guarantee:
    """Bounds on the error in the limit, and how close inputs come to them; all 0 for exact decoupling.

    Attributes:
        delay: delta, samples after the estimated instant's predecessor that are waited for.
        lag: steps by which the state estimate lags the newest output, max(delta - 1, 0).
        exact: the unknown inputs are cancelled altogether.
        decay: spectral radius of the error dynamics: what is left of a first error from one step to the next.
        gained_rank: rank Gamma_delta - rank Gamma_delta-1.
        needed_rank: rank [B; D]; exact decoupling needs the two to be equal.
        a: of C's LMI.
        gamma: sqrt(mu), limsup |H e| <= gamma sup |W_k:k+delta|.
        bound: gamma sqrt(delta + 1), limsup |H e| <= bound sup |w_k|.
        response_bound: sum_l |G_l| of the impulse response, another guaranteed bound on limsup |H e| / sup |w_k|.
        reached: limsup |H e| / sup |w_k| that the worst inputs found do reach.
        input_bound: guaranteed limsup |w^ - w| / sup |w_k| of the input reconstructed delta steps late.
        residual_bound: (p,) guaranteed limsup |r_i| / sup |w_k| without any attack; None unless known.
        certain_bias: (p,) smallest constant bias on one component alone that crosses residual_bound at some step
            whatever unknown inputs with |w_k| <= 1 do, 2 residual_bound_i / peak gain; infinite when none does.
        unit: what |w_k| = 1 means.
        weights: (n,) diagonal of H, in units of 1 / x; None: all 1.
    """

    delay: int
    lag: int
    exact: bool
    decay: float = 0.0
    gained_rank: int = 0
    needed_rank: int = 0
    a: float = 0.5
    gamma: float = 0.0
    bound: float = 0.0
    response_bound: float = 0.0
    reached: float = 0.0
    input_bound: float = 0.0
    residual_bound: NDArray[np.float64] | None = None
    certain_bias: NDArray[np.float64] | None = None
    unit: str = ""
    weights: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """The whole truth about one design; parts that were never reached are None.

    Attributes:
        kind: name of the design method.
        accepted: whether an observer came out.
        verdict: one line in plain words.
        data: what the history showed.
        dynamics: how the error behaves.
        residual: what the residual sees.
        proof: how the design did on samples that it had not seen.
        matrices: the observer's matrices by their symbols, rows of numbers.
        lag: steps by which the estimate lags the newest sample: at step k it is of x_k-lag.
        guarantee: bounds on the error under bounded unknown inputs, for methods that give some.
        method: what only this method knows.
    """

    kind: str
    accepted: bool
    verdict: str
    data: DataReport | None = None
    dynamics: DynamicsReport | None = None
    residual: ResidualReport | None = None
    proof: Proof | None = None
    matrices: dict[str, NDArray[np.float64]] | None = None
    lag: int = 0
    guarantee: Guarantee | None = None
    method: MethodReport | None = None

    def __repr__(self) -> str:
        """One line; the design prints the whole page."""
        return f"<{self.kind} certificate: {self.verdict}>"

    def to_json(self) -> str:
        """One JSON document; infinite numbers become null, complex ones pairs (real, imaginary)."""
        return json.dumps(_plain(self), allow_nan=False)


def smallest_crossing(gain: NDArray[np.float64], threshold: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest bias on each component alone that pushes some residual over its threshold; gain (p, p) is |r_i| / phi_j.

    A gain below 1e-9 is rounding: no bias of a physical size crosses anything through it.
    """
    visible = np.abs(gain) > 1e-9  # noqa: PLR2004 - see the docstring
    needed = np.full(gain.shape, np.inf)
    np.divide(np.broadcast_to(threshold[:, None], gain.shape), np.abs(gain), out=needed, where=visible)
    return np.asarray(needed.min(axis=0, initial=np.inf))


def _plain(value: object) -> object:
    """Turn frozen data into what JSON holds."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.ndarray):
        pairs = np.stack([value.real, value.imag], axis=-1) if np.iscomplexobj(value) else value
        return _plain(pairs.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    return None if isinstance(value, float) and not isfinite(value) else value
