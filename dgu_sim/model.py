"""The base of everything a scenario file is validated into."""

from collections.abc import Mapping, Sequence
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from dgu_sim.suggestions import meant

__all__ = ["Frozen", "Number", "Spread3", "Vector3", "check_keys", "finding"]

_LARGEST = 1e15


def finding(key: tuple[str | int, ...], value: object, expected: str) -> PydanticCustomError:
    """Return the validation error that `key` (relative to the model) has `value` and something else was expected.

    `dgu_sim.scenario_file` turns it into one line with the file and the whole key path.
    """
    return PydanticCustomError("finding", "{expected}", {"key": key, "value": value, "expected": expected})


def check_keys(data: Mapping[str, object], known: Sequence[str]) -> None:
    """Raise the validation error of the first key that is not among the known ones."""
    for key in data:
        if key not in known:
            hint = f"no such key: {meant(key, known)}".strip()
            raise finding((str(key),), data[key], f"{hint} known keys are {', '.join(known)}")


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
        raise PydanticCustomError(
            "number", "expected a number of at most 1e15: larger ones overflow when squared often"
        )
    return value


Number: TypeAlias = Annotated[float, BeforeValidator(_not_bool), AfterValidator(_not_huge)]
"""A finite float. YAML 1.1 reads 1e-6 as text, which is accepted; yes and no are not."""

Vector3: TypeAlias = Annotated[tuple[Number, Number, Number], BeforeValidator(_three)]
"""One number for each of V, I_t and v."""

Spread3: TypeAlias = Annotated[
    tuple[Annotated[Number, Field(ge=0)], Annotated[Number, Field(ge=0)], Annotated[Number, Field(ge=0)]],
    BeforeValidator(_three),
]
"""One non-negative number for each of V, I_t and v."""


class Frozen(BaseModel):
    """Immutable, finite numbers only, and an unknown key is an error that names the known ones."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: object) -> object:
        if not isinstance(data, Mapping):
            return data
        check_keys(data, tuple(field.alias or name for name, field in cls.model_fields.items()))
        return data
