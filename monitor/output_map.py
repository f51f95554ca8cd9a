"""How the outputs come about: y = C x + D u + G d, found row by row.

C and D by least squares, any C and any order of sensors (reduced-order UIO paper, below (10): D = G = 0). What is
left of a row is rounding, noise of that sensor, or an unknown input that acts on it directly. The last is told by
looking at the next state: an unknown input that moves the state as well leaves nothing of that row once X_f is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from monitor.errors import HistoryError
from monitor.rank import project

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from monitor.history import DataMatrices

_ROUNDED = 1e2  # a misfit below this many times what double precision leaves is rounding
_NOISY = 0.5  # half of what moves in an output is explained by nothing
_DRIVEN = 0.1  # less than a tenth of the misfit is left once the next state is known: an unknown input made it
_ALIKE = 1e-9  # relative: signals that are combinations of one another but for rounding
_SPARE = 4  # columns beyond the directions that this question needs, at least
_NEGLIGIBLE = 3.0  # standard errors: a coefficient below may be zero


class Misfit(Enum):
    """What is left of an output once C x + D u is taken away."""

    NOTHING = "nothing"
    NOISE = "noise"
    UNKNOWN_INPUT = "unknown input"


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputMap:
    """y = C x + D u + what is left.

    Attributes:
        C: (p, n).
        D: (p, m).
        misfit: (p,) root mean square of what is left, shares of the spread of each output.
        kinds: what it is, one an output.
    """

    C: NDArray[np.float64]
    D: NDArray[np.float64]
    misfit: NDArray[np.float64]
    kinds: tuple[Misfit, ...]

    @property
    def driven(self) -> NDArray[np.bool_]:
        """(p,) outputs that unknown inputs reach directly."""
        return np.array([kind is Misfit.UNKNOWN_INPUT for kind in self.kinds])

    def rest(self, data: DataMatrices) -> NDArray[np.float64] | None:
        """(q, N) what unknown inputs add to the outputs that they reach directly, None when there are none."""
        if not self.driven.any():
            return None
        return np.asarray((data.Y_p - self.C @ data.X_p - self.D @ data.U_p)[self.driven])

    def rest_sizes(self, data: DataMatrices) -> NDArray[np.float64]:
        """(q,) root mean square of the numbers that `rest` is the difference of: its rounding is theirs."""
        parts = np.abs(self.C) @ np.abs(data.X_p) + np.abs(self.D) @ np.abs(data.U_p) + np.abs(data.Y_p)
        return np.asarray(np.sqrt(np.mean(parts[self.driven] ** 2, axis=1)))

    def words(self) -> list[str]:
        """What the outputs hold besides states, a few words each."""
        said = {
            Misfit.NOISE: "y[{}] carries noise of {:.2g} of its spread that x does not have",
            Misfit.UNKNOWN_INPUT: "an unknown input of {1:.2g} of its spread acts on y[{0}] directly",
        }
        found = enumerate(zip(self.kinds, self.misfit, strict=True))
        words = [said[kind].format(row, left) for row, (kind, left) in found if kind is not Misfit.NOTHING]
        fed = [str(row) for row, gains in enumerate(self.D) if gains.any()]
        return words + ([f"known inputs act on y[{', '.join(fed)}] directly"] if fed else [])

    def error(self, columns: int) -> float:
        """How wrong C may be for the noise of the outputs, in shares of their spread."""
        noise = [left for left, kind in zip(self.misfit, self.kinds, strict=True) if kind is Misfit.NOISE]
        return float(max(noise, default=0.0) * np.sqrt(self.C.shape[1] / columns))


def identify_output_map(data: DataMatrices) -> OutputMap:
    """Find C, D and what is left, each row by itself.

    Raises:
        HistoryError: an output is no function of states, known inputs and unknown inputs that the history shows.
    """
    known = np.vstack([np.hstack([data.X_p, data.X_f]), np.hstack([data.U_p, data.U_f])])
    Y = np.hstack([data.Y_p, data.Y_f])
    spread, sizes = _spread(known), _spread(Y)
    scaled = known / spread[:, None]
    rows = [_row(y / size, scaled, size / spread) for y, size in zip(Y, sizes, strict=True)]
    CD = np.array([coefficients for coefficients, _ in rows]).reshape(len(Y), len(known))
    n = len(data.X_p)
    misfit = np.array([left for _, left in rows])
    moved = np.abs(CD) @ np.max(np.abs(known), axis=1) + np.max(np.abs(Y), axis=1)
    rounding = _ROUNDED * np.finfo(float).eps * moved / sizes
    kinds = tuple(_kinds(data, Y - CD @ known, sizes, misfit > rounding))
    for row, (kind, left) in enumerate(zip(kinds, misfit, strict=True)):
        if kind is Misfit.NOISE and left > _NOISY:
            raise HistoryError(
                f"y[{row}] = C x + D u leaves {left:.0%} of its spread unexplained, by unknown inputs too: "
                "record y and x at the same instants, rows and columns alike"
            )
    return OutputMap(C=CD[:, :n], D=CD[:, n:], misfit=misfit, kinds=kinds)


def _row(
    y: NDArray[np.float64], known: NDArray[np.float64], units: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Coefficients of one output on [x; u] and the misfit, y and known in shares of their spread.

    The plainest coefficients that the data do not contradict are taken: whole numbers in the units at hand (sensors
    that copy states), else those that differ from zero. `units` turns a coefficient into the units at hand.
    """
    count = len(y)
    fitted = np.linalg.lstsq(known.T, y, rcond=None)[0]
    level = float(np.linalg.norm(y - fitted @ known) / np.sqrt(count))
    rounding = float(
        _ROUNDED * np.finfo(float).eps * (np.abs(fitted) @ np.max(np.abs(known), axis=1) + np.max(np.abs(y)))
    )
    slack = level * (1.0 + np.sqrt(len(known) / count)) + rounding  # what the fit gains from noise alone
    uncertain = level * np.sqrt(np.diag(np.linalg.pinv(known @ known.T)))
    plain = np.where(np.abs(fitted) <= np.maximum(_NEGLIGIBLE * uncertain, rounding), 0.0, fitted)
    for candidate in (np.round(fitted * units) / units, plain):
        left = float(np.linalg.norm(y - candidate @ known) / np.sqrt(count))
        if left <= slack:
            return candidate * units, left
    return fitted * units, level


