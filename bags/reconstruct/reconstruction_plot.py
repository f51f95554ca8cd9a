"""Picture of a reconstruction: inputs against what was applied, and the attack under each hypothesis."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bags.reconstruct.reconstruction import INPUT_UNITS, INPUTS, OUTPUT_UNITS, OUTPUTS, Reconstruction

_ESTIMATE, _TRUTH, _ALERT, _MUTED = "#0072B2", "#222222", "#D55E00", "#777777"
_DPI = 100


def draw_reconstruction(found: Reconstruction, folder: Path | str) -> Path:
    """Draw into `reconstruction_<link>.png`.

    Args:
        found: What to draw.
        folder: Where to; made if it does not exist.

    Returns:
        The file.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    rows = max(found.inputs.shape[1], len(found.hypotheses))
    figure = Figure(figsize=(11.0, 2.4 * rows + 0.8), layout="constrained")
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False)
    for row in range(rows):
        left, right = panels[row]
        if row < found.inputs.shape[1]:
            _input_panel(left, found, row)
        else:
            left.set_visible(False)
        if row < len(found.hypotheses):
            _attack_panel(right, found, row)
        else:
            right.set_visible(False)
    figure.suptitle(f"link {found.link}: reconstructed by {found.estimator}", fontsize=10)
    figure.supxlabel("simulated time [s]", fontsize=9)
    path = folder / f"reconstruction_{found.link}.png"
    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=_DPI)
    return path


def _input_panel(axes: Axes, found: Reconstruction, row: int) -> None:
    """One input: what was applied, what was reconstructed, and its band."""
    axes.plot(found.time_sec, found.applied[:, row], color=_TRUTH, linewidth=1.6, label="applied (simulator)")
    axes.plot(found.time_sec, found.inputs[:, row], color=_ESTIMATE, linewidth=0.9, label="reconstructed")
    _band(axes, found.time_sec, found.inputs[:, row], float(found.input_uncertainty[row]))
    axes.set_ylabel(f"{INPUTS[row]} [{INPUT_UNITS[row]}]")
    settled = slice(found.spans.calm[0], None)
    _scale(axes, np.concatenate([found.applied[settled, row], found.inputs[settled, row]]))
    _mark(axes, found)


def _attack_panel(axes: Axes, found: Reconstruction, row: int) -> None:
    """One output, as if it alone were falsified."""
    hypothesis, channel = found.hypotheses[row], found.channels[found.hypotheses[row].channel]
    name, unit = OUTPUTS[channel], OUTPUT_UNITS[channel]
    axes.set_title(f"if {name} alone were falsified", fontsize=9)
    axes.set_ylabel(f"added to {name} [{unit}]")
    axes.plot(found.time_sec, found.falsified[:, channel], color=_TRUTH, linewidth=1.6, label="added (simulator)")
    if np.isfinite(hypothesis.attack).any():
        axes.plot(found.time_sec, hypothesis.attack, color=_ESTIMATE, linewidth=0.9, label="reconstructed")
        _band(axes, found.time_sec, hypothesis.attack, hypothesis.uncertainty)
        _scale(axes, np.concatenate([found.falsified[:, channel], hypothesis.attack])[found.spans.calm[0] :])
    else:
        axes.text(0.5, 0.5, "cannot be told from the inputs", transform=axes.transAxes, ha="center", color=_MUTED)
    _mark(axes, found)


def _band(axes: Axes, time_sec: NDArray[np.float64], values: NDArray[np.float64], width: float) -> None:
    if np.isfinite(width):
        axes.fill_between(time_sec, values - width, values + width, color=_ESTIMATE, alpha=0.2, linewidth=0.0)


def _scale(axes: Axes, values: NDArray[np.float64]) -> None:
    """Leave the first errors of the start out of the picture."""
    known = values[np.isfinite(values)]
    if known.size:
        low, high = float(known.min()), float(known.max())
        margin = 0.1 * max(high - low, 1e-3)
        axes.set_ylim(low - margin, high + margin)


def _mark(axes: Axes, found: Reconstruction) -> None:
    start, stop = found.spans.attack
    if start < stop:
        end = found.time_sec[min(stop, len(found.time_sec)) - 1]
        axes.axvspan(float(found.time_sec[start]), float(end), color=_ALERT, alpha=0.1, linewidth=0.0)
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.legend(fontsize=7, loc="upper left")
