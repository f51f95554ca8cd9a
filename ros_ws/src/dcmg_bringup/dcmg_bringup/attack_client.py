"""Starts, stops and lists attacks in a running system, from another process, through the attacker's services."""

from __future__ import annotations

import json
import math
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from dcmg.errors import CommandError
from dcmg_bringup.domain import RunningSystem, checked_domain, running_systems
from dcmg_bringup.ros_environment import ros_environment
from dcmg_nodes.ros_arguments import ros_arguments

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dcmg_msgs.srv import ListAttacks

    from dgu_sim.grid import Link

_FIND_SEC = 5.0
_ANSWER_SEC = 5.0


class AttackClientError(CommandError):
    """No running system, no answer from it, or the attacker refused."""


def find_system(domain: int | None) -> RunningSystem:
    """Return the running system to attack: the one in `domain`, or the only one there is.

    Raises:
        AttackClientError: none runs, or several do and no domain was named.
    """
    systems = running_systems()
    domain = checked_domain(domain)
    if domain is not None:
        found = [system for system in systems if system.domain == domain]
        return found[0] if found else RunningSystem(domain=domain, pid=0, scenario="", out="")
    if not systems:
        raise AttackClientError("no running system on this machine: start one with `dcmg run SCENARIO`")
    if len(systems) > 1:
        names = ", ".join(f"{system.domain} ({system.scenario})" for system in systems)
        raise AttackClientError(f"several systems are running: choose one with --domain out of {names}")
    return systems[0]


class AttackClient:
    """Calls the attacker's services of one running system."""

    def __init__(self, system: RunningSystem) -> None:
        """Join the system's ROS domain."""
        os.environ.update(ros_environment(system.domain))
        import rclpy  # noqa: PLC0415 (rclpy only when needed, in the domain just set)
        from rclpy.node import Node  # noqa: PLC0415

        self._domain = system.domain
        self._rclpy = rclpy
        rclpy.init(args=ros_arguments())
        self._node = Node("dcmg_attack_client", enable_rosout=False, start_parameter_services=False)

    def start(
        self, links: Sequence[Link], kind: str, parameters: Mapping[str, object], duration_sec: float
    ) -> tuple[int, int]:
        """Start an attack on one or several links; return its number and the first affected step.

        Raises:
            AttackClientError: no answer, or refused.
        """
        from dcmg_msgs.srv import StartAttack  # noqa: PLC0415

        first = links[0]
        told = parameters if len(links) == 1 else {"links": [str(link) for link in links], **parameters}
        request = StartAttack.Request(
            source=first.source, target=first.target, kind=kind, parameters=json.dumps(told), duration_sec=duration_sec
        )
        answer = self._call(StartAttack, "/attacks/start", request)
        return answer.attack, answer.step

    def stop(self, link: Link) -> tuple[int, int]:
        """Stop all attacks on a link; return how many and the first clean step.

        Raises:
            AttackClientError: no answer, or refused.
        """
        from dcmg_msgs.srv import StopAttack  # noqa: PLC0415

        answer = self._call(StopAttack, "/attacks/stop", StopAttack.Request(source=link.source, target=link.target))
        return answer.stopped, answer.step

    def list(self) -> list[dict[str, object]]:
        """Describe the active and scheduled attacks.

        Raises:
            AttackClientError: no answer.
        """
        from dcmg_msgs.srv import ListAttacks  # noqa: PLC0415

        answer: ListAttacks.Response = self._call(ListAttacks, "/attacks/list", ListAttacks.Request())
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

    def close(self) -> None:
        """Leave the ROS domain."""
        self._node.destroy_node()
        self._rclpy.try_shutdown()

    def _call(self, service: Any, name: str, request: Any) -> Any:  # noqa: ANN401 (generated classes share no base)
        client = self._node.create_client(service, name)
        if not client.wait_for_service(timeout_sec=_FIND_SEC):
            raise AttackClientError(f"no attacker answers in ROS domain {self._domain}: is a system running there?")
        future = client.call_async(request)
        self._rclpy.spin_until_future_complete(self._node, future, timeout_sec=_ANSWER_SEC)
        answer = future.result()
        if answer is None:
            raise AttackClientError(
                f"the attacker in ROS domain {self._domain} did not answer within {_ANSWER_SEC:g} s"
            )
        if not getattr(answer, "accepted", True):
            raise AttackClientError(answer.message)
        return answer


@contextmanager
def attack_client(domain: int | None) -> Iterator[AttackClient]:
    """Open a client on the system in `domain`, or on the only one that runs.

    Raises:
        AttackClientError: see `find_system`.
    """
    client = AttackClient(find_system(domain))
    try:
        yield client
    finally:
        client.close()
