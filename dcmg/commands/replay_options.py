"""The options of `dcmg replay`, as typer shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

_EVALUATE, _PUBLISH = "Other monitors", "With --publish"


def _monitors(text: str, *names: str, metavar: str | None = None) -> Any:  # noqa: ANN401 (typer's own is private)
    return typer.Option(*names, help=text, metavar=metavar, show_default=False, rich_help_panel=_EVALUATE)


def _publish(
    text: str, *names: str, metavar: str | None = None, show_default: bool = False, least: float | None = None
) -> Any:  # noqa: ANN401 (typer's own is private)
    return typer.Option(
        *names, help=text, metavar=metavar, show_default=show_default, rich_help_panel=_PUBLISH, min=least
    )


Bag = Annotated[Path, typer.Argument(help="bag of an earlier run; with --publish, any rosbag2 directory")]
Out = Annotated[
    Path | None,
    typer.Option(
        help="folder for the replayed run as a bag, and plots; with --monitors, for their logs", show_default=False
    ),
]
Json = Annotated[bool, typer.Option("--json", help="print the result as one JSON document, and nothing else there")]

Observer = Annotated[str | None, _monitors("another observer, with its default options", metavar="KIND")]
ObserverOption = Annotated[list[str] | None, _monitors("option of the observer; repeatable", metavar="NAME=VALUE")]
Detector = Annotated[str | None, _monitors("another detector, with its default options", metavar="KIND")]
DetectorOption = Annotated[list[str] | None, _monitors("option of the detector; repeatable", metavar="NAME=VALUE")]
History = Annotated[Path | None, _monitors("design from these recorded histories, not from the run's", metavar="BAG")]
Redesign = Annotated[
    bool, _monitors("design everything anew, and tell how far from the recorded designs it lies", "--redesign")
]
Set = Annotated[
    list[str] | None,
    _monitors("as in `monitor.detector.options.margin=3`; repeatable", "--set", metavar="A.B=VALUE"),
]

Publish = Annotated[bool, typer.Option("--publish", help="publish the recorded messages into ROS")]
Rate = Annotated[
    str, _publish("of real time; `max`: as fast as the machine goes", metavar="FACTOR|max", show_default=True)
]
StartOffset = Annotated[float, _publish("start so far into the bag [s]", metavar="SECONDS", least=0.0)]
Length = Annotated[float | None, _publish("publish no more than this [s]", metavar="SECONDS", least=0.0)]
Loop = Annotated[bool, _publish("start again at the end", "--loop")]
Paused = Annotated[bool, _publish("start paused", "--paused")]
Topics = Annotated[list[str] | None, _publish("only these topics, by whole name; repeatable", metavar="REGEX")]
Exclude = Annotated[list[str] | None, _publish("not these topics; repeatable", metavar="REGEX")]
Remap = Annotated[list[str] | None, _publish("publish under another name; repeatable", metavar="OLD:=NEW")]
WaitFor = Annotated[
    list[str] | None, _publish("do not start before somebody listens to it; repeatable", metavar="TOPIC")
]
Queue = Annotated[
    int,
    _publish(
        "messages of a topic that a reliable subscriber can hold: never more on their way", show_default=True, least=1
    ),
]
Monitors = Annotated[bool, _publish("start live monitor nodes on the published data", "--monitors")]
Attach = Annotated[
    list[str] | None,
    _publish("start when this monitor of `dcmg node` is there, and keep its pace; repeatable", metavar="NODE"),
]
Domain = Annotated[
    int | None, _publish("ROS domain id; default: a free one with --monitors, else that of the environment")
]
