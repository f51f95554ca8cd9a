"""What every process of ours tells ROS when it joins."""

from __future__ import annotations

import sys

import rclpy

from bags.ros_words import RosWordsError, split_words

_REMAP = ("-r", "--remap")
_NAMES = ("__node:=", "__name:=")


def ros_arguments() -> list[str]:
    """What the command line says to ROS, and that ROS writes no log file of its own: nodes log to standard error.

    Nodes keep the names that a scenario gives them, by which the others of a run know them.

    Raises:
        RosWordsError: ROS does not understand it.
    """
    _, words = split_words(sys.argv[1:])
    kept = list(words)
    for at in reversed(range(1, len(words))):
        if words[at - 1] in _REMAP and words[at].startswith(_NAMES):
            del kept[at - 1 : at + 1]
    told = [sys.argv[0], *kept, "--ros-args", "--disable-external-lib-logs"]
    if words:
        _check(told)
    return told


def _check(told: list[str]) -> None:
    context = rclpy.Context()
    try:
        context.init(args=told)
        context.shutdown()
    except RuntimeError as error:  # all that rclpy raises for this
        reason = " ".join(str(error).split(", at ")[0].split()).removeprefix("failed to initialize rcl: ")
        raise RosWordsError(f"{' '.join(told[1:-2])}: expected arguments that ROS knows: {reason}") from None
