"""Services that anybody may call with anything: whatever comes, the node goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from dgu_sim.errors import DguSimError

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.node import Node

_LOG_EVERY_SEC = 1.0


class Answer(Protocol):
    """A response that can say why a request was refused."""

    accepted: bool
    message: str


_Request = TypeVar("_Request")
_Response = TypeVar("_Response", bound=Answer)


def offer(node: Node, kind: type[Any], name: str, handler: Callable[[_Request, _Response], _Response]) -> Any:  # noqa: ANN401 (rclpy's Service is generic in types that are generated)
    """Create a service whose handler may raise: the caller gets a refusal, the log a line, and the node goes on.

    Args:
        node: the node that offers it.
        kind: type of the service; its response has `accepted` and `message`.
        name: name of the service.
        handler: fills the response; must change the node's state only once nothing can fail any more.
    """
    log = node.get_logger()

    def answer(request: _Request, response: _Response) -> _Response:
        try:
            return handler(request, response)
        except DguSimError as error:
            response.message = _printable(str(error))
        except Exception as error:  # noqa: BLE001 - a stranger's request must not end a run
            response.message = _printable(f"{name}: this request cannot be served ({type(error).__name__}: {error})")
            log.error(response.message, throttle_duration_sec=_LOG_EVERY_SEC)  # noqa: TRY400 (one line, not a trace)
        response.accepted = False
        return response

    return node.create_service(kind, name, answer)


def _printable(text: str, longest: int = 1000) -> str:
    """Text that fits into a ROS message: valid UTF-8, one line, not too long."""
    return " ".join(text.encode(errors="backslashreplace").decode().split())[:longest]
