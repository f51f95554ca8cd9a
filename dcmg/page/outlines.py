"""What does not change while a page is open: the grid in words, and what each observer can and cannot see."""

import numpy as np

from bags.wire.records import DesignRecord
from dcmg.certificate_view import view
from dcmg.page.attack_forms import kinds
from dcmg.page.messages import Dgu, Line, LinkFacts, Outline
from dcmg.page.placing import places
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario

_OUTPUTS = ("V [V]", "I_t [A]", "v [V s]")


def link_facts(link: Link, *, accepted: bool, verdict: str, document: str, outputs: int = 3) -> LinkFacts:
    """A link with what its observer can and cannot see in words."""
    said = view(document, np.full(outputs, np.nan), None) if accepted else []
    return LinkFacts(
        name=str(link),
        source=link.source,
        target=link.target,
        monitored=accepted,
        certificate=[line for line in dict.fromkeys([verdict, *said]) if line],
    )


def of_record(link: Link, record: DesignRecord | None) -> LinkFacts:
    """A link of a bag."""
    if record is None:
        return link_facts(link, accepted=False, verdict="not monitored", document="")
    return link_facts(link, accepted=record.accepted, verdict=record.verdict, document=record.certificate)


def outputs_named(count: int) -> list[str]:
    """What the components of a residual are."""
    return list(_OUTPUTS[:count]) if count <= len(_OUTPUTS) else [f"output {one + 1}" for one in range(count)]


def units_of(scenario: Scenario | None, dgus: tuple[int, ...]) -> tuple[list[Dgu], list[Line]]:
    """DGUs and lines with their values; without a scenario (an imported stream) lines and values are not known."""
    given = () if scenario is None else scenario.lines
    pairs = [(one.between[0], one.between[1]) for one in given]
    lines = [
        Line(between=pair, facts=f"{one.resistance_ohm:g} Ω, {one.inductance_h * 1e6:g} µH")
        for pair, one in zip(pairs, given, strict=True)
    ]
    facts = dict.fromkeys(dgus, "")
    for one in () if scenario is None else scenario.dgus:
        values = f"{one.resistance_ohm:g} Ω, {one.inductance_h * 1e3:g} mH, {one.capacitance_f * 1e3:g} mF"
        facts[one.id] = f"reference {one.reference_v:g} V, filter {values}"
    spots = zip(dgus, places(dgus, pairs), strict=True)
    return [Dgu(number=dgu, facts=facts[dgu], x=x, y=y) for dgu, (x, y) in spots], lines


def outline(
    scenario: Scenario | None,
    links: list[LinkFacts],
    dgus: tuple[int, ...],
    *,
    source: str,
    name: str,
    sampling_period_sec: float,
    end_step: int | None,
    outputs: int,
    bag: str | None = None,
) -> Outline:
    """Put it together."""
    units, lines = units_of(scenario, dgus)
    can = {
        "simulation": ["clock", "attack", "whatif"],
        "bag": ["clock", "seek"] if scenario is None else ["clock", "seek", "whatif"],
        "ros": ["attack"],
    }[source]
    return Outline.model_validate(
        {
            "name": name,
            "source": source,
            "about": "" if scenario is None else scenario.description,
            "sampling_period_sec": sampling_period_sec,
            "end_step": end_step,
            "outputs": outputs_named(outputs),
            "bag": bag,
            "can": can,
            "challenge": None,
            "dgus": units,
            "lines": lines,
            "links": links,
            "attacks": kinds() if {"attack", "whatif"} & set(can) else [],
        }
    )
