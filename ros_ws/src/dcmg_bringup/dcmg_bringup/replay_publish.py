"""`dcmg replay --publish`: recorded messages into ROS, and monitors that run on them."""

from __future__ import annotations

import datetime as dt
import json as json_module
import os
import sys
from contextlib import ExitStack, closing
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from bags.runs.playback import Playback, Selection, open_playback
from bags.runs.replay_settings import history_messages, replayed_scenario
from bags.wire.origin import SCENARIO_ATTACHMENT
from bags.wire.schema import monitor_name
from dcmg.commands.definitions import EXIT_LEFT_OUT
from dcmg.errors import CommandError
from dcmg_bringup.domain import REPLAY, checked_domain, choose_domain
from dcmg_bringup.keys import keys
from dcmg_bringup.processes import ProcessGroup
from dcmg_bringup.replay_display import ReplayDisplay
from dcmg_bringup.ros_environment import ros_environment
from dcmg_bringup.said import said_in_one_line
from dcmg_nodes.options import NodeOptions
from dcmg_nodes.playing import PlayOptions
from dcmg_nodes.wiring import wiring_of

if TYPE_CHECKING:
    from dcmg.commands.publish_options import PublishOptions
    from dcmg.commands.replay_job import MonitorChanges
    from dcmg_nodes.playing import Played
    from dcmg_nodes.wiring import Wiring
    from dgu_sim.scenario import Scenario

_EXIT_FAILED = 1
_EXIT_INTERRUPTED = 130
_EXIT_GRACE_SEC = 5.0
_DOMAIN, _PROFILES = "ROS_DOMAIN_ID", "FASTRTPS_DEFAULT_PROFILES_FILE"
_messages = Console(stderr=True)


def publish(bag: Path, changes: MonitorChanges, options: PublishOptions, *, json: bool) -> int:
    """Publish a bag into ROS, with monitors on what is published if wanted; return the exit code."""
    live = options.monitors or bool(options.attached)
    if live and (options.loop or options.start_offset_sec):
        raise CommandError("--loop, --start-offset: expected without live monitors, which begin with step 0, once")
    if not (live or changes.none):
        raise CommandError("other monitors: expected only together with --monitors or --attach")
    playback = open_playback(bag, Selection(topics=options.topics), options.known)
    text = playback.attachments.get(SCENARIO_ATTACHMENT, b"").decode()
    scenario = replayed_scenario(bag, text, changes.overrides) if live else None
    playback = open_playback(bag, _selection(changes, options, scenario), options.known)
    part = None if scenario is None else _part(playback, scenario, options, None if changes.anew else bag)
    with ExitStack() as stack:
        found = checked_domain(options.domain)
        wanted = 0 if found is None and not options.monitors else found
        domain = stack.enter_context(choose_domain(wanted, scenario=f"{REPLAY}{bag.name}", out=str(bag)))
        os.environ.update(ros_environment(domain) if options.monitors else _environment(domain))
        played = _play(playback, part, options, stack)
    return _report(playback, played, unchanged=changes.none, json=json)


def _selection(changes: MonitorChanges, options: PublishOptions, scenario: Scenario | None) -> Selection:
    replaced = {}
    if changes.history is not None and scenario is not None:
        replaced = history_messages(changes.history, sorted({link.source for link in scenario.links}))
    return Selection(
        topics=options.topics,
        remap=options.remap,
        start_offset_sec=options.start_offset_sec,
        duration_sec=options.duration_sec,
        replaced=replaced,
    )


def _environment(domain: int) -> dict[str, str]:
    """Variables of a replay into the user's own ROS environment: what is set there stays."""
    profiles = str(resources.files("dcmg_nodes") / "player.xml")
    return {_DOMAIN: str(domain), _PROFILES: os.environ.get(_PROFILES, profiles)}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """What of a run is live on the published data."""

    scenario: Scenario
    wiring: Wiring
    nodes: tuple[str, ...]
    designs: Path | None


def _play(playback: Playback, part: _Part | None, options: PublishOptions, stack: ExitStack) -> Played:
    group = None
    if part is not None and options.monitors:
        group = _start(part, options)
        stack.callback(group.stop)
    from dcmg_nodes.player import play  # noqa: PLC0415 (imports rclpy, which must follow the forks)

    play_options = PlayOptions(
        rate=options.rate,
        loop=options.loop,
        paused=options.paused,
        queue=options.queue,
        wait_for=options.wait_for,
        wiring=None if part is None else part.wiring,
        live=() if part is None else part.nodes,
    )
    length_sec = (playback.end_ns - playback.start_ns) * 1e-9
    pressed = stack.enter_context(keys())
    with closing(ReplayDisplay(_messages, length_sec, pressed, group)) as display, said_in_one_line():
        played = play(playback, play_options, display)
    if group is not None:
        group.wait(_EXIT_GRACE_SEC)
    return played


