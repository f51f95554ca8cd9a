"""Parameters of an attack as somebody sends them: text that may hold anything."""

import json
from typing import NoReturn

from dgu_sim.errors import AttackError

__all__ = ["parse_parameters"]

_LONGEST = 65_536  # characters; a long waveform fits
_EXPECTED = 'expected one JSON object, as in {"bias": [0.1, 0.1, 0.1]}'


def parse_parameters(text: str) -> dict[str, object]:
    """Read the parameters of an attack; empty text means none.

    Raises:
        AttackError: The text is no JSON object of finite numbers and sound text, or too long or too deep a one.
    """
    if len(text) > _LONGEST:
        raise AttackError(f"parameters: {len(text)} characters, expected at most {_LONGEST}")
    try:
        found = json.loads(text or "{}", parse_constant=_not_a_number)
        json.dumps(found, ensure_ascii=False).encode()  # halves of surrogate pairs are no text
    except RecursionError:
        raise AttackError(f"parameters: nested too deeply, {_EXPECTED}") from None
    except UnicodeError:
        raise AttackError(f"parameters: broken unicode, {_EXPECTED}") from None
    except ValueError as error:  # malformed, or a number of thousands of digits
        raise AttackError(f"parameters: {str(error)[:200]}: {_EXPECTED}") from None
    if not isinstance(found, dict):
        raise AttackError(f"parameters: {_EXPECTED}")
    return found


def _not_a_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")
