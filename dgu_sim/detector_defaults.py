"""Options of the detectors as the resolved scenario shows them: it says everything a run used."""

from collections.abc import Mapping

__all__ = ["DETECTORS", "attack_free_sec", "filled_in"]

DETECTORS: Mapping[str, Mapping[str, object]] = {
    "fixed": {"settle_sec": 0.5, "calibrate_sec": 2.0, "margin": 5.0, "floor": 1e-6},
    "noise_bound": {"settle_sec": 0.5, "floor": 1e-9},
    "chi_squared": {"settle_sec": 0.5, "calibrate_sec": 2.0, "rate": 1e-4, "floor": 1e-9},
    "cusum": {
        "settle_sec": 0.5,
        "calibrate_sec": 2.0,
        "drift": 1.3,
        "between_sec": 3600.0,
        "margin": 1.2,
        "floor": 1e-9,
    },
    "n_of_m": {"n": 3, "m": 5, "kind": "fixed", "options": {}},
    "calibrated": {"settle_sec": 0.5, "calibrate_sec": 10.0, "rate": 0.01, "floor": 1e-9},
}
"""Default options by kind; monitor has the same, and a test holds them together."""


def filled_in(kind: object, options: Mapping[str, object]) -> dict[str, object]:
    """Return the options with the defaults of their kind; a kind that is not known here keeps them as they are."""
    filled = {**DETECTORS.get(str(kind), {}), **options}
    inner = filled.get("options")
    if kind in DETECTORS and isinstance(inner, Mapping):
        filled["options"] = filled_in(filled.get("kind"), inner)
    return filled


def attack_free_sec(options: Mapping[str, object]) -> float:
    """Return the time at which settling and calibration have ended [s], those of an inner detector included."""
    times = [options.get(key, 0.0) for key in ("settle_sec", "calibrate_sec")]
    inner = options.get("options")
    own = sum((float(time) for time in times if isinstance(time, int | float)), 0.0)
    return own + (attack_free_sec(inner) if isinstance(inner, Mapping) else 0.0)
