"""`dcmg run --hosts`, with hosts that are this machine: reached by TCP and by ssh, compared, refused."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
import yaml

from dcmg_bringup.hosts.listening import SECRET_VARIABLE
from tests.ros.conftest import DCMG, Finished, run_dcmg
from tests.ros.test_identity import payloads

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

SECRET = "the secret of these tests"  # noqa: S105 - no secret of anybody's
OTHER = "from dcmg_bringup.hosts import versions as it; it._digest = lambda: 'other'; from dcmg.cli import main; main()"


@contextmanager
def waiting_host(*dcmg: str) -> Iterator[int]:
    """Have a `dcmg host` wait on this machine; gives its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    command = [*(dcmg or DCMG), "host", "--listen", f"127.0.0.1:{port}"]
    environment = {**os.environ, SECRET_VARIABLE: SECRET}
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "waits on" in process.stderr.readline()
        try:
            yield port
        finally:
            process.terminate()
            process.communicate(timeout=30.0)


def _file(folder: Path, hosts: Mapping[str, object], place: Mapping[str, object]) -> Path:
    path = folder / "hosts.yaml"
    path.write_text(yaml.safe_dump({"here": "127.0.0.1", "hosts": dict(hosts), "place": dict(place)}, sort_keys=False))
    return path


@pytest.fixture(autouse=True)
def _secret(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SECRET_VARIABLE, SECRET)


def test_a_host_that_waits_and_one_by_ssh(
    tmp_path: Path,
    short_scenario: Path,
    short_runs: Mapping[str, tuple[Path, Finished]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The bag is that of a run on one machine, byte for byte; all logs are here, and all clocks are the same."""
    client = tmp_path / "bin" / "ssh"  # what sshd does with the command line at the other end
    client.parent.mkdir()
    client.write_text('#!/bin/sh\nfor last; do :; done\nexec sh -c "$last"\n')
    client.chmod(0o755)
    monkeypatch.setenv("PATH", str(client.parent), prepend=os.pathsep)
    dcmg = tmp_path / "the dcmg of lab3"
    dcmg.write_text(f'#!/bin/sh\nexec {sys.executable} -m dcmg "$@"\n')
    dcmg.chmod(0o755)
    with waiting_host() as port:
        hosts = {
            "lab2": {"address": "127.0.0.1", "port": port},
            "lab3": {"address": "127.0.0.1", "ssh": "me@lab3", "command": str(dcmg)},
        }
        place = {"dgu_*": ["lab2", "lab3", "here"], "monitor_*": ["lab3", "lab2"], "attacker": "lab3"}
        finished = run_dcmg(
            "run", short_scenario, "--hosts", _file(tmp_path, hosts, place), "--no-plots", "--out", tmp_path / "run"
        )
    assert finished.code == 0, finished.err
    expected, found = payloads(short_runs["processes"][0]), payloads(tmp_path / "run" / "bag")
    assert found.keys() == expected.keys()
    assert [topic for topic in expected if found[topic] != expected[topic]] == []
    assert {path.stem for path in (tmp_path / "run" / "log").iterdir()} >= {"attacker", "dgu_1", "dgu_2", "monitor_6"}
    for said in json.loads((tmp_path / "run" / "hosts.json").read_text()).values():
        assert abs(said["clock_offset_ns"]) <= said["clock_offset_bound_ns"]


def test_clocks_are_told_in_real_time(tmp_path: Path) -> None:
    """With one process a host, too; the clock of this machine is its own, so that no difference is seen."""
    with waiting_host() as port:
        file = _file(tmp_path, {"lab2": {"address": "127.0.0.1", "port": port}}, {"dgu_1": "lab2", "monitor_*": "lab2"})
        options = ("--duration", "0.5", "--pacing", "realtime", "--composed", "--no-plots", "--out", tmp_path / "run")
        finished = run_dcmg("run", "isolated_dgu_1", "--hosts", file, *options)
    assert finished.code == 0, finished.err
    assert "clock of host lab2: the same as here, to " in finished.err


def test_what_computes_otherwise_or_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other code, another secret, and nobody at all: one line with the host, exit code 2, before anything starts."""
    with waiting_host(sys.executable, "-c", OTHER) as port:
        file = _file(tmp_path, {"lab2": {"address": "127.0.0.1", "port": port}}, {"dgu_1": "lab2"})
        run = ("run", "isolated_dgu_1", "--hosts", file, "--out", tmp_path / "run")
        other = run_dcmg(*run)
        monkeypatch.setenv(SECRET_VARIABLE, "another secret than theirs")
        stranger = run_dcmg(*run)
    nobody = run_dcmg(*run)
    said = {"has the code of dcmg other": other, "closed the connection": stranger, "is not reached": nobody}
    for words, finished in said.items():
        assert finished.code == 2
        assert finished.err.splitlines()[-1].startswith(f"dcmg: host lab2 (127.0.0.1:{port}) {words}")
    assert not (tmp_path / "run").exists()
