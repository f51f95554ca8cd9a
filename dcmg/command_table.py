"""Every command of `dcmg`: its line in the help, and where it is. A new one is a file and a row here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dcmg.lazy import Command, Group

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["COMMANDS"]

_RUN, _LOOK, _DESIGN, _SHOW = "Run a scenario", "Look at a run", "Observers and data", "What is claimed, measured"


def _here(name: str, does: str, panel: str, attribute: str = "", module: str = "") -> Command:
    """Return the row of a command of this package."""
    file = module or name.replace("-", "_")
    return Command(name=name, does=does, target=f"dcmg.commands.{file}:{attribute or file}", panel=panel)


def _ros(name: str, does: str, panel: str = "Commands", entry: str = "") -> Command:
    """Return the row of a command that `dcmg_bringup` brings."""
    return Command(name=name, does=does, entry=entry or name, panel=panel)


COMMANDS: Sequence[Command | Group] = (
    _here("scenarios", "List the shipped scenarios.", _RUN),
    _ros("run", "Run a scenario over ROS 2: one process per node, recorded to a bag.", _RUN),
    _here("simulate", "Do the same run without ROS: the same numbers bit for bit, the same bag, much faster.", _RUN),
    _here("page", "Sit at the grid in a browser: watch a simulation or a bag, attack it by hand.", _RUN),
    Group(
        name="attack",
        does="Start, stop and list attacks in a running system.",
        panel=_RUN,
        commands=(
            _here(
                "kinds",
                "Say what attacks there are, what one does and wants.",
                "Commands",
                module="attack_kinds",
            ),
            _ros("start", "Start an attack of any kind, from the next sample on.", entry="attack.start"),
            _ros("stop", "Stop all attacks on a link.", entry="attack.stop"),
            _ros("list", "Show the active and scheduled attacks.", entry="attack.list"),
        ),
    ),
    _ros("attach", "Open a shell in which ROS programs find the running system.", _RUN),
    _ros("node", "Start single nodes of a run: what `dcmg run` supervises, by hand, on this or another host.", _RUN),
    _ros("host", "Wait on this machine for `dcmg run --hosts` of another, and run nodes for it.", _RUN),
    _here("study", "Run seeds x attacks x observers x detectors offline, and compare them.", _RUN),
    _here("report", "Measure a run: detection, false alarms, ROC, isolation, impact, with intervals.", _LOOK),
    _here("plot", "Draw a run for a paper: vector graphics, column width, fonts embedded.", _LOOK),
    _here("explain", "Say why there was, or was no, alarm on a link at a moment.", _LOOK),
    _here("compare", "Put runs side by side: each attack's delay, false alarms, and what watched.", _LOOK),
    _here("reproduce", "Run a bag's scenario again and say whether every message is the same, bit for bit.", _LOOK),
    _here(
        "script", "Write what was done to a run by hand as a scenario.", _LOOK, attribute="script", module="reproduce"
    ),
    _here("replay", "Feed recorded data to freshly designed monitors, or publish it into ROS.", _LOOK),
    _ros("player", "Steer a replay that publishes (`dcmg replay --publish`).", _LOOK),
    _here("reconstruct", "Reconstruct load, reference and attack on one link from what was received.", _LOOK),
    _here("avoided", "Simulate a scenario with its response and without, and compare what the attacks did.", _LOOK),
    _here("bag", "Look into recorded bags, export, check and repair them.", _LOOK, attribute="app"),
    _here("experiment", "Run the offline experiment of DGUs and write their histories as a bag.", _DESIGN),
    _here("design", "Design an observer from a recorded history and print its certificate.", _DESIGN),
    _here(
        "import",
        "Bring other people's bags and tables in.",
        _DESIGN,
        attribute="app",
        module="imports",
    ),
    _ros("monitor", "Attach monitors to live ROS 2 topics of any message type, and tell alarms as they come.", _DESIGN),
    _here("plugins", "List what installed packages add: kinds of attacks, detectors and observers.", _DESIGN),
    _here("paper", "Repeat the papers' experiments and check their numbers.", _SHOW, attribute="app"),
    _here("measure", "Measure what is claimed of attacks, detectors and long runs.", _SHOW, attribute="app"),
)
