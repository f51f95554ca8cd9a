"""Three hosts for the tests of this folder, and at the end one line of what was compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.hosts.lab import DCMG, Lab, LabError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

COMPARED: list[str] = []
FILE = """
here: 10.9.0.1
hosts:
  lab2: {address: 10.9.0.2}
  lab3: {address: 10.9.0.3}
place:
  dgu_*: [lab2, lab3, here]
  monitor_*: [lab3, lab2]
  attacker: lab3
"""


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """Three hosts on one network; `dcmg host` waits on two of them."""
    try:
        made = Lab(tmp_path, 3).__enter__()
    except LabError as error:
        pytest.skip(f"no hosts out of namespaces on this machine: {error}")
    (tmp_path / "hosts.yaml").write_text(FILE)
    try:
        for name in ("lab2", "lab3"):
            waiting = made.start(name, *DCMG, "host", "--listen", made.machines[name].address)
            assert waiting.stderr is not None
            assert "waits on" in waiting.stderr.readline()
        yield made
    finally:
        made.__exit__()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was compared."""
    if COMPARED:
        terminalreporter.write_line(f"hosts: {'; '.join(COMPARED)}")
