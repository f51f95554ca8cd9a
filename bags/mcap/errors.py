"""The one error of this package."""


class BagError(Exception):
    """Something about a bag or a message is not as it must be; one line: where, what was found, what was expected."""
