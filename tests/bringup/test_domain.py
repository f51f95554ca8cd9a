"""ROS domain ids: chosen free, given back, and the list of running systems."""

from __future__ import annotations

import os
import socket
import tempfile
from typing import TYPE_CHECKING

import pytest

from dcmg_bringup.domain import DomainError, choose_domain, running_systems

if TYPE_CHECKING:
    from pathlib import Path


def test_two_choices_at_once_differ() -> None:
    """Two runs of one machine hold different domains."""
    with choose_domain() as first, choose_domain() as second:
        assert first != second


def test_a_held_domain_is_listed_with_its_run_and_refused_to_others() -> None:
    """While held, the domain is a running system; asking for it by number fails; afterwards it is free again."""
    with choose_domain(scenario="mine", out="somewhere") as domain:
        found = [system for system in running_systems() if system.domain == domain]
        assert [(system.pid, system.scenario, system.out) for system in found] == [(os.getpid(), "mine", "somewhere")]
        with pytest.raises(DomainError, match=f"ROS domain id {domain} is taken"), choose_domain(domain):
            pass
    assert domain not in [system.domain for system in running_systems()]


def test_a_domain_with_a_foreign_participant_is_passed_over() -> None:
    """A domain whose DDS port somebody else has bound is not chosen."""
    with choose_domain() as domain:
        pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign:
        foreign.bind(("", 7400 + 250 * domain + 10))
        with choose_domain() as other:
            assert other != domain


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the locks are when no runtime directory is set."""
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path / f"dcmg-{os.getuid()}"


def test_the_folder_of_locks_is_the_users_own(own_folder: Path) -> None:
    """Nobody else may look into it or write to it."""
    with choose_domain():
        assert own_folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_can_write_to_is_refused(own_folder: Path) -> None:
    """Somebody may have made it beforehand to put links into it."""
    own_folder.mkdir()
    own_folder.chmod(0o777)
    with pytest.raises(DomainError, match="yours alone"), choose_domain():
        pass


def test_a_linked_folder_is_refused(own_folder: Path, tmp_path: Path) -> None:
    """A symbolic link in the place of the folder leads nowhere."""
    (tmp_path / "victim").mkdir(mode=0o700)
    own_folder.symlink_to(tmp_path / "victim")
    with pytest.raises(DomainError, match="yours alone"), choose_domain():
        pass
    assert list((tmp_path / "victim").iterdir()) == []


def test_a_linked_lock_file_is_not_followed(own_folder: Path, tmp_path: Path) -> None:
    """What a link in the place of a lock points to keeps its content."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    own_folder.mkdir(mode=0o700)
    (own_folder / "domain_1.json").symlink_to(victim)
    with pytest.raises(DomainError, match=r"domain_1\.json"), choose_domain(1):
        pass
    assert victim.read_text() == "precious"


@pytest.mark.parametrize("garbage", [b"\xff\xfe", b"{", b"[" * 100_000, b'{"pid": "x"}', b"[]"])
def test_garbage_in_a_lock_file_is_a_run_nobody_knows_about(own_folder: Path, garbage: bytes) -> None:
    """A held lock means that the domain is taken, whatever its file says."""
    with choose_domain() as domain:
        (own_folder / f"domain_{domain}.json").write_bytes(garbage)
        assert [(system.domain, system.scenario) for system in running_systems()] == [(domain, "unknown")]
    with choose_domain(domain):
        pass
