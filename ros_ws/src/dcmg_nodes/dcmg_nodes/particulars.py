"""What the nodes of a run are, as ROS parameters of their faces: descriptions, ranges, and read-only, all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from bags.wire.schema import dgu_name, monitor_name
from bags.wire.settings import settings_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.node import Node

    from dgu_sim.scenario import Scenario

_LARGEST = 2**63 - 1
_LONGEST_SEC = 1e7
_CHANGE = "Read-only: a run is what its scenario says."


def tell(node: Node, scenario: Scenario) -> None:
    """Declare the parameters of one node, by its name in the run."""
    for name, value, description in (*_of_the_run(scenario), *_of_the_node(node.get_name(), scenario)):
        node.declare_parameter(name, value, _descriptor(description, value))


def _descriptor(description: str, value: float | str) -> ParameterDescriptor:
    found = ParameterDescriptor(description=description, read_only=True, additional_constraints=_CHANGE)
    if isinstance(value, float):
        found.floating_point_range = [FloatingPointRange(from_value=0.0, to_value=_LONGEST_SEC)]
    elif isinstance(value, int):
        found.integer_range = [IntegerRange(from_value=0, to_value=_LARGEST, step=1)]
    return found


def _of_the_run(scenario: Scenario) -> Iterator[tuple[str, float | str, str]]:
    yield "scenario", scenario.name, "Name of the scenario that is run."
    yield "seed", scenario.seed, "Seed of everything random."
    yield "sampling_period_sec", scenario.sampling_period_sec, "Sampling period T_s [s]."
    yield "steps", scenario.steps, "Number of steps of the run."


def _of_the_node(name: str, scenario: Scenario) -> Iterator[tuple[str, float | str, str]]:
    settings = settings_of(scenario)
    for dgu in (one.id for one in scenario.dgus):
        if name in {dgu_name(dgu), monitor_name(dgu)}:
            heard = ", ".join(str(link) for link in scenario.links if link.target == dgu)
            yield "dgu", dgu, "Number of the DGU that the node belongs to."
            yield "links", heard, "Links on which it receives, as SOURCE-TARGET."
        if name == monitor_name(dgu):
            yield "observer", settings.observer.kind, "Kind of the observers of these links."
            yield "detector", settings.detector.kind, "Kind of the detectors of these links."
