"""docker/compose.yaml starts one container per node of the shipped six-DGU scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from typer.main import get_command

from bags.watch.scenarios import load_scenario
from dcmg.cli import app
from dcmg.shipped import scenario_path
from dcmg_nodes.wiring import wiring_of

SCENARIO = "gallo_six_dgu"
SERVICES: dict[str, Any] = yaml.safe_load((Path(__file__).parents[2] / "docker" / "compose.yaml").read_text())[
    "services"
]


def test_services_are_the_nodes_of_the_scenario() -> None:
    """Compose starts exactly the nodes that the run consists of, and names each service for its node."""
    assert tuple(SERVICES) == wiring_of(load_scenario(scenario_path(SCENARIO))).nodes


def test_commands_are_understood() -> None:
    """Each service's command is a `dcmg node` command for that node, in the command's own grammar."""
    node = get_command(app).commands["node"]  # type: ignore[attr-defined] # a group, as it has several commands
    for name, service in SERVICES.items():
        subcommand, *arguments = service["command"].split()
        parameters = node.make_context("node", arguments).params
        assert subcommand == "node"
        assert parameters["names"] == [name]
        assert parameters["scenario"] == SCENARIO
        assert str(parameters["out"]) == "/out"


def test_all_containers_share_one_image_network_and_folder() -> None:
    """All services differ in their command only."""
    shared = [{key: value for key, value in service.items() if key != "command"} for service in SERVICES.values()]
    assert all(settings == shared[0] for settings in shared)
