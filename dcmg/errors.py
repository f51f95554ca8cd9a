"""Errors of the command line: each becomes one line on standard error and a non-zero exit code."""


class CommandError(Exception):
    """Base of the errors that end a command with one clear line."""
