"""How a run was made, as its bag tells."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bags.mcap.yaml_text import dump, load
from bags.reporting.wording import certificate_lines
from bags.runs.run_record import RunRecord
from bags.wire.origin import HOST_ATTACHMENT, VERSIONS_ATTACHMENT
from monitor import detectors
from monitor.errors import MonitorError


@dataclass(frozen=True, slots=True, kw_only=True)
class Designed:
    """An observer and where it watches.

    Attributes:
        links: The links, as `1-2`.
        observer: Design method.
        accepted: False: refused, these links are not monitored.
        verdict: In one line.
        certificate: In sentences.
    """

    links: tuple[str, ...]
    observer: str
    accepted: bool
    verdict: str
    certificate: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Making:
    """How a run was made.

    Attributes:
        name: Of the scenario; "" when the bag holds none.
        facts: Name and value, for a table.
        designs: What watches which links.
        scenario: The whole scenario, "" when the bag holds none.
    """

    name: str
    facts: tuple[tuple[str, str], ...]
    designs: tuple[Designed, ...]
    scenario: str


def making_of(run: RunRecord, steps: int) -> Making:
    """Gather what the documents of a bag say."""
    scenario = load(run.scenario_text) if run.scenario_text else {}
    known: Mapping[str, Any] = scenario if isinstance(scenario, Mapping) else {}
    facts = [
        ("bag", run.path.resolve().name),
        ("length", f"{steps} steps of {run.sampling_period_sec:g} s = {steps * run.sampling_period_sec:g} s"),
        ("grid", f"{len(run.topics.dgus)} DGUs, {len(run.links)} directed links"),
    ]
    monitor = known.get("monitor") or {}
    told = ("description", "seed", "coupling")
    facts += [(key, " ".join(str(known[key]).split())) for key in told if known.get(key) not in {None, ""}]
    facts += [(key, _flat(known[key])) for key in ("noise", "history") if key in known]
    facts += [(part, _flat(monitor[part])) for part in ("observer", "detector") if part in monitor]
    promise = _promise(monitor.get("detector"), run.sampling_period_sec)
    if promise:
        facts.append(("promise of the detector", promise))
    facts += [(name, _flat(_json(run, document))) for name, document in _DOCUMENTS if document in run.attachments]
    return Making(
        name=str(known.get("name", "")),
        facts=tuple(facts),
        designs=_designs(run),
        scenario=run.scenario_text,
    )


_DOCUMENTS: Sequence[tuple[str, str]] = (("versions", VERSIONS_ATTACHMENT), ("host", HOST_ATTACHMENT))


def _designs(run: RunRecord) -> tuple[Designed, ...]:
    """Equal designs once: all links from one DGU have the same."""
    found: dict[tuple[str, bool, str, str], list[str]] = {}
    for link in run.links:
        design = run.designs.get(link)
        if design is not None:
            key = (design.observer, design.accepted, design.verdict, design.certificate)
            found.setdefault(key, []).append(str(link))
    return tuple(
        Designed(
            links=tuple(links),
            observer=observer,
            accepted=accepted,
            verdict=verdict,
            certificate=tuple(certificate_lines(certificate)),
        )
        for (observer, accepted, verdict, certificate), links in found.items()
    )


def _promise(detector: object, period_sec: float) -> str:
    if not isinstance(detector, Mapping):
        return ""
    try:
        return detectors.build(str(detector.get("kind")), detector.get("options") or {}, period_sec).promise
    except MonitorError:  # a detector of another version
        return ""


def _json(run: RunRecord, document: str) -> object:
    try:
        return json.loads(run.attachments[document])
    except ValueError:
        return "not readable"


def _flat(document: object) -> str:
    """A small document on one line."""
    if not isinstance(document, Mapping):
        return str(document)
    return ", ".join(f"{key} {_value(value)}" for key, value in document.items() if value not in (None, {}, []))


def _value(value: object) -> str:
    return f"({_flat(value)})" if isinstance(value, Mapping) else " ".join(dump(value).replace("\n...", "").split())
