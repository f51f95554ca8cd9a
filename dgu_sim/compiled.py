"""The step of all DGUs of many runs in compiled kernels: the bits of `Cell`, many times faster.

The kernels know every plant and the secondary control, and are given the drawn loads and noise. They take many steps at
a call as long as nobody touches a link; where somebody does, they take half a step, leave the links to others, and take
the other half.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dgu_sim.cell import Cell, UnitState
from dgu_sim.linear import FloatArray, Vector
from dgu_sim.plant import HeldPlant, IsolatedPlant, JointPlant
from dgu_sim.secondary import Consensus
from dgu_sim.signals import BLOCK
from dgu_sim.transition import GridTransition, Transition
from engine import NUMPY, chosen
from engine.kernels import advance

__all__ = ["CompiledCell", "CompiledRows", "compiled_cell"]

_SAY, _PASS, _MOVE = 1, 2, 4  # parts of a step, as in engine/native/kernels.h


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledCell:
    """A `Cell` of all DGUs as the kernels take it.

    Attributes:
        engine: Which kernels.
        sizes: Numbers of runs, DGUs, links, slots of felt DGUs, slots of incoming links.
        step_gain: T_s k_I of secondary control.
        constants: Coefficients by DGU and who hears whom, in the order of engine/native/module.c.
        cell: The cell itself, which draws the signals.
    """

    engine: str
    sizes: tuple[int, int, int, int, int]
    step_gain: float
    constants: tuple[NDArray[np.generic] | None, ...]
    cell: Cell

    def rows(self, state: UnitState, steps: int) -> "CompiledRows":
        """Begin a block of steps."""
        runs, dgus, links, _, _ = self.sizes
        return CompiledRows(
            compiled=self,
            state=state,
            x=np.empty((steps, runs, dgus, 3)),
            y=np.empty((steps, runs, dgus, 3)),
            load_current=np.empty((steps, runs, dgus)),
            reference=np.empty((steps, runs, dgus)),
            alpha=np.empty((steps, runs, dgus)),
            received=np.empty((steps, runs, links, 3)),
            delivered=np.ones((steps, runs, links), dtype=np.bool_),
        )


@dataclass(slots=True, kw_only=True)
class CompiledRows:
    """Rows of one block while it fills; the arrays are those of `simulate.Block`.

    Attributes:
        compiled: What fills them.
        state: State of all DGUs before the next step.
    """

    compiled: CompiledCell
    state: UnitState
    x: FloatArray
    y: FloatArray
    load_current: FloatArray
    reference: FloatArray
    alpha: FloatArray
    received: FloatArray
    delivered: NDArray[np.bool_]

    def advance(self, row: int, most: int) -> int:
        """Take up to `most` steps in which nobody touches a link, from `row` on; return how many were taken."""
        count = min(most, BLOCK - self.state.step % BLOCK)
        self._run(row, count, _SAY | _PASS | _MOVE, self.delivered[row : row + count])
        return count

    def say(self, row: int) -> None:
        """Fill a row with what happens and is sent at this step."""
        self._run(row, 1, _SAY, self.delivered[row])

    def move(self, row: int, heard: NDArray[np.bool_]) -> None:
        """Go on to the next step.

        Args:
            row: The row, its `received` filled.
            heard: Samples that secondary control takes, shape (runs, links).
        """
        self._run(row, 1, _MOVE, np.ascontiguousarray(heard))

    def _run(self, row: int, count: int, parts: int, heard: NDArray[np.bool_]) -> None:
        compiled, state = self.compiled, self.state
        x = np.array(state.x, dtype=np.float64)  # a copy: the state before stays as it is
        alpha = np.array(state.alpha, dtype=np.float64)
        signals = state.signals
        span = (row, count, state.step - signals.start, parts, len(self.x), len(signals.load))
        load = np.ascontiguousarray(signals.load)
        noise = None if signals.noise is None else np.ascontiguousarray(signals.noise)
        rows = (load, noise, self.x, self.y, self.load_current, self.reference, self.alpha, self.received, heard)
        advance(compiled.engine, compiled.sizes, compiled.step_gain, compiled.constants, span, rows, (x, alpha))
        if parts & _MOVE:
            step = state.step + count
            following = signals if step - signals.start < BLOCK else compiled.cell.exogenous.block(step)
            self.state = UnitState(step=step, x=x, alpha=alpha, signals=following)


def compiled_cell(
    cell: Cell,
    runs: int,
    *,
    sources: NDArray[np.intp],
    physical: NDArray[np.intp],
    incoming: NDArray[np.intp],
    wired: NDArray[np.bool_],
) -> CompiledCell | None:
    """Return a cell of all DGUs as the kernels take it; None where numpy is to step it.

    Args:
        cell: The cell.
        runs: Number of runs.
        sources: Position of the sending DGU of each link, shape (links,).
        physical: Position of the DGU felt in each slot, shape (slots, DGUs).
        incoming: Position of the link heard in each slot, shape (slots, DGUs).
        wired: Whether there is such a link, same shape.

    Raises:
        EngineError: The environment asks for kernels that are not there.
    """
    engine = chosen()
    coefficients = _coefficients(cell)
    if engine == NUMPY or coefficients is None:
        return None
    consensus = cell.consensus
    return CompiledCell(
        engine=engine,
        sizes=(runs, physical.shape[1], len(sources), len(physical), len(incoming)),
        step_gain=0.0 if consensus is None else consensus.step_gain,
        constants=(
            *coefficients,
            _by_dgu([cell.reference]),
            None if cell.hidden is None else _by_dgu(cell.hidden),
            None if consensus is None else _by_dgu([consensus.own_inverse_rating]),
            None if consensus is None else _by_dgu(consensus.inverse_ratings),
            *(np.ascontiguousarray(one, dtype=np.int64) for one in (sources, physical, incoming)),
            np.ascontiguousarray(wired),
        ),
        cell=cell,
    )


def _coefficients(cell: Cell) -> tuple[FloatArray | None, FloatArray | None, FloatArray | None] | None:
    """[A E] of each DGU, conductances and [A_ij E_ij] of the slots; None for what the kernels do not know."""
    plant = cell.plant
    if not isinstance(cell.consensus, Consensus | None):
        return None
    if isinstance(plant, IsolatedPlant):
        return _rows_of(plant.transition), None, None
    if isinstance(plant, HeldPlant):
        return _rows_of(plant.transition), _by_dgu(plant.conductances), None
    if isinstance(plant, JointPlant):
        own = _rows_of(plant.own)
        return own, None, np.array([_rows_of(one) for one in plant.others]).reshape(-1, *own.shape)
    return None


def _rows_of(transition: Transition) -> FloatArray:
    """Coefficients by row and column, shape (3, 5, DGUs)."""
    assert isinstance(transition, GridTransition)  # noqa: S101 - of all DGUs, or there would be no axis of runs
    return np.ascontiguousarray(np.stack([column[:, 0] for column in transition.columns], axis=1))


def _by_dgu(components: Sequence[Vector | float] | Vector) -> FloatArray:
    """Components of shape (1, DGUs) as one array (components, DGUs)."""
    return np.array([np.asarray(one)[0] for one in components]) if len(components) else _NONE


_NONE = np.empty((0, 0))
