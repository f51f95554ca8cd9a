"""Messages of one received output, step by step, when more than one publisher may speak on its topic.

A step of a spoofed link has two messages. Their readers know that beforehand (see `second_publisher`), wait for both,
and so come to the same numbers in every run, whichever arrives first. What any other publisher sends never takes part
in a step; it is passed on for the guard of the stream to see.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable


class Others(NamedTuple):
    """What other publishers sent up to a step.

    Attributes:
        second: the message of this step that was waited for, None when none was.
        strange: what nobody announced.
    """

    second: bytes | None
    strange: tuple[bytes, ...]


class Intake:
    """Pairs the run's own message of each step with what other publishers sent.

    Args:
        step_of: reads the step that a message claims.
        deliver: called once a step, in order, with the own message and the others, None when there are none.
    """

    def __init__(self, step_of: Callable[[bytes], int], deliver: Callable[[bytes, Others | None], None]) -> None:
        """Start at step 0 with nothing expected."""
        self._step_of = step_of
        self._deliver = deliver
        self._step = 0
        self._own: deque[bytes] = deque()
        self._others: list[bytes] = []
        self._expected: dict[int, int] = {}

    def expect(self, first_step: int, end_step: int) -> None:
        """Wait for a second message of the steps [first_step, end_step)."""
        self._expected[first_step] = end_step
        self._release()

    def push(self, data: bytes) -> None:
        """Take the run's own message of the next step."""
        if not (self._expected or self._others or self._own):
            self._step += 1
            self._deliver(data, None)
            return
        self._own.append(data)
        self._release()

    def push_other(self, data: bytes) -> None:
        """Take a message of another publisher."""
        self._others.append(data)
        self._release()

    def _release(self) -> None:
        while self._own:
            second = None
            if expects(self._expected, self._step):
                second = next((data for data in self._others if self._step_of(data) == self._step), None)
                if second is None:
                    return
                self._others.remove(second)
            due = [data for data in self._others if not expects(self._expected, self._step_of(data))]
            self._others = [data for data in self._others if data not in due]
            others = Others(second, tuple(due)) if second is not None or due else None
            self._step += 1
            self._deliver(self._own.popleft(), others)


def expects(expected: dict[int, int], step: int) -> bool:
    """Whether a step lies in one of the intervals first_step -> end_step."""
    return any(first <= step < end for first, end in expected.items())


def taken(own: bytes, others: Others | None, *, newest: bool) -> bytes:
    """Return the message of a step that counts for the receiver: the newest, or that of the known publisher."""
    return own if others is None or others.second is None or not newest else others.second
