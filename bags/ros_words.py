"""What a command line says to ROS: `--ros-args …`, up to `--`, as `ros2 run` and `ros2 launch` append it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["RosWordsError", "split_words"]

_BEGIN, _END = "--ros-args", "--"


class RosWordsError(Exception):
    """ROS does not understand what stands behind `--ros-args`."""


def split_words(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words that are meant for us, and those for ROS with their `--ros-args`.

    Args:
        words: the command line without the program's name.
    """
    ours: list[str] = []
    for_ros: list[str] = []
    inside = False
    for position, word in enumerate(words):
        if word == _END and not inside:  # what stands behind is another program's, `--ros-args` included
            return [*ours, *words[position:]], for_ros
        inside = inside or word == _BEGIN
        (for_ros if inside else ours).append(word)
        inside = inside and word != _END
    return ours, for_ros
