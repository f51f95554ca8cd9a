"""Parameters of an attack for people."""

import json
from collections.abc import Mapping

__all__ = ["parameter_words"]

_MOST_SHOWN = 6  # longer lists are tables from files


def parameter_words(parameters: Mapping[str, object] | str) -> list[str]:
    """Return "name value" for each parameter that is set; of a long list only how many values it has.

    Args:
        parameters: by name, or the JSON document of them that an event carries.
    """
    if isinstance(parameters, str):
        try:
            found = json.loads(parameters or "{}")
        except ValueError:
            return [parameters]
        parameters = found if isinstance(found, dict) else {}
    return [f"{name} {_value(value)}" for name, value in parameters.items() if value not in (None, [])]


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(parameter_words(value)) + "}"
    if not isinstance(value, list):
        return str(value)
    return " ".join(map(str, value)) if len(value) <= _MOST_SHOWN else f"{len(value)} values"
