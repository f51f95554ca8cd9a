"""What must be the same on all hosts of a run: what computes, down to the code."""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from importlib import import_module, metadata
from pathlib import Path

_PACKAGES = ("dcmg", "numpy", "scipy", "pydantic", "ros-jazzy-rclpy")
_CODE = ("dgu_sim", "monitor", "bags", "dcmg_nodes")
_SHOWN = 12


@cache
def versions() -> dict[str, str]:
    """Return the versions of what computes, and a digest of our own code.

    numpy draws the noise, scipy knows the distributions that thresholds come from; Python only calls them.
    """
    found = {name: _version(name) for name in _PACKAGES}
    return found | {"code": _digest()}


def differing(theirs: object) -> str:
    """Tell in words the first version that is not ours; nothing when all are the same."""
    said = theirs if isinstance(theirs, dict) else {}
    for name, own in versions().items():
        if said.get(name) != own:
            what = "the code of dcmg" if name == "code" else name
            return f"has {what} {said.get(name, 'unknown')}, expected {own}, as here"
    return ""


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"  # of a system's own ROS


def _digest() -> str:
    total = sha256()
    for package in _CODE:
        root = Path(str(import_module(package).__file__)).parent
        for path in sorted(root.rglob("*.py")):
            total.update(f"{package}/{path.relative_to(root)}\n".encode() + path.read_bytes())
    return total.hexdigest()[:_SHOWN]
