"""What every process of ours tells ROS when it joins."""

from __future__ import annotations

import sys


def ros_arguments() -> list[str]:
    """The command line, and that ROS writes no log file of its own: what nodes log stands on standard error."""
    return [*sys.argv, "--ros-args", "--disable-external-lib-logs"]
