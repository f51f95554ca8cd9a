"""The error of a study."""

from bags.mcap.errors import BagError


class StudyError(BagError):
    """Something about a study is not as it must be; one line: file, key, value, what was expected."""
