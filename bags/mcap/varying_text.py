"""Messages whose one string changes its length: what stands behind it moves, so each length has a layout of its own."""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bags.mcap.cdr import ENCAPSULATION, Layout, layout_of
from bags.mcap.errors import BagError

_LENGTH = ".length"
_PADDING = 3  # bytes that some writers put behind a message


def of_varying_text(payloads: Sequence[bytes], layout: Layout, topic: str) -> NDArray[np.void]:
    """Messages of any text as one array whose string is as wide as the longest.

    Args:
        payloads: The messages.
        layout: Of one of them.
        topic: What to call them in messages.

    Raises:
        BagError: Something besides the one string changes its length, or a message is none.
    """
    names = layout.dtype.names or ()
    texts = [name for name in names if name.endswith(_LENGTH) and layout.dtype[name.removesuffix(_LENGTH)].kind == "S"]
    problem = BagError(f"{topic}: messages of {layout.type_name} vary in length, expected {layout.size} bytes each")
    fields = layout.dtype.fields
    if len(texts) != 1 or len([name for name in names if name.endswith(_LENGTH)]) != 1 or fields is None:
        raise problem
    at = int(fields[texts[0]][1])
    groups: dict[int, list[int]] = {}
    for number, data in enumerate(payloads):
        if len(data) < at + 4 or not data.startswith(ENCAPSULATION):
            raise problem
        groups.setdefault(int(struct.unpack_from("<I", data, at)[0]), []).append(number)
    found: list[NDArray[np.void]] = []
    for length, numbers in groups.items():
        if not 0 < length < 1 << 20:
            raise problem
        one = layout_of(layout.type_name, "x" * (length - 1))
        if any(not one.size <= len(payloads[number]) <= one.size + _PADDING for number in numbers):
            raise problem
        content = b"".join(payloads[number][: one.size] for number in numbers)
        found.append(np.frombuffer(content, dtype=one.dtype))
    order = np.argsort(np.concatenate([np.array(numbers) for numbers in groups.values()]), kind="stable")
    joined: NDArray[np.void] = np.concatenate(found)[order]
    return joined
