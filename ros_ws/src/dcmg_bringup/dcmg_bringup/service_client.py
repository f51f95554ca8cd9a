"""Calls services of what runs in a ROS domain, from another process."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from dcmg.errors import CommandError
from dcmg_nodes.farewell import destroy

if TYPE_CHECKING:
    from collections.abc import Mapping

_ANSWER_SEC = 5.0


class ServiceClient:
    """A node that calls. To be closed.

    Args:
        environment: variables of the ROS domain that it joins.
        who: what answers there, in messages.
        hint: what to look at where nothing does.
        find_sec: how long it is looked for [s].
    """

    def __init__(self, environment: Mapping[str, str], who: str, hint: str, find_sec: float) -> None:
        """Join the domain."""
        os.environ.update(environment)
        import rclpy  # noqa: PLC0415 (rclpy only when needed, in the domain just set)
        from rclpy.node import Node  # noqa: PLC0415

        from dcmg_nodes.ros_arguments import ros_arguments  # noqa: PLC0415

        self._domain, self._who, self._hint = os.environ["ROS_DOMAIN_ID"], who, hint
        self._find_sec, self._rclpy = find_sec, rclpy
        rclpy.init(args=ros_arguments())
        self._node = Node(f"dcmg_{who}_client", enable_rosout=False, start_parameter_services=False)

    def call(self, service: Any, name: str, request: Any) -> Any:  # noqa: ANN401 (generated classes share no base)
        """Return the answer to a request.

        Raises:
            CommandError: nobody is there, no answer, or refused.
        """
        client = self._node.create_client(service, name)
        if not client.wait_for_service(timeout_sec=self._find_sec):
            raise CommandError(f"no {self._who} answers in ROS domain {self._domain}: {self._hint}")
        future = client.call_async(request)
        self._rclpy.spin_until_future_complete(self._node, future, timeout_sec=_ANSWER_SEC)
        answer = future.result()
        if answer is None:
            raise CommandError(f"the {self._who} in ROS domain {self._domain} did not answer within {_ANSWER_SEC:g} s")
        if not getattr(answer, "accepted", True):
            raise CommandError(answer.message)
        return answer

    def close(self) -> None:
        """Leave the domain."""
        destroy(self._node, 1)
        self._rclpy.try_shutdown()
