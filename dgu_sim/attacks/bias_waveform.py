"""A bias that follows a recorded or drawn curve."""

from functools import cached_property
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from dgu_sim.attacks.profile import Profile
from dgu_sim.linear import FloatArray
from dgu_sim.model import Number, Vector3, finding
from dgu_sim.table import Table

__all__ = ["BiasWaveform"]

_COLUMNS = ("voltage_v", "current_a", "integral_vs")


class BiasWaveform(Table, Profile):
    """phi = scale * (row of the table), times since the attack's start; a component without a column stays 0.

    Instead of the lists, a scenario and `dcmg attack start` take a CSV file: `file`, and `columns` where its header has
    other names than these.
    """

    voltage_v: tuple[Number, ...] = Field(default=(), description="phi for V at each time [V].")
    current_a: tuple[Number, ...] = Field(default=(), description="phi for I_t at each time [A].")
    integral_vs: tuple[Number, ...] = Field(default=(), description="phi for v at each time [V s].")
    scale: Number = Field(default=1.0, description="Factor of all columns.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = {name: len(getattr(self, name)) for name in _COLUMNS if getattr(self, name)}
        if not given:
            raise finding(("voltage_v",), [], f"expected at least one of {', '.join(_COLUMNS)}")
        for name, count in given.items():
            self.check_rows(name, count)
        return self

    def phi(self, elapsed: int, sampling_period_sec: float) -> Vector3:
        """Return phi, `elapsed` samples after the first affected one."""
        step = np.array([elapsed])
        V, I_t, v = (self.scale * float(self.values(one, step, sampling_period_sec)[0]) for one in self._phi)
        return V, I_t, v

    @cached_property
    def _phi(self) -> tuple[FloatArray, ...]:
        rows = len(self.time_sec)
        return tuple(np.array(getattr(self, name) or (0.0,) * rows) for name in _COLUMNS)
