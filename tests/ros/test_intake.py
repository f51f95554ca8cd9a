"""Two publishers on one topic: the same steps come out, whichever message arrives first."""

from __future__ import annotations

import struct

from hypothesis import given
from hypothesis import strategies as st

from dcmg_nodes.intake import Intake, Others, taken

STEPS, FIRST, END = 12, 4, 9


def message(step: int, tag: bytes = b"own") -> bytes:
    """Bytes that claim a step."""
    return struct.pack("<i", step) + tag


def step_of(data: bytes) -> int:
    """Step that they claim."""
    (step,) = struct.unpack_from("<i", data)
    return int(step)


@given(st.randoms(use_true_random=False), st.integers(0, 3))
def test_any_order_of_arrival_gives_the_same_steps(random: object, strangers: int) -> None:
    """Two streams, each in its order but interleaved at will: each step comes with its second message, in order."""
    own = [message(step) for step in range(STEPS)]
    seconds = [message(step, b"second") for step in range(FIRST, END)]
    strange = [message(-1 - number, b"strange") for number in range(strangers)]
    delivered: list[tuple[bytes, Others | None]] = []
    intake = Intake(step_of, lambda data, others: delivered.append((data, others)))
    for data in own[:FIRST]:
        intake.push(data)
    intake.expect(FIRST, END)
    queues = [(own[FIRST:], intake.push), (seconds, intake.push_other), (strange, intake.push_other)]
    while any(queue for queue, _ in queues):
        queue, push = random.choice([one for one in queues if one[0]])  # type: ignore[attr-defined]  # a Random
        push(queue.pop(0))
    intake.push(message(STEPS))  # takes along what came last
    assert [data for data, _ in delivered] == [*(message(step) for step in range(STEPS)), message(STEPS)]
    second = [others.second if others else None for _, others in delivered]
    assert second == [message(k, b"second") if FIRST <= k < END else None for k in range(STEPS + 1)]
    came = [data for _, others in delivered if others for data in others.strange]
    assert came == [message(-1 - number, b"strange") for number in range(strangers)]


def test_a_spoofed_step_waits_for_both() -> None:
    """Nothing is delivered before the second message is there; an end told later lets the next steps go on."""
    delivered: list[bytes] = []
    intake = Intake(step_of, lambda data, _: delivered.append(data))
    intake.expect(0, 2**64 - 1)
    intake.push(message(0))
    assert delivered == []
    intake.push_other(message(0, b"second"))
    assert delivered == [message(0)]
    intake.push(message(1))
    intake.expect(0, 1)
    assert delivered == [message(0), message(1)]


def test_which_message_counts() -> None:
    """The newest one, or the known publisher's; a stranger's never."""
    both = Others(b"second", (b"strange",))
    assert taken(b"own", both, newest=True) == b"second"
    assert taken(b"own", both, newest=False) == b"own"
    assert taken(b"own", Others(None, (b"strange",)), newest=True) == b"own"
    assert taken(b"own", None, newest=True) == b"own"
