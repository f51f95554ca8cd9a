"""When the clock releases a step (kept apart so that the command line need not import rclpy)."""

from __future__ import annotations

from enum import Enum


class PacingMode(Enum):
    """When a step is released."""

    LOCKSTEP = "lockstep"
    REALTIME = "realtime"
