"""The attacks in the language of security: techniques of MITRE ATT&CK for ICS.

The newest releases of ATT&CK made sub-techniques of the two on reporting messages; `now` is their id there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["TECHNIQUES", "Technique", "techniques_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Technique:
    """A technique of ATT&CK for ICS.

    Attributes:
        id: Its number, as T0830.
        name: Its name.
        now: Its number in the newest releases, where that is another.
    """

    id: str
    name: str
    now: str = ""

    def __str__(self) -> str:
        """Number and name."""
        return f"{self.id} {self.name}" + (f" (now {self.now})" if self.now else "")


_MIDDLE = Technique(id="T0830", name="Adversary-in-the-Middle")
_SPOOF = Technique(id="T0856", name="Spoof Reporting Message", now="T1692.002")
_BLOCK = Technique(id="T0804", name="Block Reporting Message", now="T1691.002")
_FALSIFY = (_MIDDLE, _SPOOF)

TECHNIQUES: Mapping[str, tuple[Technique, ...]] = {
    "bias": _FALSIFY,
    "bias_ramp": _FALSIFY,
    "bias_sine": _FALSIFY,
    "bias_pulse": _FALSIFY,
    "bias_random": _FALSIFY,
    "bias_waveform": _FALSIFY,
    "scaling": _FALSIFY,
    "freeze": _FALSIFY,
    "delay": (_MIDDLE,),
    "drop": (_MIDDLE, _BLOCK),
    "replay": _FALSIFY,
    "zero_sum": _FALSIFY,
    "uio_stealthy_plane": _FALSIFY,
    "uio_stealthy_trajectory": _FALSIFY,
    "luenberger_stealthy": _FALSIFY,
    "covert": _FALSIFY,
    "spoof": (_SPOOF,),
}
"""By kind of attack: a relay on the link is in the middle, a second publisher is not."""


def techniques_of(kind: str) -> tuple[Technique, ...]:
    """Techniques of a kind of attack, none where none is known to match."""
    return TECHNIQUES.get(kind, ())
