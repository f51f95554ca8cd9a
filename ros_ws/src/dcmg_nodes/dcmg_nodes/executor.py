"""One place that knows how to spin: rclpy's EventsExecutor where it dispatches, SingleThreadedExecutor otherwise."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.task import Future

from dcmg_nodes.options import ExecutorKind

if TYPE_CHECKING:
    from rclpy.node import Node

# spin() and an infinite timeout never dispatch on the EventsExecutor of the 7.1.6 wheels: the wait must be bounded.
_BOUNDED_FOREVER_SEC = 1e6
_SELF_TEST_SEC = 2.0


def make_executor(kind: ExecutorKind, node: Node) -> Executor:
    """Return an executor of the wanted kind that is known to dispatch callbacks of `node`, which it then holds.

    An EventsExecutor that is missing or does not fire a timer within two seconds is replaced by a
    SingleThreadedExecutor, with a warning in the node's log.
    """
    if kind is ExecutorKind.EVENTS:
        executor = _events_executor(node)
        if executor is not None:
            executor.add_node(node)
            if _dispatches(executor, node):
                return executor
            executor.remove_node(node)
            executor.shutdown()
        node.get_logger().warning("the EventsExecutor of this rclpy does not dispatch: using SingleThreadedExecutor")
    fallback = SingleThreadedExecutor(context=node.context)
    fallback.add_node(node)
    return fallback


def spin_until(executor: Executor, done: Future, timeout_sec: float = _BOUNDED_FOREVER_SEC) -> bool:
    """Dispatch callbacks until `done` is set or `timeout_sec` has passed; tell whether `done` is set."""
    executor.spin_until_future_complete(done, timeout_sec=timeout_sec)
    return bool(done.done())


def _events_executor(node: Node) -> Executor | None:
    try:
        from rclpy.experimental import EventsExecutor  # noqa: PLC0415 (absent from older rclpy)
    except ImportError:
        return None
    executor: Executor = EventsExecutor(context=node.context)
    return executor


def _dispatches(executor: Executor, node: Node) -> bool:
    fired: Future = Future()
    timer = node.create_timer(0.001, lambda: None if fired.done() else fired.set_result(None))
    try:
        return spin_until(executor, fired, _SELF_TEST_SEC)
    finally:
        node.destroy_timer(timer)
