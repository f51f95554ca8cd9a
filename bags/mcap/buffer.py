"""Closed chunks on their way to the disk, written by a thread of their own, so that a slow disk stops nobody.

The thread does little but wait for the disk: what needs the interpreter (packing) is done by whoever closes the chunk,
because a thread that competes for the interpreter with a busy run waits milliseconds for each turn.
"""

import threading
from collections import deque
from collections.abc import Callable

from bags.mcap.errors import BagError
from bags.mcap.packing import PackedChunk


class ChunkBuffer:
    """A bounded queue of chunks and the thread that empties it."""

    def __init__(self, store: Callable[[PackedChunk], None], max_bytes: int) -> None:
        """Start the thread.

        Args:
            store: Writes one chunk; raises BagError when the disk refuses for good.
            max_bytes: From this size on the buffer counts as full.
        """
        self._store = store
        self._max_bytes = max_bytes
        self._chunks: deque[PackedChunk] = deque()
        self._size = 0  # bytes that are not yet written, those in the thread's hands included
        self._failure: BagError | None = None
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="bag", daemon=True)
        self._thread.start()

    @property
    def full(self) -> bool:
        """Whether as much waits as may wait."""
        return self._size >= self._max_bytes

    def put(self, chunk: PackedChunk, *, wait: bool) -> None:
        """Hand a chunk over.

        Args:
            chunk: Not to be touched any more.
            wait: Whether to wait while the buffer is full.

        Raises:
            BagError: The disk refused this or an earlier chunk.
        """
        with self._changed:
            if wait:
                self._changed.wait_for(lambda: not self.full or self._failure is not None)
            self._raise_failure()
            self._chunks.append(chunk)
            self._size += chunk.size
            self._changed.notify_all()

    def drain(self) -> None:
        """Wait until everything is written.

        Raises:
            BagError: The disk refused a chunk.
        """
        with self._changed:
            self._changed.wait_for(lambda: not self._size or self._failure is not None)
            self._raise_failure()

    def close(self) -> None:
        """Write everything and end the thread.

        Raises:
            BagError: The disk refused a chunk.
        """
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join()
        self._raise_failure()

    def _raise_failure(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._chunks) or self._closed)
                if not self._chunks:
                    return
                chunk = self._chunks.popleft()
            try:
                self._store(chunk)
            except BagError as error:
                with self._changed:
                    self._failure = error
                    self._chunks.clear()
                    self._size, self._closed = 0, True
                    self._changed.notify_all()
                return
            with self._changed:
                self._size -= chunk.size
                self._changed.notify_all()
