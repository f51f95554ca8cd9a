"""What a person types to start an attack, as its links and parameters; what each kind of attack wants."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from pydantic_core import PydanticUndefined

from dcmg.errors import CommandError
from dgu_sim.attacks import KINDS, build_attack, known_kind
from dgu_sim.grid import Link
from dgu_sim.scenario_file import WAVEFORM
from dgu_sim.table_file import ATTACK_COLUMNS, TableFileError, embed_table
from dgu_sim.yaml_limits import load_within_limits

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dgu_sim.attacks import Attack

_LINK = re.compile(r"\d+-\d+")

EXAMPLES: Mapping[str, str] = {
    "bias": "1-2 --bias 0.1 0.1 0.1",
    "bias_ramp": "1-2 --rate 0 0.1 0",
    "bias_sine": "1-2 --amplitude 0 0.5 0 --period-sec 1",
    "bias_pulse": "1-2 --bias 0 0.5 0 --period-sec 1 --width-sec 0.1",
    "bias_random": "1-2 --spread 0.1 0.1 0.1 --distribution gaussian",
    "bias_waveform": "1-2 --time-sec 0 1 2 --current-a 0 0.5 0 --interpolation linear --repeat true",
    "scaling": "1-2 --gain 1 1.05 1",
    "freeze": "1-2",
    "delay": "1-2 --samples 10",
    "drop": "1-2 3-1 --probability 0.5",
    "replay": "1-2 --record-sec 2",
    "zero_sum": "1-2 5-4 --shares 0.5 -0.5",
    "uio_stealthy_plane": "1-2 --current-a 0.5",
    "uio_stealthy_trajectory": "1-2 --current-a 0.5 --rise-sec 2",
    "luenberger_stealthy": "2-4 3-4 --voltage-v 0.1",
    "covert": "1-2 --load-a 2",
    "spoof": "1-2 --falsify '{kind: bias, bias: [0, 0.5, 0]}'",
}
"""Words behind `dcmg attack start KIND`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An attack as it was ordered, checked as far as that goes without the running system.

    Attributes:
        kind: name of the attack class.
        links: the links it acts on, in order.
        parameters: of the class.
    """

    kind: str
    links: tuple[Link, ...]
    parameters: Mapping[str, object]


def parse_order(words: Sequence[str]) -> Order:
    """Read `KIND LINK… --NAME VALUE… …`; several values make a list, every value is YAML (and so JSON).

    Raises:
        CommandError: no kind, no link, or a word that is neither.
        dgu_sim.errors.AttackError: the class does not know a parameter, or cannot act on these links.
    """
    if not words or words[0].startswith("-"):
        raise CommandError(f"expected a kind of attack first, one of {', '.join(KINDS)}")
    kind, *rest = words
    known_kind(kind)
    first = next((place for place, word in enumerate(rest) if word.startswith("--")), len(rest))
    links = tuple(parse_link(word) for word in rest[:first])
    if not links:
        raise CommandError(f"{kind} attack: expected the attacked link behind it, from sender to receiver, as in 1-2")
    parameters: dict[str, object] = {}
    for name, values in _options(rest[first:]):
        if name in parameters:
            raise CommandError(f"{kind} attack: --{name.replace('_', '-')} is given twice")
        parameters[name] = value_of(name, values)
    if kind == WAVEFORM:
        try:
            embed_table(parameters, ATTACK_COLUMNS, Path())
        except TableFileError as error:
            raise CommandError(f"{kind} attack: {error}") from error
    attack = build_attack(kind, parameters)
    attack.check_links(links)
    return Order(kind=kind, links=links, parameters=attack.model_dump(mode="json"))


def parse_link(word: str) -> Link:
    """Read a link, as in 1-2.

    Raises:
        CommandError: it is none.
    """
    if not _LINK.fullmatch(word):
        raise CommandError(f"link {word}: expected two DGU numbers, as in 1-2")
    return Link.parse(word)


def parameters_of(attack: type[Attack]) -> list[tuple[str, str, str]]:
    """Option, default and meaning of each parameter of an attack class."""
    return [
        (
            f"--{name.replace('_', '-')}",
            "required" if field.default is PydanticUndefined else str(getattr(field.default, "value", field.default)),
            field.description or "",
        )
        for name, field in attack.model_fields.items()
    ]


def first_line(attack: type[Attack]) -> str:
    """What an attack class does, in one line."""
    return (attack.__doc__ or "").strip().splitlines()[0]


def _options(words: Sequence[str]) -> list[tuple[str, list[str]]]:
    found: list[tuple[str, list[str]]] = []
    for word in words:
        if word.startswith("--"):
            name, equals, value = word.removeprefix("--").partition("=")
            found.append((name.replace("-", "_"), [value] if equals else []))
        else:
            found[-1][1].append(word)
    return found


def value_of(name: str, words: Sequence[str]) -> object:
    """Read the words behind `--NAME`: YAML each, several make a list; CommandError where one is not."""
    if not words:
        raise CommandError(f"--{name.replace('_', '-')}: expected a value behind it")
    try:
        values = [load_within_limits(word) for word in words]
    except yaml.YAMLError:
        raise CommandError(f"--{name.replace('_', '-')} {' '.join(words)}: expected numbers, words or JSON") from None
    return values[0] if len(values) == 1 else values
