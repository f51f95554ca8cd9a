"""What if: a future that is foreseen is the one that comes, bit for bit."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from bags.runs.reader import read_run
from bags.watch.designs import design_scenario
from dcmg.page.foresight import Foresight, futures
from dcmg.page.messages import Attack, WhatIf
from dcmg.page.recorded import Recorded
from dcmg.page.simulated import Simulated
from dcmg.page.source import RefusalError
from dgu_sim.grid import Link

if TYPE_CHECKING:
    from collections.abc import Callable

    from dgu_sim.scenario import Scenario

BIAS = {"bias": "0.1 0.1 0.1"}
GOLDEN = Path(str(files("bags.golden")))


@pytest.fixture(name="source")
def _source(shipped: Callable[..., Scenario]) -> Simulated:
    scenario = shipped("gallo_six_dgu", "attacks=[]")
    source = Simulated(scenario, design_scenario(scenario), None)
    source.advance(300)
    return source


def test_what_is_foreseen_comes(source: Simulated) -> None:
    """Attacked as was asked, the run goes on exactly as foreseen; asking has changed nothing."""
    parameters = {"bias": [0.1, 0.1, 0.1]}
    found = futures(source.fork(), [((Link(1, 2),), "bias", parameters)], 200)
    calm = source.fork().advance(200)
    assert np.array_equal(found.calm.block.x, calm.block.x)
    source.attack(Attack(id=1, action="start", links=["1-2"], attack="bias", parameters=BIAS))
    source.advance(200)
    trace, channels = source.board.trace, source.board.channels
    assert np.array_equal(trace.span(channels.dgu("voltage"), 300, 500).T, found.attacked.block.y[:, 0, :, 0])
    assert np.array_equal(trace.span(channels.link("alarm"), 300, 500).T, found.attacked.links.alarm)


def test_it_is_told_in_words_and_bands(source: Simulated) -> None:
    """Damage, the first alarm, and bands of which each holds both futures at every step."""
    foresight = Foresight(source.fork)
    told = foresight.ask(foresight.fork(), WhatIf(id=4, links=["1-2"], attack="bias", parameters=BIAS, horizon_sec=3.0))
    assert (told.id, told.first_step, told.steps, told.bin_steps) == (4, 300, 300, 2)
    assert "alarm on 1 → 2 after 0 s" in told.lines
    band = next(one for one in told.bands if one.panel == "voltage")
    low, high = np.array(band.low, dtype=float), np.array(band.high, dtype=float)
    found = futures(source.fork(), [((Link(1, 2),), "bias", {"bias": [0.1, 0.1, 0.1]})], 300)
    for future in (found.calm, found.attacked):
        voltage = future.block.y[:, 0, :, 0].T.reshape(6, 150, 2)
        assert (voltage >= low[..., None]).all()
        assert (voltage <= high[..., None]).all()
    assert np.abs(high - low).max() > 1e-3


def test_the_worst_is_large_and_unseen(source: Simulated) -> None:
    """The largest-damage programme from here: the mean voltage moves, no monitor of a link says anything."""
    foresight = Foresight(source.fork)
    told = foresight.ask(foresight.fork(), WhatIf(id=1, worst=True, links=["1-2"], horizon_sec=4.0))
    (mean,) = [float(one.split("most ")[1].split()[0]) for one in told.lines if one.startswith("mean voltage")]
    assert abs(mean) > 0.05
    assert not [one for one in told.lines if one.startswith("alarm")]
    assert any(one.startswith("no alarm at all on 2 → 1") for one in told.lines)


def test_a_recorded_moment_goes_on_as_the_bag_did() -> None:
    """The fork of any moment of a bag, forward or back, gives the bag's own next steps; an attack makes others."""
    record = read_run(GOLDEN / "biased")
    source = Recorded(GOLDEN / "biased")
    for step in (90, 150, 30):
        source.seek(step)
        run = source.fork()
        assert run.state.step == step
        assert np.array_equal(run.advance(40).block.y[:, 0], record.y[step : step + 40])
        attacks = [((Link(2, 1),), "freeze", {"anyway": True})]
        found = futures(source.fork(), attacks, 40)
        assert not np.array_equal(found.attacked.block.received, found.calm.block.received)
    source.close()


def test_a_question_that_cannot_be_is_refused(source: Simulated) -> None:
    """A wrong parameter or link is one line, as when one starts the attack."""
    foresight = Foresight(source.fork)
    for links, parameters in ((["1-5"], BIAS), (["1-2"], {"bias": "1"})):
        with pytest.raises(RefusalError):
            foresight.ask(foresight.fork(), WhatIf(id=1, links=links, attack="bias", parameters=parameters))