def _kinds(
    data: DataMatrices, left: NDArray[np.float64], spread: NDArray[np.float64], something: NDArray[np.bool_]
) -> list[Misfit]:
    """Tell rounding from noise from an unknown input that acts on the output and on the state.

    Args:
        data: the history.
        left: (p, 2N) what is left of [Y_p, Y_f].
        spread: (p,) of the outputs.
        something: (p,) whether more than rounding is left.
    """
    regressors = np.vstack([data.U_p, data.X_p, data.U_f])
    free = data.columns - len(regressors)
    kinds = [Misfit.NOISE if found else Misfit.NOTHING for found in something]
    if not something.any():
        return kinds
    states = project(regressors, data.X_f / _spread(data.X_f)[:, None], 0.0)
    _, values, directions = np.linalg.svd(states.rest, full_matrices=False)
    moved = directions[values > _ROUNDED * states.rounding * np.sqrt(data.columns)]
    if free - len(moved) < _SPARE:
        raise HistoryError(
            f"y[{int(np.argmax(something))}] is no function of x and u alone, and with {data.columns} pairs of "
            "consecutive samples its noise cannot be told from an unknown input that acts on it: "
            f"record {_SPARE + len(moved) - free} more"
        )
    rest = project(regressors, left[:, : data.columns] / spread[:, None], 0.0)
    unexplained = rest.rest - (rest.rest @ moved.T) @ moved
    for row in np.flatnonzero(something):
        before, after = (float(np.linalg.norm(rows[row])) for rows in (rest.rest, unexplained))
        if after * np.sqrt(free / (free - len(moved))) <= _DRIVEN * before:
            kinds[row] = Misfit.UNKNOWN_INPUT
    noisy = np.array([kind is Misfit.NOISE for kind in kinds])
    spare = free - len(moved) - np.count_nonzero(noisy)
    if len(moved) < len(states.rest) and spare >= _SPARE and _dependent(unexplained[noisy]):
        return [Misfit.UNKNOWN_INPUT if kind is Misfit.NOISE else kind for kind in kinds]
    return kinds


def _dependent(rest: NDArray[np.float64]) -> bool:
    """Whether fewer signals than outputs make up what is left of exact data: sensors' noise is never that much alike.

    Unknown inputs that reach outputs and no state are found so.
    """
    values = np.linalg.svd(rest, compute_uv=False)
    return len(values) > 1 and bool(values[-1] <= _ALIKE * values[0])


def _spread(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) standard deviations, 1 for a row that never moves."""
    spread = np.std(rows, axis=1)
    return np.where(spread > 0.0, spread, 1.0)