def _part(playback: Playback, scenario: Scenario, options: PublishOptions, designs: Path | None) -> _Part:
    """Find out which nodes are to run on the published data, and whether they will get everything they wait for.

    Raises:
        CommandError: a node that a replay has no use for; a topic is missing, left out or renamed.
    """
    wiring = wiring_of(scenario)
    wiring.warm_up()
    monitors = tuple(monitor_name(dgu) for dgu in wiring.topics.monitors)
    for name in options.attached:
        if name not in monitors:
            raise CommandError(f"--attach {name}: expected one of {', '.join(monitors)}")
    nodes = monitors if options.monitors else tuple(options.attached)
    for topic in wiring.topics.all:
        read = set(wiring.readers(topic)) & set(nodes)
        if read and not set(topic.publishers) & set(nodes) and playback.names.get(topic.name) != topic.name:
            raise CommandError(f"{min(read)} needs {topic.name}, which the replay does not publish under that name")
    return _Part(scenario=scenario, wiring=wiring, nodes=nodes, designs=designs)


def _start(part: _Part, options: PublishOptions) -> ProcessGroup:
    now = dt.datetime.now(tz=dt.UTC).astimezone()
    out = options.out or Path("out") / f"{part.scenario.name}-replay-{now:%Y%m%d-%H%M%S}"
    return ProcessGroup(
        {name: (name,) for name in part.nodes}, part.scenario, NodeOptions(out=out, designs=part.designs), out / "log"
    )


def _report(playback: Playback, played: Played, *, unchanged: bool, json: bool) -> int:
    """Say what was published.

    Exit code 1 when monitors of the same settings conclude something else, 3 when messages could not be published.
    """
    document = _document(playback.path, played)
    left_out = {name: count for name in played.left_out if (count := playback.counts.get(name, 0))}
    different = sum(found for _, found in played.compared.values())
    if json:
        print(json_module.dumps(document))  # noqa: T201
    else:
        for line in _lines(played):
            Console().print(line, highlight=False, soft_wrap=True)
    if left_out:
        told = ", ".join(f"{name} ({count} messages)" for name, count in left_out.items())
        print(f"left out, because it cannot be published: {told}", file=sys.stderr)  # noqa: T201
    if played.interrupted:
        return _EXIT_INTERRUPTED
    if different and unchanged:
        return _EXIT_FAILED
    return EXIT_LEFT_OUT if left_out else 0


def _document(bag: Path, played: Played) -> dict[str, object]:
    return {
        "bag": str(bag),
        "messages": played.messages,
        "time_sec": played.time_sec,
        "wall_sec": played.wall_sec,
        "loops": played.loops,
        "interrupted": played.interrupted,
        "topics": dict(played.counts),
        "left_out": dict(played.left_out),
        "timing": {
            name: {
                "pairs": errors.total,
                "median_sec": errors.quantile_sec(0.5),
                "p99_sec": errors.quantile_sec(0.99),
                "worst_sec": errors.worst_sec,
            }
            for name, errors in (("messages", played.between_messages), ("stamps", played.between_stamps))
        },
        "live": {name: {"equal": same, "different": other} for name, (same, other) in played.compared.items()},
    }


def _lines(played: Played) -> list[str]:
    speed = played.time_sec / played.wall_sec if played.wall_sec else 0.0
    took = f"{played.time_sec:g} s in {played.wall_sec:.2f} s, {speed:.3g} x real time"
    lines = [f"published {played.messages} messages on {len(played.counts)} topics: {took}"]
    errors = played.between_stamps
    if errors.total:
        lines.append(
            f"times between stamps are kept to {errors.quantile_sec(0.5) * 1e3:.2f} ms (median), "
            f"{errors.quantile_sec(0.99) * 1e3:.2f} ms (99 %), {errors.worst_sec * 1e3:.1f} ms at worst"
        )
    if played.compared:
        differing = {name: found for name, (_, found) in played.compared.items() if found}
        equal = sum(same for same, _ in played.compared.values())
        lines.append(f"live monitors: {equal} messages on {len(played.compared)} topics equal the recorded ones")
        lines += [f"{name}: {found} messages differ from the recorded ones" for name, found in differing.items()]
    return lines
