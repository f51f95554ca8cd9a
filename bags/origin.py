"""What a bag says about its making: the scenario and the versions of what computed it."""

import json
import platform
from importlib.metadata import PackageNotFoundError, version

from bags.writer import BagWriter
from dgu_sim.scenario import Scenario

SCENARIO_ATTACHMENT = "scenario.yaml"
VERSIONS_ATTACHMENT = "versions.json"
_PACKAGES = ("dcmg", "numpy", "scipy", "mcap", "rosbags")


def attach_origin(writer: BagWriter, scenario: Scenario) -> None:
    """Put the fully resolved scenario (seed included) and the versions into a bag.

    Raises:
        BagError: The disk refuses.
    """
    writer.attach(SCENARIO_ATTACHMENT, scenario.to_yaml().encode(), "application/yaml")
    versions = {"python": platform.python_version(), **{name: _version(name) for name in _PACKAGES}}
    writer.attach(VERSIONS_ATTACHMENT, json.dumps(versions, indent=1).encode(), "application/json")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
