"""All processes of a run over several hosts, as the supervisor of one host sees its own."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bags.mcap.writer import BagWriter
from bags.watch.carried import read_carried
from bags.watch.designs import design_scenario
from bags.wire.origin import attach_origin
from dcmg_bringup.hosts.agent import machine
from dcmg_bringup.hosts.hosts_file import HERE
from dcmg_bringup.hosts.job import HostJob, digest_of, files_of
from dcmg_bringup.hosts.listening import secret_key
from dcmg_bringup.hosts.offsets import in_words
from dcmg_bringup.hosts.remote import RemoteHost
from dcmg_nodes.wiring import wiring_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dcmg_bringup.hosts.hosts_file import HostsFile
    from dcmg_bringup.processes import Death, ProcessGroup
    from dcmg_nodes.options import NodeOptions
    from dgu_sim.scenario import Scenario

_LAST_WORDS_SEC = 8.0
_POLL_SEC = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """The other hosts of a run, connected.

    Attributes:
        addresses: of all hosts.
        placed: the nodes of each host, that of the command included.
        hosts: the others that have nodes.
    """

    addresses: Mapping[str, str]
    placed: Mapping[str, Sequence[str]]
    hosts: Sequence[RemoteHost]

    @property
    def here(self) -> Sequence[str]:
        """The nodes that run where the command is."""
        return self.placed[HERE]

    @property
    def peers(self) -> tuple[str, ...]:
        """Addresses of all hosts, each once."""
        return tuple(dict.fromkeys(self.addresses.values()))

    @property
    def taken(self) -> set[int]:
        """ROS domain ids that other runs have on other machines."""
        here = machine()
        return {domain for host in self.hosts if host.machine != here for domain in host.taken}

    def offer(self, scenario: Scenario, options: NodeOptions, domain: int, *, composed: bool) -> None:
        """Tell every host its part, and send the files that it lacks.

        Raises:
            HostsError: one refuses.
        """
        wiring = wiring_of(scenario)
        text = scenario.to_yaml().encode()
        contents: dict[str, Path | bytes] = {digest_of(text): text}
        history, designs = scenario.history.bag, options.designs
        bags = [
            None if bag is None else {name: _named(path, contents) for name, path in files_of(bag).items()}
            for bag in (None if history is None else Path(history), designs)
        ]
        seen = {machine()}
        for host in self.hosts:
            members = tuple(self.placed[host.name])
            job = HostJob(
                run=wiring.run,
                host=host.name,
                nodes={host.name: members} if composed else {name: (name,) for name in members},
                domain=domain,
                holds_domain=host.machine not in seen,
                address=host.address,
                peers=self.peers,
                pacing=options.pacing,
                rate=options.rate,
                start_timeout_sec=options.start_timeout_sec,
                stall_timeout_sec=options.stall_timeout_sec,
                scenario=digest_of(text),
                history=bags[0],
                designs=bags[1],
            )
            seen.add(host.machine)
            host.offer(job, contents)

    def offsets(self) -> list[str]:
        """Say how far the hosts' clocks are from ours."""
        return [in_words(host.name, host.offset) for host in self.hosts if host.offset is not None]


@contextmanager
def fleet_of(file: HostsFile, scenario: Scenario, source: str) -> Iterator[Fleet]:
    """Hold a connection to every host that has nodes of a scenario, for the time of the `with` block.

    Raises:
        HostsError: a rule of the file fits no node, or a host cannot be reached or computes with something else.
    """
    nodes = wiring_of(scenario).nodes
    file.check_nodes(nodes, source)
    placed = file.placed(nodes)
    wanted = [(name, file.hosts[name]) for name in placed if name != HERE]
    secret = secret_key(file.secret_file) if any(one.ssh is None for _, one in wanted) else b""
    hosts: list[RemoteHost] = []
    try:
        for name, settings in wanted:
            hosts.append(RemoteHost(name, settings, secret))
        addresses = {name: address for name, address in file.addresses.items() if name in placed}
        yield Fleet(addresses=addresses, placed=placed, hosts=hosts)
    finally:
        for host in hosts:
            host.close()


