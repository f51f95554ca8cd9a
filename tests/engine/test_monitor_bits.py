"""Monitors in kernels: the bits of `LinkMonitor.step`, whatever is missing, overflows, or restarts."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bags.watch.monitors import link_monitors
from bags.watch.scenarios import parse_scenario
from dcmg.shipped import scenario_path
from engine import NUMPY, VARIABLE, available

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bags.watch.monitors import RunMonitors

KERNELS = [engine for engine in available() if engine != NUMPY]
GALLO = scenario_path("gallo_six_dgu").read_text(encoding="utf-8")
STEPS = 90

MONITORS = {
    "full order": "{}",
    "some outputs": "{}",
    "no calibration": """{detector: {kind: fixed,
        options: {settle_sec: 0.02, calibrate_sec: 0.0, floor: [1.0, 0.1, 2.0]}}}""",
    "reduced": """{observer: {kind: reduced_order},
        detector: {kind: fixed, options: {settle_sec: 0.0, calibrate_sec: 0.2}}}""",
    "delayed": "{observer: {kind: delayed}, detector: {kind: cusum, options: {settle_sec: 0.05, calibrate_sec: 0.2}}}",
    "calibrated": "{detector: {kind: calibrated, options: {settle_sec: 0.05, calibrate_sec: 0.4, rate: 0.1}}}",
    "n of m": """{detector: {kind: n_of_m,
        options: {n: 2, m: 3, kind: fixed, options: {settle_sec: 0.1, calibrate_sec: 0.1}}}}""",
}


@cache
def _monitors(name: str, runs: int) -> RunMonitors:
    sent = "[V, v]" if name == "some outputs" else "[V, I_t, v]"
    changes = [f"monitor={MONITORS[name]}", f"dgus.2.output={sent}", "attacks=[]"]
    return link_monitors(parse_scenario(GALLO, overrides=changes), runs)


def _samples(seed: int, runs: int, sent: RunMonitors) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """What links might carry: noise around an operating point, lost samples, hidden, infinite and huge numbers."""
    draw = np.random.default_rng(seed)
    links = len(sent.designs) // runs
    received = draw.normal(48.0, 1.0, (STEPS, runs, links, 3))
    for strange, share in ((np.inf, 0.001), (1e308, 0.002), (np.nan, 0.001)):
        received[draw.random(received.shape) < share] = strange
    for link, design in enumerate(sent.designs[:links]):
        hidden = [channel for channel in range(3) if design.channels is not None and channel not in design.channels]
        received[:, :, link, hidden] = np.nan
    return received, draw.random((STEPS, runs, links)) < 0.99


def _concluded(engine: str, monitors: RunMonitors, seed: int, runs: int, length: int) -> list[bytes]:
    received, delivered = _samples(seed, runs, monitors)
    found = []
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        patch.setenv(VARIABLE, engine)
        states = alone = monitors.init()
        for first in range(0, STEPS, length):
            part = slice(first, first + length)
            alone, phase, alarm = monitors.verdicts(alone, received[part], delivered[part])
            found += [phase.tobytes(), alarm.tobytes()]
            states, said = monitors.run(states, received[part], delivered[part])
            numbers = (said.estimate, said.residual, said.threshold)
            found += [
                said.phase.tobytes(),
                said.alarm.tobytes(),
                *(
                    np.where(np.isnan(one), np.nan, one).tobytes()  # any NaN is one NaN
                    for one in numbers
                ),
            ]
    return found


@pytest.mark.skipif(not KERNELS, reason="no kernels were compiled")
@pytest.mark.parametrize("name", MONITORS)
@settings(max_examples=6)
@given(seed=st.integers(0, 10_000), runs=st.sampled_from((1, 3)), length=st.integers(1, STEPS))
def test_every_engine_concludes_the_bits_of_numpy(name: str, seed: int, runs: int, length: int) -> None:
    """Observers and detectors of every kind, in blocks of any length."""
    monitors = _monitors(name, runs)
    wanted = _concluded(NUMPY, monitors, seed, runs, length)
    for engine in KERNELS:
        assert _concluded(engine, monitors, seed, runs, length) == wanted, engine
