"""`dcmg replay`: recorded data once more, through other monitors or into ROS."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import typer

from bags.mcap.recording import TopicFilter
from dcmg.commands import replay_options as options  # noqa: TC001 (typer reads the annotations)
from dcmg.commands.definitions import Definitions, known_definitions
from dcmg.commands.publish_options import PublishOptions
from dcmg.commands.replay_job import MonitorChanges, evaluate
from dcmg.errors import CommandError
from dcmg.joined import joined

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


def replay(
    bag: options.Bag,
    *,
    out: options.Out = None,
    json: options.Json = False,
    observer: options.Observer = None,
    observer_option: options.ObserverOption = None,
    detector: options.Detector = None,
    detector_option: options.DetectorOption = None,
    history: options.History = None,
    redesign: options.Redesign = False,
    set_: options.Set = None,
    publish: options.Publish = False,
    rate: options.Rate = "1",
    start_offset: options.StartOffset = 0.0,
    duration: options.Length = None,
    loop: options.Loop = False,
    paused: options.Paused = False,
    topics: options.Topics = None,
    exclude: options.Exclude = None,
    remap: options.Remap = None,
    wait_for: options.WaitFor = None,
    queue: options.Queue = 10,
    monitors: options.Monitors = False,
    attach: options.Attach = None,
    domain: options.Domain = None,
    definitions: Definitions = None,
) -> None:
    """Feed recorded data to the monitors of the run or to others, or publish it into ROS.

    Without options every residual comes out as recorded, bit for bit. While publishing on a terminal, space pauses and
    goes on, right goes on by one step, up and down change the rate by a tenth; `dcmg player` does so from elsewhere.
    Exit code 3 when a topic with messages cannot be published: it is named, counted and left out.
    """
    overrides = [
        *_changes("observer", observer, observer_option or []),
        *_changes("detector", detector, detector_option or []),
        *(set_ or []),
    ]
    changes = MonitorChanges(overrides=overrides, history=history, redesign=redesign)
    if not publish:
        _only_with_publish(
            {"--rate": rate != "1", "--start-offset": start_offset, "--duration": duration, "--loop": loop}
            | {"--paused": paused, "--topics": topics, "--exclude": exclude, "--remap": remap}
            | {"--wait-for": wait_for, "--monitors": monitors, "--attach": attach, "--domain": domain is not None}
            | {"--definitions": definitions}
        )
        raise typer.Exit(evaluate(bag, changes, out=out, json=json))
    chosen = PublishOptions(
        rate=_rate(rate),
        start_offset_sec=start_offset,
        duration_sec=duration,
        loop=loop,
        paused=paused,
        topics=TopicFilter(include=tuple(topics or [".*"]), exclude=tuple(exclude or ())),
        remap=dict(_remapping(text) for text in remap or []),
        wait_for=tuple(wait_for or ()),
        queue=queue,
        monitors=monitors,
        attached=tuple(attach or ()),
        domain=domain,
        known=known_definitions(definitions),
        out=out,
    )
    publish_bag = joined("replay.publish", "dcmg replay --publish")
    raise typer.Exit(publish_bag(bag, changes, chosen, json=json))


def _only_with_publish(given: Mapping[str, object]) -> None:
    for name, value in given.items():
        if value:
            raise CommandError(f"{name}: expected only together with --publish")


def _changes(part: str, kind: str | None, chosen: Sequence[str]) -> list[str]:
    """Overrides of one part of the monitor section."""
    for option in chosen:
        if not re.match(r"\s*[\w.]+\s*=", option):
            raise CommandError(f"--{part}-option {option}: expected NAME=VALUE")
    fresh = [] if kind is None else [f"monitor.{part}={{kind: {kind}, options: {{}}}}"]
    return [*fresh, *(f"monitor.{part}.options.{option.strip()}" for option in chosen)]


def _rate(text: str) -> float:
    try:
        rate = math.inf if text == "max" else float(text)
    except ValueError:
        rate = math.nan
    if not rate > 0.0:
        raise CommandError(f"--rate {text}: expected a positive number or max")
    return rate


def _remapping(text: str) -> tuple[str, str]:
    old, separator, new = text.partition(":=")
    if not (separator and old and new):
        raise CommandError(f"--remap {text}: expected OLD:=NEW, as in /dgu_1/output:=/lab/output")
    return old, new
