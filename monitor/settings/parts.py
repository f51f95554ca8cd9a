"""The parts of what a monitor is told: what every DGU runs on what it receives."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from monitor.detectors import Detector, attack_free_sec, build, filled_in
from monitor.errors import OptionError
from monitor.settings.base import Settings, finding

__all__ = [
    "DetectorSettings",
    "EstimatorSettings",
    "LimitSettings",
    "LocalSettings",
    "ObserverSettings",
    "PlausibilitySettings",
    "ResponseSettings",
]


class ObserverSettings(Settings):
    """How a monitor designs its observer; checked by the monitor."""

    kind: str = Field(default="full_order", description="Name of the design method.")
    options: dict[str, object] = Field(default_factory=dict, description="Options of the design method.")


class DetectorSettings(Settings):
    """How a monitor turns residuals into alarms; checked by the monitor."""

    kind: str = Field(default="fixed", description="Name of the detector.")
    options: dict[str, object] = Field(
        default_factory=dict,
        description="Options of the detector: docs/scenario.md lists them for each kind.",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: object) -> object:
        """Make the detector's defaults explicit: the resolved scenario says everything a run used."""
        if not isinstance(data, Mapping) or not isinstance(data.get("options", {}), Mapping):
            return data
        try:
            return {**data, "options": filled_in(data.get("kind", "fixed"), data.get("options", {}))}
        except OptionError as error:
            raise finding(error.key, error.value, error.expected) from None

    @property
    def calibrated_sec(self) -> float:
        """Time at which an attack may start [s]: settling and calibration have ended."""
        return attack_free_sec(self.options)

    def build(self, sampling_period_sec: float) -> Detector[Any]:
        """Build the detector.

        Raises:
            MonitorError: an option does not fit the sampling period.
        """
        return build(self.kind, self.options, sampling_period_sec)


class LocalSettings(Settings):
    """The module of the own state: neighbours' received voltages against the own measurement."""

    decay: float = Field(default=0.5, gt=0, lt=1, description="Largest modulus of the observer's eigenvalues.")
    load_sec: float = Field(
        default=0.5, ge=0, description="The nominal load is learned this long at the start [s]; 0: from the history."
    )
    load_range_a: float = Field(
        default=0.0, ge=0, description="The own load stays this close to its nominal value [A]: less is no alarm."
    )
    detector: DetectorSettings = Field(default_factory=DetectorSettings, description="The detector on its residual.")

    @property
    def calibrated_sec(self) -> float:
        """Time at which an attack may start [s]."""
        return self.load_sec + self.detector.calibrated_sec


class EstimatorSettings(Settings):
    """How an unknown input is reconstructed; checked by the monitor."""

    kind: str = Field(default="one_step", description="Name of the design method.")
    options: dict[str, object] = Field(default_factory=dict, description="Options of the design method.")


class LimitSettings(Settings):
    """What is plausible of a neighbour's input: net and load current, and reference."""

    settle_sec: float = Field(default=0.5, ge=0, description="Time after every (re)start without a verdict [s].")
    calibrate_sec: float = Field(default=2.0, gt=0, description="Attack-free stretch that the limits come from [s].")
    margin: float = Field(default=0.5, ge=0, description="Share of the width seen there that is allowed on top.")
    range: tuple[float, float] = Field(
        default=(1.0, 0.1), description="[A, V] by which the inputs are known, or allowed, to leave what was seen."
    )
    rate: tuple[float, float] | None = Field(
        default=None, description="[A/s, V/s] by which changes may be faster than seen; default: not tested."
    )

    @model_validator(mode="after")
    def _not_negative(self) -> "LimitSettings":
        for name in ("range", "rate"):
            values = getattr(self, name)
            if values is not None and min(values) < 0.0:
                raise finding((name,), list(values), "expected two numbers that are not negative")
        return self


class PlausibilitySettings(Settings):
    """The test of what must have acted on a neighbour if it tells the truth."""

    estimator: EstimatorSettings = Field(default_factory=EstimatorSettings, description="The estimator of the input.")
    limits: LimitSettings = Field(default_factory=LimitSettings, description="What is plausible.")

    @property
    def calibrated_sec(self) -> float:
        """Time at which an attack may start [s]."""
        return self.limits.settle_sec + self.limits.calibrate_sec


class ResponseSettings(Settings):
    """Secondary control goes on without an accused link."""

    quiet_sec: float = Field(
        default=5.0, ge=0, description="A link is heard again after this long without an accusation [s]."
    )
