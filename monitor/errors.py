"""What this package raises on misuse. Foreseen outcomes (a refused design, an alarm) are values, not exceptions."""


class MonitorError(Exception):
    """Base of all errors of this package; the message is one line: what was found, what was expected."""


class HistoryError(MonitorError):
    """A history that no observer can be designed from; the line says what would fix it."""
