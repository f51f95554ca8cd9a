"""The file of `dcmg run --hosts`: the machines of a run, and which node runs on which."""

from __future__ import annotations

import re
from collections import Counter
from fnmatch import fnmatchcase
from ipaddress import IPv4Address
from pathlib import Path  # noqa: TC003 (pydantic reads the annotations)
from typing import TYPE_CHECKING, Annotated, Self, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from dcmg_bringup.hosts.errors import HostsError
from dcmg_bringup.hosts.listening import DEFAULT_PORT
from dcmg_nodes.wiring import RECORDER_NODE
from dgu_sim.model import Frozen, finding
from dgu_sim.scenario_file import parse_yaml, read_text, validated
from dgu_sim.suggestions import meant

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

HERE = "here"
_WILD = re.compile(r"[*?\[]")
_NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,62}$"


def _one_or_more(value: object) -> object:
    return [value] if isinstance(value, str) else value


def _address(text: str) -> str:
    try:
        found = IPv4Address(text)
    except ValueError:
        raise finding((), text, "expected an IPv4 address of the network interface to use, as 192.168.7.2") from None
    if found.is_unspecified or found.is_multicast:
        raise finding((), text, "expected the IPv4 address of one interface")
    return str(found)


Address: TypeAlias = Annotated[str, AfterValidator(_address)]


class HostSettings(Frozen):
    """One machine besides that of the command."""

    address: Address = Field(description="IPv4 address of the interface that carries the messages of the run.")
    port: int = Field(default=DEFAULT_PORT, ge=1, le=65535, description="Where `dcmg host` waits.")
    ssh: str | None = Field(
        default=None, pattern=r"^[^\s-]\S*$", description="USER@MACHINE or what ~/.ssh/config calls it."
    )
    command: str = Field(default="dcmg", min_length=1, description="The command there, with ssh: a path, if need be.")


class HostsFile(Frozen):
    """A hosts file."""

    here: Address = Field(description="Address of the machine of the command on the network of the run.")
    hosts: dict[Annotated[str, Field(pattern=_NAME)], HostSettings] = Field(min_length=1, description="The others.")
    place: dict[str, Annotated[tuple[str, ...], BeforeValidator(_one_or_more), Field(min_length=1)]] = Field(
        min_length=1,
        description="Name or pattern (dgu_*) of nodes -> host, or hosts in turn; `here` has what is left.",
    )
    secret_file: Path | None = Field(default=None, description="Holds the secret that `dcmg host` shares.")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if HERE in self.hosts:
            raise finding(("hosts", HERE), HERE, f"expected another name: {HERE} is the machine of the command")
        known = (HERE, *self.hosts)
        for pattern, names in self.place.items():
            for name in names:
                if name not in known:
                    hint = meant(name, known)
                    raise finding(("place", pattern), name, f"expected a host: {', '.join(known)} {hint}".strip())
        far = [one.address for one in self.hosts.values()]
        if len({IPv4Address(address).is_loopback for address in (self.here, *far)}) > 1:
            raise finding(
                ("here",), self.here, "expected loopback addresses only, or none: hosts must reach each other"
            )
        return self

    @property
    def addresses(self) -> dict[str, str]:
        """Address of each host, that of the command included."""
        return {HERE: self.here} | {name: one.address for name, one in self.hosts.items()}

    def placed(self, nodes: Sequence[str]) -> Mapping[str, tuple[str, ...]]:
        """Return the nodes of each host that has any, the command's own first.

        A node's own name goes before patterns, of these the first that fits; hosts of a list take nodes in turn.
        """
        turns: Counter[str] = Counter()
        found: dict[str, list[str]] = {HERE: [], **{name: [] for name in self.hosts}}
        for node in nodes:
            rule = node if node in self.place else next((one for one in self.place if fnmatchcase(node, one)), None)
            hosts = (HERE,) if rule is None else self.place[rule]
            turn = turns[rule or ""]
            turns[rule or ""] += 1
            found[hosts[turn % len(hosts)]].append(node)
        return {name: tuple(members) for name, members in found.items() if members or name == HERE}

    def check_nodes(self, nodes: Sequence[str], source: str) -> None:
        """See that each rule is for a node of the run, and that the bag is written where the command is.

        Raises:
            HostsError: one line with file, key and what was expected.
        """
        for rule in self.place:
            if not any(fnmatchcase(node, rule) for node in nodes):
                hint = "" if _WILD.search(rule) else meant(rule, nodes)
                raise HostsError(
                    f"{source}: place: {rule}: expected nodes of the run: {', '.join(nodes)} {hint}".strip()
                )
        where = next(name for name, members in self.placed(nodes).items() if RECORDER_NODE in members)
        if where != HERE:
            raise HostsError(
                f"{source}: place: {RECORDER_NODE} = {where}: expected {HERE}: the bag is written where the command is"
            )


def load_hosts(path: Path) -> HostsFile:
    """Read and check a hosts file.

    Raises:
        dgu_sim.errors.ScenarioError: one line with file, key, value and what was expected.
    """
    return validated(HostsFile, parse_yaml(read_text(path, "hosts file"), str(path)), str(path))
