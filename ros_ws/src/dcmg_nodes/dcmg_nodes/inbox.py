"""The firing rule of a Kahn process network: act on step k when every input for step k is there."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

Token = TypeVar("Token")


class Inbox(Generic[Token]):
    """One first-in first-out queue an input; `push` returns a full set of heads as soon as there is one.

    Args:
        inputs: names of the inputs, in the order in which `push` returns their tokens.
        primed: inputs that start with one `None` token, so that the first firing does not wait for them.
    """

    def __init__(self, inputs: list[str], primed: frozenset[str] = frozenset()) -> None:
        """Create empty queues, the primed ones with their initial token."""
        self._names = tuple(inputs)
        self._queues: tuple[deque[Token | None], ...] = tuple(
            deque([None]) if name in primed else deque() for name in inputs
        )
        self._empty = sum(not queue for queue in self._queues)

    def push(self, slot: int, token: Token) -> list[Token | None] | None:
        """Append a token to input `slot`; return one token of each input when all have one, else None."""
        queue = self._queues[slot]
        if not queue:
            self._empty -= 1
        queue.append(token)
        return self.take()

    def take(self) -> list[Token | None] | None:
        """Return one token of each input and remove them, or None while an input has none."""
        if self._empty:
            return None
        heads = [queue.popleft() for queue in self._queues]
        self._empty = sum(not queue for queue in self._queues)
        return heads

    def missing(self) -> tuple[str, ...]:
        """Names of the inputs that the next firing waits for."""
        return tuple(name for name, queue in zip(self._names, self._queues, strict=True) if not queue)
