"""A command to the attacker, carried out by the relay."""

from dgu_sim.commands import AttackChange, AttackCommand, AttackStart, AttackStop
from dgu_sim.errors import AttackError
from dgu_sim.relay import Relay, RelayEvent, RelayState

__all__ = ["obey"]


def obey(
    relay: Relay, state: RelayState, command: AttackCommand
) -> tuple[RelayState, tuple[RelayEvent, ...], RelayEvent | None]:
    """Start, change or stop an attack from the next step on.

    Args:
        relay: The relay.
        state: Where it is.
        command: The command.

    Returns:
        The new state; the events of the next step that are told at once, which `Relay.step` does not report again; and
        the START event of the first link, which may lie in the future.

    Raises:
        AttackError: It cannot be done; nothing is changed.
    """
    if isinstance(command, AttackStop):
        state, ended = relay.stop(state, command.named_links[0])
        return state, ended, None
    if not isinstance(command, AttackStart):
        raise AttackError(f"{command.name}: expected a command that the attacker knows")
    ended = ()
    if isinstance(command, AttackChange):
        if command.start_sec is not None:
            raise AttackError("attack_change: start_sec: expected none, a change acts from the next sample on")
        state, ended = relay.stop(state, command.named_links[0])
    link = command.named_links[0]
    more = {"links": list(command.links)} if len(command.links) > 1 else {}
    state, started = relay.start(
        state,
        link,
        command.kind,
        {**command.parameters, **more, "anyway": command.anyway},
        command.duration_sec,
        start_sec=command.start_sec,
    )
    return state, (*ended, *((started,) if started.step == state.step else ())), started
