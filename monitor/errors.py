"""What this package raises on misuse. Foreseen outcomes (a refused design, an alarm) are values, not exceptions."""

from __future__ import annotations


class MonitorError(Exception):
    """Base of all errors of this package; the message is one line: what was found, what was expected."""


class HistoryError(MonitorError):
    """A history that no observer can be designed from; the line says what would fix it."""


class OptionError(MonitorError):
    """A setting that does not fit.

    Attributes:
        key: where it stands in the settings.
        value: what was found, None: nothing in particular.
        expected: what was expected.
    """

    def __init__(self, line: str, key: tuple[str, ...], value: object, expected: str) -> None:
        """Say it in a line of its own, for who has no settings to point into."""
        super().__init__(line)
        self.key, self.value, self.expected = key, value, expected

    def __reduce__(self) -> tuple[type[OptionError], tuple[str, tuple[str, ...], object, str]]:
        """Let it cross from a worker process: an exception is rebuilt from all that made it."""
        return type(self), (str(self), self.key, self.value, self.expected)


class PlugInError(MonitorError):
    """What an installed package adds cannot be used; the line names package, version and entry point."""
