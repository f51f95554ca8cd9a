"""The attacker's services in the public domain: each request is carried to the attacker, its answer back."""

from __future__ import annotations

import threading
from functools import partial
from typing import TYPE_CHECKING, Any

from dcmg_msgs.srv import ListAttacks, StartAttack, StopAttack
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from dcmg_nodes.attack_services import LIST_SERVICE, START_SERVICE, STOP_SERVICE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rclpy.client import Client
    from rclpy.node import Node

_KINDS = {START_SERVICE: StartAttack, STOP_SERVICE: StopAttack, LIST_SERVICE: ListAttacks}
_ANSWER_SEC = 4.0  # less than a caller of ours waits
_LOG_EVERY_SEC = 1.0


class Errands:
    """Services on one node, clients on the other; the services wait in a thread of their own.

    Args:
        inner: node in the run's own domain; somebody else spins it.
        face: node in the public domain that offers the services.
        faces: all nodes there, this one included, whose parameters are served, too; nobody else may spin them.
    """

    def __init__(self, inner: Node, face: Node, faces: Iterable[Node]) -> None:
        """Offer the services, and start to serve."""
        self._face = face
        self._over = threading.Event()
        self._services = []
        for name, kind in _KINDS.items():
            client = inner.create_client(kind, name)
            self._services.append(face.create_service(kind, name, partial(self._carry, client)))
        self._executor = SingleThreadedExecutor(context=face.context)
        for one in faces:
            self._executor.add_node(one)
        self._thread = threading.Thread(target=self._serve, name="errands", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Serve nobody any more."""
        self._over.set()
        self._executor.shutdown()
        self._thread.join(_ANSWER_SEC)

    def _serve(self) -> None:
        while not self._over.is_set():
            try:
                self._executor.spin_once(timeout_sec=1.0)
            except ExternalShutdownException:
                return
            except Exception as error:  # noqa: BLE001 - a request that cannot be read must end nothing
                said = f"a request cannot be read ({type(error).__name__}: {error})"
                self._face.get_logger().error(said, throttle_duration_sec=_LOG_EVERY_SEC)

    def _carry(self, client: Client, request: Any, response: Any) -> Any:  # noqa: ANN401 (generated classes)
        answered = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        if answered.wait(_ANSWER_SEC):
            return future.result()
        client.remove_pending_request(future)
        if hasattr(response, "message"):
            response.accepted, response.message = False, f"the attacker did not answer within {_ANSWER_SEC:g} s"
        return response
