"""Errors of the simulator: misuse, said in one line."""

__all__ = ["AttackError", "DguSimError", "PlugInError", "ScenarioError", "SteeringError"]


class DguSimError(Exception):
    """Base of every error raised on purpose by `dgu_sim`. Its message is one line."""


class ScenarioError(DguSimError):
    """A scenario cannot be used: the message names file, key, value and what was expected."""


class AttackError(DguSimError):
    """An attack cannot be started or stopped: the message says why."""


class PlugInError(DguSimError):
    """What an installed package adds cannot be used: the message names package, version and entry point."""


class SteeringError(DguSimError):
    """A command cannot be given: the message says why."""
