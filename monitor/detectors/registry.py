"""The detectors by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from monitor.detectors import calibrated, chi_squared, cusum, fixed, n_of_m, noise_bound
from monitor.errors import PlugInError
from monitor.options import known_kind, parse_options, within
from monitor.plugins import Kinds

if TYPE_CHECKING:
    from collections.abc import Callable

    from pydantic.fields import FieldInfo

    from monitor.detectors.protocol import Detector

GROUP = "dcmg.detectors"


@dataclass(frozen=True, slots=True)
class Kind:
    """How detectors of a kind are built.

    Attributes:
        options: their options, a frozen pydantic dataclass.
        build: makes one of its options and T_s.
    """

    options: type
    build: Callable[[Mapping[str, object], float], Detector[Any]]

    def __call__(self, options: Mapping[str, object], sampling_period_sec: float) -> Detector[Any]:
        """Build one."""
        return self.build(options, sampling_period_sec)


def build(kind: str, options: Mapping[str, object], sampling_period_sec: float) -> Detector[Any]:
    """Build a detector of this kind.

    Raises:
        MonitorError: unknown kind or option.
    """
    return known_kind("detector", kind, KINDS)(options, sampling_period_sec)


def filled_in(kind: object, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with the defaults of their kind, those of an inner detector included.

    Raises:
        OptionError: unknown kind or option, or a value that does not fit.
    """
    made = known_kind("detector", str(kind), KINDS)
    if not isinstance(made, Kind):
        return dict(options)
    parse_options(made.options, options, str(kind))
    known: dict[str, FieldInfo] = made.options.__pydantic_fields__  # type: ignore[attr-defined]  # pydantic's dataclass
    defaults = {
        name: one.get_default(call_default_factory=True) for name, one in known.items() if not one.is_required()
    }
    filled = {**defaults, **options}
    inner = filled.get("options")
    if isinstance(inner, Mapping):
        with within("options"):
            filled["options"] = filled_in(filled.get("kind"), inner)
    return filled


def attack_free_sec(options: Mapping[str, object]) -> float:
    """Return the time at which settling and calibration have ended [s], those of an inner detector included."""
    times = [options.get(key, 0.0) for key in ("settle_sec", "calibrate_sec")]
    inner = options.get("options")
    own = sum((float(time) for time in times if isinstance(time, int | float)), 0.0)
    return own + (attack_free_sec(inner) if isinstance(inner, Mapping) else 0.0)


_SHIPPED: Mapping[str, Callable[[Mapping[str, object], float], Detector[Any]]] = {
    fixed.KIND: Kind(fixed.FixedOptions, fixed.build),
    noise_bound.KIND: Kind(noise_bound.NoiseBoundOptions, noise_bound.build),
    chi_squared.KIND: Kind(chi_squared.ChiSquaredOptions, chi_squared.build),
    cusum.KIND: Kind(cusum.CusumOptions, cusum.build),
    n_of_m.KIND: Kind(n_of_m.NOfMOptions, n_of_m.builder(build)),
    calibrated.KIND: Kind(calibrated.CalibratedOptions, calibrated.build),
}
"""How each kind is built: one line for a new one."""


def _checked(kind: str, found: object) -> Kind:
    if not isinstance(found, Kind):
        raise PlugInError(f"{kind} is {found!r}, expected a monitor.detectors.Kind(options, build)")
    return found


KINDS: Kinds[Callable[[Mapping[str, object], float], Detector[Any]]] = Kinds(GROUP, _SHIPPED, _checked)
"""All kinds: ours, and those of installed packages (docs/plugins.md)."""
