"""Monitors of many links in compiled kernels: the bits of `LinkMonitor.step`, many times faster.

The kernels know linear observers of every kind and order, missing samples and restarts included, and the fixed
detector; another detector steps in numpy on the residuals that they leave.
"""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bags.watch.monitor_blocks import judge
from bags.watch.stacked_observer import StackedObserver
from engine import NUMPY, chosen
from engine.kernels import watch
from monitor.delayed import ConstantInput
from monitor.detectors.fixed import FixedDetector, FixedState
from monitor.link_monitor import LinkMonitor, MonitorState

__all__ = ["judges_itself", "knows", "run_compiled"]

_Numbers: TypeAlias = NDArray[np.float64] | None


def knows(monitor: LinkMonitor, inputs: int) -> bool:
    """Whether the kernels can step monitors, given the number of known inputs that travel with the outputs.

    Raises:
        EngineError: The environment asks for kernels that are not there.
    """
    observer = _linear(monitor)
    return (
        chosen() != NUMPY
        and observer is not None
        and monitor.observer is not None
        and (monitor.observer.inputs <= inputs)
    )


def run_compiled(
    monitor: LinkMonitor,
    state: MonitorState,
    positions: NDArray[np.intp],
    samples: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]],
    concluded: tuple[_Numbers, _Numbers, _Numbers, NDArray[np.uint8], NDArray[np.bool_]],
) -> MonitorState:
    """Take the samples of consecutive steps, and write what is concluded into the rows of all links.

    Args:
        monitor: What `knows` said yes to, stepped with arrays over its links.
        state: Its state.
        positions: Its links, shape (group,).
        samples: Known inputs (steps, links, m), outputs (steps, links, p) and whether they arrived (steps, links).
        concluded: Estimate (steps, links, n), residual and threshold (steps, links, p), phase and alarm (steps, links).
            Numbers that are None are not wanted, which only a monitor that `judges_itself` can do without.
    """
    observer, given = _linear(monitor), monitor.observer
    assert observer is not None  # noqa: S101 - `knows` has seen to it
    assert given is not None  # noqa: S101 - idem
    u, y, delivered = samples
    estimate, residual, threshold, phase, alarm = concluded
    group, width, order = len(positions), y.shape[2], observer.start.shape[0]
    period = observer.period or group
    whole_output = width == observer.outputs
    channels = np.arange(observer.outputs) if whole_output or not monitor.channels else np.array(monitor.channels)
    fixed = _fixed(monitor)
    z = _spread(state.observer, order, group)
    learned = None if fixed is None else _arrays(state.detector, group)
    watch(
        chosen(),
        (
            *(*delivered.shape, group, order, observer.states, given.inputs, observer.outputs),
            *(observer.inputs - given.inputs, u.shape[2], width, 0 if estimate is None else estimate.shape[2]),
            *((0, 0) if fixed is None else (fixed.settle_steps, fixed.calibrate_steps)),
            period,
        ),
        (
            positions.astype(np.int64),
            channels.astype(np.int64),
            *(np.ascontiguousarray(one[..., :period]) for one in (observer.whole, observer.start)),
        ),
        (*map(np.ascontiguousarray, (u, y, delivered)), z),
        0.0 if fixed is None else fixed.margin,
        (None,) * 5 if fixed is None or learned is None else (np.array(fixed.levels(observer.outputs)), *learned),
        (estimate, None if monitor.blind else residual, threshold, phase, alarm),
    )
    if monitor.blind:
        return MonitorState(z, state.detector)
    if learned is not None:
        return MonitorState(z, FixedState(*learned))
    assert residual is not None  # noqa: S101 - the caller has seen to it
    assert threshold is not None  # noqa: S101 - idem
    found = np.ascontiguousarray(residual[:, positions][..., channels].swapaxes(1, 2))
    following, verdict = judge(monitor.detector, state.detector, found)
    phase[:, positions], alarm[:, positions] = verdict.phase, verdict.alarm
    threshold[:, positions[:, None], channels] = np.asarray(verdict.threshold).swapaxes(1, 2)
    return MonitorState(z, following)


def judges_itself(monitor: LinkMonitor) -> bool:
    """Whether the kernels come to the verdict, too."""
    return monitor.blind or _fixed(monitor) is not None


def _fixed(monitor: LinkMonitor) -> FixedDetector | None:
    return monitor.detector if type(monitor.detector) is FixedDetector and not monitor.blind else None


def _linear(monitor: LinkMonitor) -> StackedObserver | None:
    inner = monitor.observer.inner if isinstance(monitor.observer, ConstantInput) else monitor.observer
    return inner if isinstance(inner, StackedObserver) else None


def _arrays(state: FixedState, group: int) -> tuple[NDArray[Any], ...]:
    """Copies of what the fixed detector knows, by link."""
    counts = (np.array(np.broadcast_to(one, (group,)), dtype=np.int64) for one in (state.age, state.learned))
    return (*counts, *(_spread(one, len(one), group) for one in (state.peak, state.threshold)))


def _spread(vector: Any, components: int, group: int) -> NDArray[np.float64]:  # noqa: ANN401 - floats or arrays
    """A copy of a vector of components as an array (components, group)."""
    each = [np.broadcast_to(np.asarray(one, dtype=np.float64), (group,)) for one in vector]
    return np.array(each).reshape(components, group)
