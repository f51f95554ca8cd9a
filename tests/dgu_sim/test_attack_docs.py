"""docs/attacks.md: its table is measured, its worked example is executed."""

import re
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bags.watch.monitors import link_monitors
from dgu_sim import settings as settings_module
from dgu_sim.attacks import KINDS, Attack
from dgu_sim.attacks import registry as registry_module
from dgu_sim.scenario import Scenario
from dgu_sim.simulate import simulate

EXAMPLES = {
    "bias": "link: 1-2, bias: [0.1, 0.1, 0.1]",
    "bias_ramp": "link: 1-2, rate: [0, 0.1, 0]",
    "bias_sine": "link: 1-2, amplitude: [0, 0.5, 0], period_sec: 1",
    "bias_pulse": "link: 1-2, bias: [0, 0.5, 0], period_sec: 1, width_sec: 0.1",
    "bias_random": "link: 1-2, spread: [0.1, 0.1, 0.1]",
    "bias_waveform": "link: 1-2, time_sec: [0, 1, 2], current_a: [0, 0.5, 0]",
    "scaling": "link: 1-2, gain: [1, 1.05, 1]",
    "freeze": "link: 1-2",
    "delay": "link: 1-2, samples: 10",
    "drop": "link: 1-2, probability: 0.5",
    "replay": "link: 1-2, record_sec: 0.5",
    "zero_sum": "links: [1-2, 5-4], shares: [0.5, -0.5]",
    "uio_stealthy_plane": "link: 1-2, current_a: 0.5",
    "uio_stealthy_trajectory": "link: 1-2, current_a: 0.5",
    "luenberger_stealthy": "links: [2-4, 3-4], voltage_v: 0.1",
    "covert": "link: 1-2, load_a: 2",
    "spoof": "link: 1-2, falsify: {kind: bias, bias: [0.1, 0.1, 0.1]}",
}


@pytest.fixture(name="page", scope="module")
def _page(root: Path) -> str:
    return (root / "docs" / "attacks.md").read_text(encoding="utf-8")


def test_table_names_every_attack_with_what_it_knows(page: str) -> None:
    """A row for each class; the knowledge is the one the class states."""
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", page, flags=re.MULTILINE))
    assert rows == {kind: attack.knows for kind, attack in KINDS.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_who_sees_it_is_measured(page: str, shipped: Callable[..., Scenario], kind: str) -> None:
    """Alarm or none on the attacked links within five seconds, and never a false one before."""
    (said,) = re.findall(rf"^\| `{kind}` \|.*\| (seen|unseen) \|$", page, flags=re.MULTILINE)
    attack = f"attacks=[{{kind: {kind}, start_sec: 3, {EXAMPLES[kind]}}}]"
    scenario = shipped("gallo_six_dgu", "duration_sec=8", attack)
    monitors = link_monitors(scenario)
    (block,) = simulate(scenario, block_steps=scenario.steps)
    _, outputs = monitors.run(monitors.init(), block.received[:, 0], block.delivered[:, 0])
    assert not outputs.alarm[:300].any()
    assert outputs.alarm[300:].any() == (said == "seen")


def test_worked_example_is_one_file_and_one_line(
    page: str, shipped: Callable[..., Scenario], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file and the line of the page make an attack that a scenario can use."""
    file, line = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    (example,) = re.findall(r"```yaml\n(.*?)```", page, flags=re.DOTALL)
    module = types.ModuleType("sign_flip")
    exec(compile(file, "sign_flip.py", "exec"), module.__dict__)  # noqa: S102 - the page's own code
    added: dict[str, type[Attack]] = eval(f"{{{line}}}", module.__dict__)  # noqa: S307 - idem
    for place in (registry_module, settings_module):
        monkeypatch.setattr(place, "KINDS", {**KINDS, **added})
    scenario = shipped("gallo_six_dgu", "duration_sec=4", f"attacks=[{example.strip().removeprefix('- ')}]")
    (block,) = simulate(scenario)
    link = next(p for p, one in enumerate(scenario.links) if str(one) == "1-2")
    sent, received = block.y[:, 0, 0, 1], block.received[:, 0, link, 1]
    assert np.array_equal(received[:300], sent[:300])
    assert np.array_equal(received[300:], -sent[300:])
