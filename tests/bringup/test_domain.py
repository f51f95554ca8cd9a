"""ROS domain ids: chosen free, given back, and the list of running systems."""

from __future__ import annotations

import os
import socket

import pytest

from dcmg_bringup.domain import DomainError, choose_domain, running_systems


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
