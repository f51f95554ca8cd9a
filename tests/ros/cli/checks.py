"""What the `ros2` command line says of a run of the six-DGU grid: thirty commands, each with what is expected of it.

A check has the words after `ros2`, patterns that its output holds, and the question by which a test asks rclpy the same
where no `ros2` is installed; its answer must hold the same patterns.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple


class Ask(Enum):
    """How rclpy is asked the same."""

    NODES = auto()
    NODE = auto()
    TOPICS = auto()
    TOPIC_TYPE = auto()
    TOPIC_ENDS = auto()
    ECHO = auto()
    SERVICES = auto()
    SERVICE_TYPE = auto()
    CALL = auto()
    LIST_PARAMETERS = auto()
    GET_PARAMETER = auto()
    DESCRIBE_PARAMETER = auto()
    SET_PARAMETER = auto()
    INTERFACE = auto()
    LAUNCH = auto()


class Check(NamedTuple):
    """One command.

    Attributes:
        words: after `ros2`.
        patterns: regular expressions, each found somewhere in the output, white space of any length.
        ask: how rclpy is asked.
        about: what it is asked.
    """

    words: str
    patterns: tuple[str, ...]
    ask: Ask
    about: tuple[str, ...] = ()


_STOP = "{source: 5, target: 6}"
CHECKS = (
    Check("node list", (r"/clock\b", r"/dgu_6\b", r"/attacker\b", r"/monitor_1\b", r"/recorder\b"), Ask.NODES),
    Check("node info /dgu_1", (r"/dgu_1/state: dcmg_msgs/msg/State", r"/rosout"), Ask.NODE, ("dgu_1",)),
    Check("node info /monitor_2", (r"/dgu_2/residual/dgu_1: dcmg_msgs/msg/Residual",), Ask.NODE, ("monitor_2",)),
    Check("node info /attacker", (r"/attacks/start: dcmg_msgs/srv/StartAttack",), Ask.NODE, ("attacker",)),
    Check("topic list", (r"/clock\b", r"/dgu_2/received/dgu_1\b", r"/attacks/events\b", r"/diagnostics"), Ask.TOPICS),
    Check("topic list -t", (r"/tick \[dcmg_msgs/msg/Tick\]", r"/rosout \[rcl_interfaces/msg/Log\]"), Ask.TOPICS),
    Check("topic type /dgu_3/output", (r"dcmg_msgs/msg/Output",), Ask.TOPIC_TYPE, ("/dgu_3/output",)),
    Check("topic type /clock", (r"rosgraph_msgs/msg/Clock",), Ask.TOPIC_TYPE, ("/clock",)),
    Check(
        "topic info -v /dgu_1/state",
        (r"Publisher count: 1\b", r"Node name: dgu_1\b", r"RELIABLE"),
        Ask.TOPIC_ENDS,
        ("/dgu_1/state",),
    ),
    Check(
        "topic info -v /dgu_2/alarms",
        (r"Publisher count: 1\b", r"Node name: monitor_2\b", r"TRANSIENT_LOCAL"),
        Ask.TOPIC_ENDS,
        ("/dgu_2/alarms",),
    ),
    Check("topic echo --once /clock", (r"nanosec: \d+",), Ask.ECHO, ("/clock",)),
    Check("topic echo --once /dgu_1/state", (r"step: \d+", r"load_current: "), Ask.ECHO, ("/dgu_1/state",)),
    Check("topic echo --once /dgu_2/received/dgu_1", (r"delivered: true",), Ask.ECHO, ("/dgu_2/received/dgu_1",)),
    Check("service list", (r"/attacks/start\b", r"/attacks/list\b", r"/dgu_1/get_parameters\b"), Ask.SERVICES),
    Check("service type /attacks/stop", (r"dcmg_msgs/srv/StopAttack",), Ask.SERVICE_TYPE, ("/attacks/stop",)),
    Check("service call /attacks/list dcmg_msgs/srv/ListAttacks", (r"ListAttacks_Response\(",), Ask.CALL, ("list",)),
    Check(
        f'service call /attacks/stop dcmg_msgs/srv/StopAttack "{_STOP}"',
        (r"StopAttack_Response\(accepted=(True|False)",),
        Ask.CALL,
        ("stop",),
    ),
    Check("param list /dgu_1", (r"\bscenario\b", r"\bseed\b", r"\blinks\b"), Ask.LIST_PARAMETERS, ("dgu_1",)),
    Check("param list /recorder", (r"\bsteps\b",), Ask.LIST_PARAMETERS, ("recorder",)),
    Check("param get /monitor_2 links", (r"1-2, 4-2",), Ask.GET_PARAMETER, ("monitor_2", "links")),
    Check("param get /monitor_2 observer", (r"full_order",), Ask.GET_PARAMETER, ("monitor_2", "observer")),
    Check("param get /clock sampling_period_sec", (r"0\.01",), Ask.GET_PARAMETER, ("clock", "sampling_period_sec")),
    Check("param describe /clock seed", (r"Seed of everything random",), Ask.DESCRIBE_PARAMETER, ("clock", "seed")),
    Check("param describe /dgu_1 steps", (r"Number of steps of the run",), Ask.DESCRIBE_PARAMETER, ("dgu_1", "steps")),
    Check("param set /dgu_1 seed 7", (r"read-only parameter: seed",), Ask.SET_PARAMETER, ("dgu_1", "seed")),
    Check("interface show dcmg_msgs/msg/Alarm", (r"float64\[\] threshold",), Ask.INTERFACE, ("msg/Alarm.msg",)),
    Check("interface show dcmg_msgs/msg/State", (r"float64 load_current",), Ask.INTERFACE, ("msg/State.msg",)),
    Check("interface show dcmg_msgs/srv/StartAttack", (r"---",), Ask.INTERFACE, ("srv/StartAttack.srv",)),
    Check("interface package dcmg_msgs", (r"dcmg_msgs/msg/Residual",), Ask.INTERFACE, ()),
    Check(
        "launch dcmg_bringup run.launch.py --show-args",
        (r"'scenario'", r"'pacing'", r"lockstep or realtime"),
        Ask.LAUNCH,
    ),
)
