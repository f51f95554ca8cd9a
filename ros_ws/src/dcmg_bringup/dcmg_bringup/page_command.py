"""`dcmg page --attach`: the page of a run over ROS 2."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dcmg.errors import CommandError
from dcmg_bringup.attack_client import find_system
from dcmg_bringup.ros_environment import ros_environment

if TYPE_CHECKING:
    from collections.abc import Iterator


def attach_page(domain: int | None, host: str, port: int, *, browser: bool) -> None:
    """Serve the page of a running system.

    Raises:
        CommandError: none runs, or what it runs is not known.
        ScenarioError: what it runs is not valid here.
    """
    system = find_system(domain)
    path = Path(system.out) / "scenario.yaml"
    if not system.out or not path.is_file():
        where = f"in ROS domain {system.domain}"
        raise CommandError(f"no run of this machine {where} says what it runs: expected one of `dcmg run`")
    from bags.watch.scenarios import load_scenario  # noqa: PLC0415 (heavy)
    from dcmg.page.serving import serve  # noqa: PLC0415 (heavy)

    scenario = load_scenario(path)
    os.environ.update(ros_environment(system.domain))
    from dcmg_bringup.page_source import RosRun  # noqa: PLC0415 (rclpy only in the domain just set)

    serve(RosRun(system, scenario), host, port, browser=browser)


@contextmanager
def page_beside(domain: int) -> Iterator[None]:
    """Show the run of a domain in a browser, from a process of its own, while the `with` block lasts.

    Its address goes to standard error (standard output carries the result of the run); on a terminal a browser opens.
    """
    browser = "--browser" if sys.stderr.isatty() else "--no-browser"
    command = [sys.executable, "-m", "dcmg", "page", "--attach", "--domain", str(domain), browser]
    with subprocess.Popen(command, stdout=sys.stderr) as process:  # noqa: S603 (our own)
        try:
            yield
        finally:
            process.terminate()
