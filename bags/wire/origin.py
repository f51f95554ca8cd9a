"""What a bag says about its making: the scenario and the versions of what computed it."""

import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from bags.mcap.writer import BagWriter
from bags.wire.plugins import ATTACKS, installed, used_plug_ins, with_plug_ins
from dgu_sim.scenario import Scenario
from engine import chosen

SCENARIO_ATTACHMENT = "scenario.yaml"
HOST_ATTACHMENT = "host.json"
MONITOR_ATTACHMENT = "monitor.yaml"  # of a stream from outside, which has no scenario
VERSIONS_ATTACHMENT = "versions.json"
_PACKAGES = ("dcmg", "numpy", "scipy", "mcap", "rosbags")


def attach_origin(
    writer: BagWriter, scenario: Scenario, host: Mapping[str, object] | None = None, *, by_hand: bool = False
) -> None:
    """Put the fully resolved scenario (seed included), the versions and the host into a bag.

    What was designed from which history is in the messages of the run: `/dgu_i/history`, `/dgu_j/design/dgu_i`.

    Args:
        writer: Of the bag.
        scenario: What is run.
        host: What `host_facts` gave; None: two bags of equal runs are equal byte by byte, wherever they were made.
        by_hand: Whether attacks of every installed kind may be started while the run goes on.

    Raises:
        BagError: The disk refuses.
    """
    writer.attach(SCENARIO_ATTACHMENT, scenario.to_yaml().encode(), "application/yaml")
    attach_versions(writer, used_plug_ins(scenario.model_dump(mode="json"), installed(ATTACKS) if by_hand else ()))
    if host is not None:
        writer.attach(HOST_ATTACHMENT, json.dumps(dict(host), indent=1).encode(), "application/json")


def attach_versions(writer: BagWriter, plug_ins: Mapping[str, str]) -> None:
    """Put the versions of what computed it into a bag.

    Args:
        writer: Of the bag.
        plug_ins: What `used_plug_ins` gave.

    Raises:
        BagError: The disk refuses.
    """
    packages = {name: _version(name) for name in _PACKAGES}
    text = json.dumps({"python": platform.python_version(), "engine": chosen(), **packages}, indent=1).encode()
    writer.attach(VERSIONS_ATTACHMENT, with_plug_ins(text, plug_ins), "application/json")


def host_facts() -> dict[str, object]:
    """Where and when a bag is made."""
    return {
        "name": platform.node(),
        "system": platform.platform(),
        "machine": platform.machine(),
        "processors": os.cpu_count(),
        "started": datetime.now(tz=UTC).isoformat(timespec="seconds"),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
