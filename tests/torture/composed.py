"""A short run in one process, from its start to its end, again and again: a hang shows where everybody stands."""

from __future__ import annotations

import multiprocessing
import os
import random
import time
import traceback
from typing import TYPE_CHECKING

from bags.runs.reader import read_run
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dcmg_bringup.run_job import RunOptions, run_job
from tests.torture.outcome import Outcome
from tests.torture.scene import Scene, stacks

if TYPE_CHECKING:
    from pathlib import Path

    from dgu_sim.scenario import Scenario

_ENDED_SEC = 60.0
_MOST_STEPS = 40
_FAILED, _RAISED = 1, 2
_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(["dcmg_bringup.run_job", __name__])
_CHANGES = (
    "attacks=[]",
    "monitor.detector.options.settle_sec=0.0",
    "monitor.detector.options.calibrate_sec=0.0",
)


class _Mute:
    """Shows nothing."""

    def steps(self, complete: int) -> None:
        """Nothing."""

    def alarm(self, line: str) -> None:
        """Nothing."""

    def say(self, line: str) -> None:
        """Nothing."""


def composed(seed: int, folder: Path) -> Outcome:
    """Run it in a child of a process where everything but rclpy is imported, whatever is here."""
    steps = random.Random(seed).randint(1, _MOST_STEPS)  # noqa: S311 - no secret
    scene = Scene(folder / f"composed_{seed}")
    scene.folder.mkdir(parents=True)
    changes = ("name=composed", f"duration_sec={steps / 100.0}", *_CHANGES)
    scenario = load_scenario(scenario_path("gallo_six_dgu"), changes)
    began = time.monotonic()
    child = _SERVER.Process(target=_be_the_command, args=(scenario, scene))
    child.start()
    child.join(_ENDED_SEC)
    broken = []
    if child.exitcode is None:
        broken = [f"not ended after {_ENDED_SEC:g} s", scene.said()[-600:], stacks(scene.processes())]
        child.kill()
        child.join()
    seconds = time.monotonic() - began
    if not broken and child.exitcode:
        broken.append(f"exit code {child.exitcode}: {scene.said()[-600:]}")
    elif not broken:
        found = read_run(scene.folder / "out" / "bag").steps
        broken += [] if found == steps else [f"{found} of {steps} steps"]
        broken += [f"left behind: {one}" for one in scene.left()]
    scene.clear()
    what = f"a composed run of {steps} steps"
    return Outcome(kind="composed", seed=seed, what=what, row="start to end", broken=tuple(broken), seconds=seconds)


def _be_the_command(scenario: Scenario, scene: Scene) -> None:
    """What `dcmg run --composed` does once it has read its arguments; does not return."""
    code = _RAISED
    try:
        home = scene.folder / "home"
        home.mkdir()
        os.environ["HOME"] = str(home)
        os.chdir(scene.folder)
        handle = os.open("said", os.O_WRONLY | os.O_CREAT, 0o600)
        for number in (1, 2):
            os.dup2(handle, number)
        outcome = run_job(scenario, scene.folder / "out", RunOptions(composed=True), _Mute())
        if outcome.failure is not None or outcome.lost:
            os.write(handle, f"{outcome.failure}; {outcome.lost} lost\n".encode())
            code = _FAILED
        else:
            code = 0
    except BaseException:  # noqa: BLE001 - told, and then over
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(code)
