"""The report as one HTML file that opens without a network."""

from collections.abc import Mapping
from importlib import resources
from typing import Any

from bokeh.embed import components
from bokeh.resources import Resources
from jinja2 import Environment
from markupsafe import Markup

from bags.reporting.alarm_sources import SOURCES
from bags.reporting.assessment import IMPACTS, Assessment
from bags.reporting.figures import figures
from bags.reporting.making import making_of
from bags.reporting.timeline import Timeline
from bags.reporting.topology import SIZE, drawing
from bags.reporting.wording import NOTHING, interval, number, share
from dgu_sim.attacks.techniques import techniques_of
from dgu_sim.attacks.wording import parameter_words


def page(timeline: Timeline, assessment: Assessment) -> str:
    """Put the measures and pictures of a run into a page."""
    found = dict(figures(timeline, assessment))
    script, places = components(found) if found else ("", {})
    library = Resources(mode="inline", components=["bokeh"]).js_raw if found else []
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters.update(number=number, share=share, interval=interval, words=_words, techniques=_techniques)
    return environment.from_string(resource("page.html.j2")).render(
        timeline=timeline,
        assessment=assessment,
        rows=assessment.judged.attacks,
        main=assessment.overall.get(assessment.main),
        making=making_of(timeline.run, timeline.steps),
        drawing=drawing(timeline, assessment.judged),
        size=SIZE,
        sources=SOURCES,
        impacts=IMPACTS,
        confusion=_confusion(timeline, assessment),
        shown=timeline.telling(),
        nothing=NOTHING,
        places={name: Markup(place) for name, place in places.items()},  # noqa: S704 - bokeh's own
        script=Markup(script),  # noqa: S704 - idem
        residuals=[Markup(places[name]) for name in places if name.startswith("residuals")],  # noqa: S704 - bokeh's own
        style=Markup(resource("style.css")),  # noqa: S704 - ours
        behaviour=Markup(resource("behaviour.js")),  # noqa: S704 - ours
        library=[Markup(one) for one in library],  # noqa: S704 - idem
    )


def resource(name: str) -> str:
    """A file beside this one."""
    return resources.files("bags.reporting").joinpath(name).read_text(encoding="utf-8")


def _words(parameters: str) -> str:
    """Parameters of an attack (JSON) on one line."""
    return ", ".join(parameter_words(parameters))


def _techniques(kind: str) -> str:
    """Its techniques of MITRE ATT&CK for ICS on one line."""
    return ", ".join(str(one) for one in techniques_of(kind))


def _confusion(timeline: Timeline, assessment: Assessment) -> Mapping[str, Any]:
    """The rows of the confusion matrix that have samples, as shares."""
    overall = assessment.overall.get(assessment.main)
    if overall is None:
        return {}
    names = [*(str(link) for link in timeline.run.links), "none"]
    samples, totals = overall.isolation.samples, overall.isolation.attacked_samples
    columns = [position for position in range(len(names)) if samples[:, position].any() or position == len(names) - 1]
    rows = [
        {"name": names[row], "cells": [(row == one, samples[row, one] / totals[row]) for one in columns]}
        for row in range(len(names))
        if totals[row]
    ]
    return {"columns": [names[one] for one in columns], "rows": rows}
