"""Several chunks side by side, so that numpy takes the messages of a topic out of all of them at once."""

import numpy as np
from numpy.typing import NDArray

from bags.mcap.container import ChunkView


class Batch:
    """The contents of consecutive chunks."""

    def __init__(self) -> None:
        """Start empty."""
        self._chunks: list[ChunkView] = []
        self.size = 0

    def add(self, chunk: ChunkView) -> tuple[int, int]:
        """Take a chunk; return where it starts and ends in the batch."""
        self._chunks.append(chunk)
        self.size += len(chunk.data)
        return self.size - len(chunk.data), self.size

    def content(self) -> NDArray[np.uint8]:
        """All of it, shape (bytes,)."""
        if len(self._chunks) == 1:
            return self._chunks[0].data
        return np.concatenate([one.data for one in self._chunks]) if self._chunks else np.empty(0, dtype=np.uint8)


class Places:
    """Where the messages of one channel stand in a batch."""

    def __init__(self) -> None:
        """Start with none."""
        self._offsets: list[NDArray[np.int64]] = []
        self._spans: list[tuple[int, int, int]] = []  # start and end of the chunk in the batch, channel
        self.count = 0

    def add(self, offsets: NDArray[np.int64], span: tuple[int, int], channel_id: int) -> None:
        """Take the messages of one chunk, by their offsets in it."""
        self._offsets.append(offsets)
        self._spans.append((*span, channel_id))
        self.count += len(offsets)

    def records(self, content: NDArray[np.uint8], size: int) -> tuple[NDArray[np.void], NDArray[np.int64]] | None:
        """The message records as `size` raw bytes each, and the channel that each must be of.

        None when one of them would reach beyond its chunk.
        """
        offsets = np.concatenate(self._offsets)
        spans = np.repeat(np.array(self._spans, dtype=np.int64), [len(one) for one in self._offsets], axis=0)
        starts = offsets + spans[:, 0]
        if len(offsets) and (int(offsets.min()) < 0 or np.any(starts > spans[:, 1] - size)):
            return None
        # every window of one record's length, copied only where a record starts
        windows = np.ndarray((max(len(content) - size + 1, 0),), dtype=f"V{size}", buffer=content, strides=(1,))
        return windows[starts], spans[:, 2]
