"""A first mapping file for a source: candidates with rates and units, and what only a person can say."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bags.foreign.outline import Described, Outline
from bags.mcap.yaml_text import dump

_MOST_CANDIDATES = 40
_JITTER = 0.01  # of the period: what `refuse` takes by default
# names that say what a number is, most telling first
_HINTS: Final = (
    (re.compile(r"volt|(^|[._/])(v|u|vdc|v_?bus)(\d*|\[\d+\])$", re.IGNORECASE), "V"),
    (re.compile(r"curr|(^|[._/ ])amp(s|ere|$)|(^|[._/])(i|i_?t|idc|il)(\d*|\[\d+\])$", re.IGNORECASE), "A"),
    (re.compile(r"power$|(^|[._/])p\d*$", re.IGNORECASE), "W"),
)
_OUTPUT: Final = re.compile(r"(^|[._/ ])(y|out(put)?s?|meas(ured)?)\d*$", re.IGNORECASE)
_TIMES: Final = re.compile(r"^(t|.*time.*|.*zeit.*|.*(seconds|sekunden)|secs?|elapsed.*)( ?[\[(].*)?$", re.IGNORECASE)


def draft_mapping(source: Path | str, outline: Outline) -> str:
    """A mapping file with comments; it is valid, and a person decides what in it is right.

    Args:
        source: What it is of.
        outline: What that holds.
    """
    source = Path(source)
    return "\n".join(_lines(source, outline)) + "\n"


def _lines(source: Path, outline: Outline) -> Iterator[str]:
    readable = [one for one in outline.topics if not one.unreadable and one.fields]
    table = next((one for one in readable if one.clock == "column"), None)
    time = _time_of(table) if table else None
    candidates = [(one, field) for one in readable for field in one.fields if field != time]
    chosen = _chosen(candidates)
    yield f"# A draft for {source.name}: `dcmg import history {source.name} --mapping THIS --out BAG` reads it."
    yield "# Fields, units and numbers of DGUs are guesses by name: hold them against what was measured."
    yield from (f"# {note}" for note in outline.notes)
    yield from (f"# left out, {one.name}: {one.unreadable}" for one in outline.left_out)
    if time is not None:
        yield _pair("time", time) + "  # column of the instants; its unit: {field: t, unit: ms}"
    yield from _sampling(readable)
    yield "histories:"
    yield "  - dgu: 1  # the DGU that was measured"
    yield "    y:  # outputs as they are sent over the network"
    yield from _signals(chosen, "      ")
    yield "    # d: []  # inputs applied in the experiment that are unknown online: load current, reference"
    yield "    # x: []  # states; without it the outputs are the states"
    yield "streams:"
    yield "  - link: 1-2  # from the watched DGU to the one that hosts the monitor"
    yield "    y:  # the same outputs, as they arrive there"
    yield from _signals(chosen, "      ")
    yield "# candidates:"
    for one, field in candidates[:_MOST_CANDIDATES]:
        unit = dict(one.units).get(field) or _unit(field)
        yield f"#   {field}  {f'[{unit}]  ' if unit else ''}{_rate(one)}"
    if len(candidates) > _MOST_CANDIDATES:
        yield f"#   and {len(candidates) - _MOST_CANDIDATES} more: `dcmg import inspect {source.name}`"
    yield "# missing:"
    yield from (f"#   {line}" for line in _missing(table, time, chosen))


def missing_of(outline: Outline) -> list[str]:
    """What a person has to say, a line each."""
    readable = [one for one in outline.topics if not one.unreadable and one.fields]
    table = next((one for one in readable if one.clock == "column"), None)
    time = _time_of(table) if table else None
    return _missing(table, time, _chosen([(one, field) for one in readable for field in one.fields if field != time]))


def _missing(table: Described | None, time: str | None, chosen: list[tuple[Described, str]]) -> list[str]:
    found = ["which DGU was measured, and which link a stream is on"]
    if table is not None and time is None:
        found.append("the column of the instants (key time), or sampling_period_sec")
    if not chosen:
        found.append("a numeric field: none was found")
    guessed = [field for one, field in chosen if not dict(one.units).get(field)]
    if guessed:
        found.append(f"whether {', '.join(guessed)} are in SI units (keys unit, scale, offset)")
    found.append("which inputs were applied in the experiment (key d), if they were recorded")
    return found


def _chosen(candidates: list[tuple[Described, str]]) -> list[tuple[Described, str]]:
    """Columns that are called outputs, else a voltage and a current where units or names tell them, else a number."""
    plain = [one for one in candidates if "[" not in one[1]]
    outputs = [one for one in candidates if one[0].clock == "column" and _OUTPUT.search(one[1])]
    if outputs:
        return outputs
    found: list[tuple[Described, str]] = []
    for unit in ("V", "A"):
        match = next((one for one in candidates if _quantity(*one) == unit and "[*]" not in one[1]), None)
        found += [match] if match else []
    return found or plain[:1] or candidates[:1]


def _signals(chosen: list[tuple[Described, str]], indent: str) -> Iterator[str]:
    for one, field in chosen:
        stated = dict(one.units).get(field)
        plain = re.sub(r"\[(\*|0\.\.\d+)\]", "[0]", field)
        unit = f"in {stated}, as the file says" if stated else f"{_unit(field)}?" if _unit(field) else "unit?"
        yield f"{indent}- {_scalar(plain)}  # {unit}, {_rate(one)}"
    if not chosen:
        yield f"{indent}- nothing_was_found"


def _sampling(readable: list[Described]) -> Iterator[str]:
    looks = [one.regularity for one in readable if one.regularity is not None]
    worst = max((one.worst_jitter_sec / one.period_sec for one in looks if one.period_sec > 0), default=0.0)
    rates = {round(one.period_sec, 6) for one in looks if one.period_sec > 0}
    yield "sampling:"
    if worst > _JITTER:
        yield f"  policy: nearest  # the worst jitter is {worst:.0%} of a period: refuse would end the import"
    else:
        yield "  policy: refuse  # nothing is resampled; nearest, hold or linear where instants differ"
    if len(rates) > 1:
        told = ", ".join(f"{one:g} s" for one in sorted(rates))
        yield f"  # topics come at several rates ({told}): hold or linear with max_gap_sec bridges the slower ones"


def _time_of(table: Described) -> str | None:
    names = [*table.times, *(one for one in table.fields if _TIMES.match(one))]
    return names[0] if names else None


def _quantity(one: Described, field: str) -> str:
    """V, A or W: what the file states, else what the name tells."""
    stated = dict(one.units).get(field, "")
    return stated[-1:] if stated else _unit(field)


def _unit(field: str) -> str:
    return next((unit for pattern, unit in _HINTS if pattern.search(field)), "")


def _rate(one: Described) -> str:
    if one.regularity is None or not one.regularity.period_sec > 0:
        return f"{one.messages} rows"
    return f"every {one.regularity.period_sec:g} s, {one.messages} messages"


def _pair(key: str, value: str) -> str:
    return f"{key}: {_scalar(value)}"


def _scalar(value: str) -> str:
    """A text as YAML writes it in one line."""
    return dump([value]).strip().removeprefix("- ")
