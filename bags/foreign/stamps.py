"""The clocks that the messages of a bag can be sampled by."""

from enum import Enum


class Stamps(Enum):
    """Which clock says when a message was measured."""

    AUTO = "auto"  # the headers when every mapped message type has one, else when it was recorded
    HEADER = "header"
    RECORDED = "recorded"
