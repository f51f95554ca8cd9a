"""A node, the supervisor, a study or one of its workers is hit by a signal at some moment of its life."""

from __future__ import annotations

import itertools
import random
import re
import signal
import time
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import psutil

from bags.mcap.container import open_container
from bags.mcap.errors import BagError
from bags.mcap.repair import repair
from bags.runs.reader import read_run
from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from tests.torture.outcome import Outcome
from tests.torture.readers import refused_by
from tests.torture.scene import Scene, children, nodes, shared_memory, stacks, unowned, wait_until

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

ENDED_SEC = 10.0
_STEPS = 300
_SUPERVISOR = "supervisor"
_INTERRUPTED = 130
_STOP_SEC = 2.0  # how long a stopped supervisor stands still
_SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP, signal.SIGINT)
_KINDS = ("clock", "dgu", "attacker", "monitor", "recorder", _SUPERVISOR)
_RECORDED_BYTES = 100_000  # the recorder has put some steps on the disk
_MOST_LEFT_SEC = 2.0


class Phase(Enum):
    """When in the life of a run."""

    BEGUN = "begun"  # as soon as it has a name
    STARTING = "starting"
    RUNNING = "running"
    ENDING = "ending"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kill:
    """Who is hit, when, by what."""

    victim: str
    phase: Phase
    number: signal.Signals
    delay_sec: float

    def __str__(self) -> str:
        """In words."""
        return f"{self.number.name} to {self.victim}, {self.phase.value} + {self.delay_sec:.2f} s"


def kill_of(seed: int) -> Kill:
    """Case by number: each run of 96 of them holds every kind of victim with every phase and signal, shuffled."""
    every = list(itertools.product(_KINDS, Phase, _SIGNALS))
    around, at = divmod(seed, len(every))
    random.Random(around).shuffle(every)  # noqa: S311 - no secret
    kind, phase, number = every[at]
    rng = random.Random(seed)  # noqa: S311 - no secret
    victim = f"{kind}_{rng.randint(1, 6)}" if kind in {"dgu", "monitor"} else kind
    longest = {Phase.BEGUN: 0.0, Phase.STARTING: 3.0, Phase.RUNNING: 0.5, Phase.ENDING: 1.5}[phase]
    return Kill(victim=victim, phase=phase, number=number, delay_sec=rng.uniform(0.0, longest))


def killed(seed: int, folder: Path) -> Outcome:
    """Do it, and judge what becomes of the run."""
    kill, scene, memory = kill_of(seed), Scene(folder / f"kill_{seed}"), shared_memory()
    scene.folder.mkdir(parents=True)
    scenario = scene.folder / "scenario.yaml"
    length = _STEPS / 100.0 if kill.phase is Phase.ENDING else 600.0
    changes = ("name=tortured", f"duration_sec={length}", "attacks=[]")
    scenario.write_text(load_scenario(scenario_path("gallo_six_dgu"), changes).to_yaml())
    run = scene.start("run", scenario, "--no-plots", "--out", scene.folder / "out")
    try:
        broken, seconds = _hit_and_judge(kill, scene, run)
    finally:
        if run.poll() is None:
            run.kill()
            run.wait()
    wait_until(lambda: not scene.processes(), _MOST_LEFT_SEC)
    left = scene.left() + sorted(unowned(shared_memory() - memory))
    broken += [f"left behind: {one}" for one in left]
    if broken:
        broken.append(f"said: {scene.said()[-600:]!r}")
    scene.clear()
    row = f"{re.sub(r'_[0-9]', '', kill.victim)} | {kill.phase.value}"
    return Outcome(kind="kills", seed=seed, what=str(kill), row=row, broken=tuple(broken), seconds=seconds)


