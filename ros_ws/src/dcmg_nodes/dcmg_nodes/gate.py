"""The gate of a run: the only process that is in the domain of its nodes and in the public one.

The nodes of a run meet in a ROS domain of their own, which nobody is told of. Its public domain holds no node, only
the gate: it repeats what outsiders listen to (`mirror`), carries their requests to the attacker (`errands`), and
listens to what they say on the run's topics (`outside`). No message passes inward.
"""

from __future__ import annotations

import os
import signal
from contextlib import ExitStack
from importlib import resources
from typing import TYPE_CHECKING

import rclpy
from dcmg_msgs.msg import RunEnd
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future

from bags.wire.schema import ATTACKER_NODE
from dcmg_nodes.errands import Errands
from dcmg_nodes.executor import make_executor, spin_until
from dcmg_nodes.farewell import destroy
from dcmg_nodes.herald import Herald
from dcmg_nodes.lifetime import Lifetime
from dcmg_nodes.mirror import Mirror
from dcmg_nodes.options import GATE, ExecutorKind
from dcmg_nodes.outside import EARS_NODE, Outside
from dcmg_nodes.particulars import tell
from dcmg_nodes.ports import CONTROL_QOS
from dcmg_nodes.public import public_topics
from dcmg_nodes.ros_arguments import ros_arguments
from dcmg_nodes.wiring import END, wiring_of

if TYPE_CHECKING:
    from dcmg_nodes.options import GateOptions
    from dgu_sim.scenario import Scenario

_SIGNAL_CHECK_SEC = 0.1
_LAST_SEC = 0.2
_MOST_LAST = 10
_INNER_NODE = "dcmg_gate"


def run_gate(scenario: Scenario, options: GateOptions) -> None:
    """Keep the gate until the run ends."""
    wiring = wiring_of(scenario)
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(options.profile or resources.files("dcmg_nodes") / "gate.xml")
    lifetime = Lifetime((GATE,))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: lifetime.interrupt())
    with ExitStack() as stack:
        os.environ["ROS_STATIC_PEERS"] = ";".join(options.peers)  # of this context alone
        inner = _node(_INNER_NODE, options.inner, stack)
        os.environ["ROS_STATIC_PEERS"] = ""
        face_context = _context(options.public, stack)
        faces = {name: _node_in(name, face_context, stack, told=True) for name in wiring.nodes}
        for face in faces.values():
            tell(face, scenario)
        ears = _node(EARS_NODE, options.public, stack, told=True)
        topics = public_topics(wiring)
        outside = Outside(ears, topics, options.folder)
        mirror = Mirror(inner, faces, topics)
        errands = Errands(inner, faces[ATTACKER_NODE], faces.values())
        stack.callback(errands.close)
        herald = Herald(inner, faces, wiring)
        end = inner.create_subscription(RunEnd, END, lambda _: lifetime.leave(GATE), CONTROL_QOS)
        inner.create_timer(_SIGNAL_CHECK_SEC, lambda: None)  # Python sees signals between callbacks only
        executor = make_executor(ExecutorKind.EVENTS, inner)
        stack.callback(executor.shutdown)
        executor.add_node(ears)
        spin_until(executor, lifetime.over)
        for _ in range(_MOST_LAST):  # the end is repeated, too, and what has come is heard
            taken = outside.taken
            spin_until(executor, Future(), _LAST_SEC)
            if outside.taken == taken:
                break
        outside.look()
        mirror.settle(Duration(seconds=_LAST_SEC))
        inner.destroy_subscription(end)
        herald.close()


def _context(domain: int, stack: ExitStack) -> rclpy.Context:
    context = rclpy.Context()
    context.init(args=ros_arguments(), domain_id=domain)
    stack.callback(context.try_shutdown)
    return context


def _node(name: str, domain: int, stack: ExitStack, *, told: bool = False) -> Node:
    return _node_in(name, _context(domain, stack), stack, told=told)


def _node_in(name: str, context: rclpy.Context, stack: ExitStack, *, told: bool) -> Node:
    """Make a node; one that is `told` has parameters and a place on /rosout."""
    node = Node(name, context=context, enable_rosout=told, start_parameter_services=told)
    stack.callback(destroy, node, 0)
    return node
