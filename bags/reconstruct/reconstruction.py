"""What was reconstructed on one link of a recorded run: inputs and attack, beside the truth of a simulation.

What the bag knows about the truth (loads, voltages, outputs as sent) is put beside the results and enters none of them.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dgu_sim.grid import Link
from monitor.attack_size import Hypothesis, Spans, Vector

OUTPUTS = ("V", "I_t", "v")
OUTPUT_UNITS = ("V", "A", "V s")
INPUTS = ("I_net + I_L", "V_ref + alpha")
INPUT_UNITS = ("A", "V")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reconstruction:
    """One link's inputs and attack; rows are instants, NaN where nothing is known.

    Attributes:
        link: The link.
        estimator: Name of the input estimator.
        verdict: What its design says.
        time_sec: (steps,) simulated time [s].
        inputs: (steps, 2) reconstructed I_net + I_L [A] and V_ref + alpha [V].
        applied: (steps, 2) what the simulator applied; NaN for recordings of something else.
        input_uncertainty: (2,) two standard deviations of the reconstructed inputs, and the bound of what cannot be
            decoupled; NaN if the noise is not known.
        noise_std: (3,) noise on V, I_t, v that this rests on.
        spans: Calm and attacked steps.
        hypotheses: One for each output that is sent.
        vector: All outputs at once if the inputs stayed calm, None when that cannot be had.
        vector_reason: Why not.
        falsified: (steps, 3) received minus sent [V, A, V s], the truth of the simulator.
        channels: Positions of the outputs that are sent.
    """

    link: Link
    estimator: str
    verdict: str
    time_sec: NDArray[np.float64]
    inputs: NDArray[np.float64]
    applied: NDArray[np.float64]
    input_uncertainty: NDArray[np.float64]
    noise_std: NDArray[np.float64]
    spans: Spans
    hypotheses: tuple[Hypothesis, ...]
    vector: Vector | None
    vector_reason: str
    falsified: NDArray[np.float64]
    channels: tuple[int, ...]

    def truth(self, channel: int) -> float:
        """Mean of what was added to one output over the attack."""
        attacked = self.falsified[slice(*self.spans.attack), channel]
        known = attacked[np.isfinite(attacked)]
        return float(known.mean()) if known.size else float("nan")

    def input_error(self) -> NDArray[np.float64]:
        """(2,) root mean square error of the reconstructed inputs over the calm steps."""
        misfit = (self.inputs - self.applied)[slice(*self.spans.calm)]
        known = misfit[np.isfinite(misfit).all(axis=1)]
        return np.sqrt(np.mean(known**2, axis=0)) if len(known) else np.full(misfit.shape[1], np.nan)

    def document(self) -> dict[str, Any]:
        """The results as a JSON document; NaN becomes null."""
        seconds = [float(self.time_sec[step]) if step < len(self.time_sec) else None for step in self.spans.attack]
        vector = self.vector
        document = {
            "link": str(self.link),
            "estimator": {"kind": self.estimator, "verdict": self.verdict},
            "attack_start_sec": seconds[0],
            "attack_stop_sec": seconds[1],
            "noise_std": self.noise_std.tolist(),
            "input_uncertainty": self.input_uncertainty.tolist(),
            "input_rms_error": self.input_error().tolist(),
            "hypotheses": [
                {
                    "output": OUTPUTS[self.channels[one.channel]],
                    "verdict": one.verdict,
                    "magnitude": one.magnitude,
                    "uncertainty": one.uncertainty,
                    "input_change": one.change.tolist(),
                    "truth": self.truth(self.channels[one.channel]),
                }
                for one in self.hypotheses
            ],
            "vector": None
            if vector is None
            else {
                "magnitude": vector.magnitude.tolist(),
                "uncertainty": vector.uncertainty.tolist(),
                "samples": vector.samples,
                "truth": [self.truth(channel) for channel in self.channels],
            },
            "vector_reason": self.vector_reason,
        }
        return {name: _finite(value) for name, value in document.items()}


def _finite(value: object) -> object:
    """NaN, which JSON does not know, becomes null, however deep."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, list):
        return [_finite(one) for one in value]
    return {name: _finite(one) for name, one in value.items()} if isinstance(value, dict) else value
