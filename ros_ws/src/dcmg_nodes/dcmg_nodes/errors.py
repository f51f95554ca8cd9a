"""Errors of the nodes."""


class NodeError(Exception):
    """A node cannot be built or cannot go on; the message is one line."""