def _hit_and_judge(kill: Kill, scene: Scene, run: subprocess.Popen[str]) -> tuple[list[str], float]:
    victim = _at_the_moment(kill, scene, run)
    if victim is None:
        return [f"the run never came so far: {run.poll()}"] if run.poll() is None or run.returncode else [], float(
            "nan"
        )
    over = run.poll() is not None
    began = time.monotonic()
    try:
        victim.send_signal(kill.number)
    except psutil.Error:
        over = True
    if kill.victim == _SUPERVISOR and kill.number is signal.SIGSTOP:
        time.sleep(_STOP_SEC)
        victim.resume()
        if kill.phase is not Phase.ENDING:
            wait_until(lambda: _recorded(scene) > _RECORDED_BYTES or run.poll() is not None)
            run.send_signal(signal.SIGINT)
        began = time.monotonic()
    if not wait_until(lambda: run.poll() is not None and not scene.processes(), 6 * ENDED_SEC):
        return [f"not ended after {6 * ENDED_SEC:g} s", stacks(scene.processes())], 6 * ENDED_SEC
    seconds = time.monotonic() - began
    broken = [] if seconds < ENDED_SEC else [f"ended after {seconds:.1f} s"]
    broken += _judged_supervisor(kill, run) if kill.victim == _SUPERVISOR else _judged_node(kill, scene, run, over=over)
    if "Traceback" in scene.said():
        broken.append("a traceback")
    return broken + _judged_bag(kill, scene), seconds


def _at_the_moment(kill: Kill, scene: Scene, run: subprocess.Popen[str]) -> psutil.Process | None:
    """Wait until the moment of the case, and return the victim; None: it did not come."""
    early = kill.phase in {Phase.BEGUN, Phase.STARTING}
    if kill.victim == _SUPERVISOR:
        wait_until(lambda: len(children(run)) > 1 or run.poll() is not None)
        victim: psutil.Process | None = psutil.Process(run.pid) if run.poll() is None else None
    else:
        wait_until(lambda: kill.victim in nodes(run) or run.poll() is not None)
        victim = nodes(run).get(kill.victim)
    if not early:
        wait_until(lambda: _recorded(scene) > _RECORDED_BYTES or run.poll() is not None)
    time.sleep(kill.delay_sec)
    return victim


def _recorded(scene: Scene) -> int:
    return sum(path.stat().st_size for path in (scene.folder / "out" / "bag").glob("*.mcap"))


def _judged_node(kill: Kill, scene: Scene, run: subprocess.Popen[str], *, over: bool) -> list[str]:
    steps = _steps(scene)
    if kill.phase is Phase.ENDING and run.returncode == 0 and steps == _STEPS:
        return []  # it had done its work
    if over:
        return [f"the run was over before: exit code {run.returncode}, {steps} steps"]
    how = "stands still" if kill.number is signal.SIGSTOP else "ended"
    expected = f"node {kill.victim} {how} at step {steps} "
    broken = [] if run.returncode == 1 else [f"exit code {run.returncode}, expected 1"]
    return broken if expected in scene.said() else [*broken, f"expected to read {expected!r}"]


def _judged_supervisor(kill: Kill, run: subprocess.Popen[str]) -> list[str]:
    if kill.number is signal.SIGKILL:
        return [] if run.returncode in {-signal.SIGKILL, 0} else [f"exit code {run.returncode}"]
    good = {_INTERRUPTED, 0} if kill.phase is Phase.ENDING else {_INTERRUPTED}
    return [] if run.returncode in good else [f"exit code {run.returncode}, expected one of {sorted(good)}"]


def _steps(scene: Scene) -> int:
    try:
        return read_run(scene.folder / "out" / "bag").steps
    except BagError:
        return 0


def _judged_bag(kill: Kill, scene: Scene) -> list[str]:
    """The bag, if the recorder came so far as to begin one; one that lost its recorder as well is repaired first."""
    bag = scene.folder / "out" / "bag"
    if not any(bag.glob("*.mcap")):
        return [] if kill.phase in {Phase.BEGUN, Phase.STARTING} else ["no bag"]
    try:
        open_container(bag)
    except BagError as error:
        if kill.victim != _SUPERVISOR or kill.number is not signal.SIGKILL:
            return [f"the bag is not closed: {error}"]
        repair(bag, bag.with_name("repaired"))
        bag = bag.with_name("repaired")
    refused = refused_by(bag)
    return [refused] if refused else []
