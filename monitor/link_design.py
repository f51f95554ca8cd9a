"""What watches the samples of one neighbour: the part of a design that runs, and the document that tells of it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from monitor import observers
from monitor.carrying import RUNNING, SYMBOLS, parsed, running_document, running_observer
from monitor.certificate import Certificate
from monitor.errors import HistoryError
from monitor.history import sent_outputs
from monitor.link_monitor import LinkMonitor
from monitor.observers import Design

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from monitor.detectors import Detector
    from monitor.history import History
    from monitor.observers import Observer


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkDesign:
    """A design as a monitor takes it, made now or carried from elsewhere.

    Attributes:
        kind: name of the design method.
        observer: None when refused.
        verdict: one line in plain words.
        channels: positions in the received vector of the outputs that it uses; None: the first ones.
        blind: its residual shows nothing.
        document: the certificate as JSON, with everything that the observer needs to run.
    """

    kind: str
    observer: Observer | None
    verdict: str
    channels: tuple[int, ...] | None = None
    blind: bool = False
    document: str = ""

    @property
    def accepted(self) -> bool:
        """Whether there is an observer."""
        return self.observer is not None

    def monitor(self, detector: Detector[Any]) -> LinkMonitor:
        """Return what steps; raises what `LinkMonitor` does."""
        return LinkMonitor(observer=self.observer, detector=detector, channels=self.channels, blind=self.blind)


def design_link(kind: str, history: History, options: Mapping[str, object]) -> LinkDesign:
    """Design an observer; a history that none can be designed from is a refusal.

    Raises:
        MonitorError: unknown kind or option.
    """
    try:
        return of_design(observers.design(kind, history, options))
    except HistoryError as error:
        certificate = Certificate(kind=kind, accepted=False, verdict=f"refused: {error}")
        return of_design(Design(kind=kind, observer=None, certificate=certificate))


def of_design(design: Design) -> LinkDesign:
    """Take of a design what runs."""
    return LinkDesign(
        kind=design.kind,
        observer=design.observer,
        verdict=design.verdict,
        channels=design.channels,
        blind=design.blind,
        document=_document(design),
    )


def carried_link(kind: str, document: str, history: History) -> LinkDesign | None:
    """Take a design from its document; None where that does not hold everything.

    Args:
        kind: name of the design method.
        document: what `LinkDesign.document` was.
        history: what it was designed from: it says which outputs are sent.
    """
    found = parsed(document)
    verdict, running = str(found.get("verdict", "")), found.get(RUNNING, found)
    residual = found.get("residual")
    blind = isinstance(residual, dict) and bool(residual.get("blind"))
    try:
        _, channels = sent_outputs(history)
    except HistoryError:
        channels = None
    observer = running_observer(running) if found.get("accepted") and isinstance(running, dict) else None
    complete = not found.get("accepted") or (observer is not None and observer.outputs == len(channels or ()))
    if not (found and complete):
        return None
    return LinkDesign(kind=kind, observer=observer, verdict=verdict, channels=channels, blind=blind, document=document)


def _document(design: Design) -> str:
    """The certificate; where its matrices are not those that run, with them."""
    text = design.certificate.to_json()
    if set(SYMBOLS) <= set(design.certificate.matrices or ()):
        return text
    running = running_document(design.observer)
    return json.dumps({**json.loads(text), RUNNING: running}) if running else text
