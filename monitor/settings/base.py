"""The base of everything that monitors are told."""

from collections.abc import Mapping
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from monitor.suggestions import meant

__all__ = ["NonNegative", "Number", "Settings", "Spread3", "Vector3", "finding"]

_LARGEST = 1e15


def finding(key: tuple[str | int, ...], value: object, expected: str) -> PydanticCustomError:
    """Return the validation error that `key` (relative to the model) has `value` and something else was expected."""
    return PydanticCustomError("finding", "{expected}", {"key": key, "value": value, "expected": expected})


def _not_bool(value: object) -> object:
    if isinstance(value, bool):
        raise PydanticCustomError("number", "expected a number")
    return value


def _three(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) != 3:  # noqa: PLR2004 - a DGU has three states
        raise PydanticCustomError("vector", "expected 3 numbers: V [V], I_t [A], v [V s]")
    return value


def _not_huge(value: float) -> float:
    if abs(value) > _LARGEST:
        raise PydanticCustomError("number", f"expected a number of at most {_LARGEST:g}: larger ones overflow")
    return value


Number: TypeAlias = Annotated[float, BeforeValidator(_not_bool), AfterValidator(_not_huge)]
"""A finite float; yes and no are none."""

NonNegative: TypeAlias = Annotated[Number, Field(ge=0)]

Vector3: TypeAlias = Annotated[tuple[Number, Number, Number], BeforeValidator(_three)]
"""One number for each of V, I_t and v."""

Spread3: TypeAlias = Annotated[tuple[NonNegative, NonNegative, NonNegative], BeforeValidator(_three)]
"""One non-negative number for each of V, I_t and v."""


class Settings(BaseModel):
    """Immutable, finite numbers only, and an unknown key is an error that names the known ones."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: object) -> object:
        for key, value in data.items() if isinstance(data, Mapping) else ():
            if key not in cls.model_fields:
                hint = f"no such key: {meant(key, cls.model_fields)}".strip()
                known = ", ".join(cls.model_fields)
                raise finding((str(key),), value, f"{hint} known keys are {known}")
        return data