class FleetGroup:
    """The processes here and on the other hosts; see `ProcessGroup`.

    Args:
        local: those here.
        fleet: the other hosts, which have been told their parts.
        out: folder of the run, which gets the logs of all nodes and `hosts.json`.
    """

    def __init__(self, local: ProcessGroup, fleet: Fleet, out: Path) -> None:
        """Start the others."""
        self._local, self._fleet, self._out = local, fleet, out
        for host in fleet.hosts:
            host.start()

    def death(self) -> Death | None:
        """Return the first host that is lost, or process that ended with an error, if any."""
        found = [host.death() for host in self._seen()]
        return next((one for one in found if one is not None and one.kind == "host"), None) or next(
            (one for one in (self._local.death(), *found) if one is not None), None
        )

    def left(self) -> list[str]:
        """Return the names of the processes that ended well."""
        return self._local.left() + [name for host in self._seen() for name in host.left]

    def stopped(self) -> list[str]:
        """Return the names of the processes that a signal has stopped."""
        return self._local.stopped() + [name for host in self._seen() for name in host.stopped]

    def has_ended(self) -> bool:
        """Whether no node is left."""
        return self._local.has_ended() and all(host.has_ended for host in self._seen())

    def wait(self, timeout_sec: float) -> bool:
        """Wait for all processes to end by themselves; tell whether they did."""
        deadline = time.monotonic() + timeout_sec
        while not all(host.has_ended for host in self._seen()):
            if time.monotonic() > deadline:
                return False
            time.sleep(_POLL_SEC)
        return self._local.wait(max(0.0, deadline - time.monotonic()))

    def stop(self) -> None:
        """End everything: the recorder closes its bag, the other hosts send their logs."""
        for host in self._fleet.hosts:
            host.stop()
        self._local.stop()
        deadline = time.monotonic() + _LAST_WORDS_SEC
        while not all(host.is_over for host in self._seen()) and time.monotonic() < deadline:
            time.sleep(_POLL_SEC)
        for host in self._fleet.hosts:
            for name, text in host.logs.items():
                (self._out / "log" / name).write_bytes(text)
        (self._out / "hosts.json").write_text(json.dumps(self._document(), indent=1))

    def where(self, node: str) -> str:
        """Say on which other host a node is; nothing for one that is here."""
        placed = self._fleet.placed
        return next((f" on host {name}" for name, members in placed.items() if node in members and name != HERE), "")

    def _seen(self) -> Sequence[RemoteHost]:
        for host in self._fleet.hosts:
            host.look()
        return self._fleet.hosts

    def _document(self) -> dict[str, object]:
        """Where everything ran, and how far the clocks were apart."""
        return {
            host.name: {
                "address": host.address,
                "clock_offset_ns": None if host.offset is None else host.offset.offset_ns,
                "clock_offset_bound_ns": None if host.offset is None else host.offset.bound_ns,
            }
            for host in self._fleet.hosts
        }


def write_designs(scenario: Scenario, given: Path | None, path: Path) -> Path:
    """Design here what every monitor runs, so that all hosts run the very same, and write it as a bag.

    Args:
        scenario: what is run.
        given: bag with designs that are taken where they fit.
        path: of the bag.
    """
    designs = design_scenario(scenario, carried=None if given is None else read_carried(given))
    messages = [*designs.messages(), *(() if designs.team is None else designs.team.messages())]
    with BagWriter(path, [codec.topic for codec, _ in messages]) as writer:
        attach_origin(writer, scenario)
        for codec, record in messages:
            writer.write(codec.topic.name, 0, codec.encode(record))
    return path


def _named(path: Path, contents: dict[str, Path | bytes]) -> str:
    digest = digest_of(path.read_bytes())
    contents[digest] = path
    return digest
