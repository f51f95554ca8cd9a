"""Commands to a scenario's run, seen to fit it before anybody is told."""

from collections.abc import Mapping

from pydantic_core import PydanticCustomError

from bags.wire.settings import settings_of
from dgu_sim.commands import AttackChange, AttackStart, Command, ResponseCommand, parse_command, unknown_place
from dgu_sim.errors import SteeringError
from dgu_sim.model import finding
from dgu_sim.scenario import Scenario
from dgu_sim.signals import first_step
from monitor.settings import MonitorSettings

__all__ = ["check_script", "order"]


def order(scenario: Scenario, data: Mapping[str, object]) -> Command:
    """Return a command to a scenario's run from plain data: "command", its name, beside its fields.

    Args:
        scenario: What runs.
        data: As for `dgu_sim.commands.parse_command`.

    Raises:
        SteeringError: One line with what is wrong: key, value and what was expected.
    """
    command = parse_command(data)
    wrong = unknown_place(command, scenario.grid.dgus, scenario.links) or _unanswerable(command, settings_of(scenario))
    if wrong is not None:
        raise SteeringError(f"{command.name}: {wrong[0]} = {wrong[1]}: {wrong[2]}")
    return command


def check_script(scenario: Scenario, settings: MonitorSettings) -> None:
    """Check what a scenario's script commands to monitors and attackers; raises what `finding` returns."""
    for index, entry in enumerate(scenario.script):
        command = entry.order
        wrong = _unanswerable(command, settings) or _too_early(
            command, entry.at_step(scenario.sampling_period_sec), scenario.sampling_period_sec, settings
        )
        if wrong is not None:
            raise _found(index, *wrong)


def _found(index: int, key: str, value: str, expected: str) -> PydanticCustomError:
    return finding(("script", index, key), value, expected)


def _unanswerable(command: Command, settings: MonitorSettings) -> tuple[str, str, str] | None:
    if isinstance(command, ResponseCommand) and settings.response is None:
        return "command", command.name, "expected a scenario with monitor.response: there is none to switch"
    return None


def _too_early(
    command: Command, step: int, sampling_period_sec: float, settings: MonitorSettings
) -> tuple[str, str, str] | None:
    """Whether an attack would begin while detectors learn; `relay.Relay.start` refuses that in a run, too."""
    if not isinstance(command, AttackStart) or isinstance(command, AttackChange) or command.anyway:
        return None
    begins = step if command.start_sec is None else first_step(command.start_sec, sampling_period_sec)
    if begins * sampling_period_sec < settings.calibrated_sec:
        learn = f"until {settings.calibrated_sec:g} s the detectors learn from attack-free samples"
        return "command", command.name, f"expected later, or anyway: true: {learn}"
    return None
