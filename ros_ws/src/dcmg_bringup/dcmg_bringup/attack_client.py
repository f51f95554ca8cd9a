"""Starts, stops and lists attacks in a running system, from another process, through the attacker's services."""

from __future__ import annotations

import json
import math
from contextlib import closing
from typing import TYPE_CHECKING

from dcmg.errors import CommandError
from dcmg_bringup.domain import RunningSystem, checked_domain, running_systems
from dcmg_bringup.ros_environment import ros_environment
from dcmg_bringup.service_client import ServiceClient

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dcmg_msgs.srv import ListAttacks

    from dgu_sim.grid import Link


def find_system(domain: int | None) -> RunningSystem:
    """Return the running system to attack: the one in `domain`, or the only one there is.

    Raises:
        CommandError: none runs, or several do and no domain was named.
    """
    systems = running_systems()
    domain = checked_domain(domain)
    if domain is not None:
        found = [system for system in systems if system.domain == domain]
        return found[0] if found else RunningSystem(domain=domain, pid=0, scenario="", out="")
    if not systems:
        raise CommandError("no running system on this machine: start one with `dcmg run SCENARIO`")
    if len(systems) > 1:
        names = ", ".join(f"{system.domain} ({system.scenario})" for system in systems)
        raise CommandError(f"several systems are running: choose one with --domain out of {names}")
    return systems[0]


class AttackClient:
    """Calls the attacker's services of one running system."""

    def __init__(self, system: RunningSystem) -> None:
        """Join the system's ROS domain."""
        self._client = ServiceClient(ros_environment(system.domain), "attacker", "is a system running there?", 5.0)
        self.close = self._client.close

    def start(
        self, links: Sequence[Link], kind: str, parameters: Mapping[str, object], duration_sec: float
    ) -> tuple[int, int]:
        """Start an attack on one or several links; return its number and the first affected step.

        Raises:
            CommandError: no answer, or refused.
        """
        from dcmg_msgs.srv import StartAttack  # noqa: PLC0415

        first = links[0]
        told = parameters if len(links) == 1 else {"links": [str(link) for link in links], **parameters}
        request = StartAttack.Request(
            source=first.source, target=first.target, kind=kind, parameters=json.dumps(told), duration_sec=duration_sec
        )
        answer = self._client.call(StartAttack, "/attacks/start", request)
        return answer.attack, answer.step

    def stop(self, link: Link) -> tuple[int, int]:
        """Stop all attacks on a link; return how many and the first clean step.

        Raises:
            CommandError: no answer, or refused.
        """
        from dcmg_msgs.srv import StopAttack  # noqa: PLC0415

        answer = self._client.call(
            StopAttack, "/attacks/stop", StopAttack.Request(source=link.source, target=link.target)
        )
        return answer.stopped, answer.step

    def list(self) -> list[dict[str, object]]:
        """Describe the active and scheduled attacks.

        Raises:
            CommandError: no answer.
        """
        from dcmg_msgs.srv import ListAttacks  # noqa: PLC0415

        answer: ListAttacks.Response = self._client.call(ListAttacks, "/attacks/list", ListAttacks.Request())
        return [
            {
                "attack": event.attack,
                "link": f"{event.source}-{event.target}",
                "kind": event.kind,
                "parameters": json.loads(event.parameters),
                "start_step": event.step,
                "start_sec": event.header.stamp.sec + event.header.stamp.nanosec * 1e-9,
                "stop_sec": None if math.isnan(stop_sec) else stop_sec,
                "active": event.step < answer.step or event.origin == "service",
                "origin": event.origin,
            }
            for event, stop_sec in zip(answer.attacks, answer.stop_sec, strict=True)
        ]


def attack_client(domain: int | None) -> closing[AttackClient]:
    """Open a client on the system in `domain`, or on the only one that runs, for a `with` block.

    Raises:
        CommandError: see `find_system`.
    """
    return closing(AttackClient(find_system(domain)))
