"""Monitors on a recorded run: the same received outputs, the designs of the run, or other observers and detectors."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from bags.mcap.errors import BagError
from bags.mcap.yaml_text import dump
from bags.runs.alarm_events import in_order, link_alarms, local_alarms
from bags.runs.offline import judged, said
from bags.runs.reader import read_run
from bags.runs.replay_settings import check_overrides, replayed_scenario
from bags.runs.run_record import RunRecord
from bags.runs.team_offline import TeamProgress, replayed_team, told_arrays
from bags.watch.carried import Carried
from bags.watch.designs import design_run, said_of, team_told
from bags.watch.watcher import Watcher
from bags.wire.arrays import measured
from bags.wire.convert import history_of
from bags.wire.origin import MONITOR_ATTACHMENT, SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT
from bags.wire.plugins import check_plug_ins, used_plug_ins, with_plug_ins
from bags.wire.records import DesignRecord
from bags.wire.row import Need
from bags.wire.schema import RunTopics, parts_of
from bags.wire.settings import parse_monitor, settings_of
from bags.wire.stream import Spoofed
from bags.wire.table import with_conclusions
from dgu_sim.grid import Link
from dgu_sim.scenario import Scenario
from monitor.history import History
from monitor.settings import MonitorSettings


def replay(run: RunRecord | Path | str, overrides: Sequence[str] = (), *, redesign: bool = False) -> RunRecord:
    """Run the monitors again, as they were designed or otherwise, and feed them what was received.

    Args:
        run: A recorded run, or its bag.
        overrides: Changes of the scenario's monitor section, "monitor.observer.kind=value" and the like. Without any,
            every residual comes out as recorded, bit for bit. With some, what was commanded to detectors by hand is
            left out: it was meant for the recorded ones.
        redesign: Whether to design everything anew; else what was designed with the same settings runs as recorded.

    Returns:
        The run with the conclusions, designs and alarms of the fresh monitors.

    Raises:
        BagError: The bag cannot be read, or lacks its scenario or a history; an override is not about monitors.
        dgu_sim.errors.ScenarioError: An override does not fit the scenario.
        monitor.errors.MonitorError: Unknown observer or detector, or options of theirs.
    """
    (record,) = replay_windows([run if isinstance(run, RunRecord) else read_run(run)], overrides, redesign=redesign)
    return record


def replay_windows(
    windows: Iterable[RunRecord], overrides: Sequence[str] = (), *, redesign: bool = False
) -> Iterator[RunRecord]:
    """As `replay`, for a run that is too long for the memory: each window as soon as it has been read.

    Args:
        windows: Consecutive windows from step 0 on.
        overrides: As for `replay`.
        redesign: As for `replay`; also where histories are not those of the run.

    Raises:
        Exception: As `replay`, with the first window.
    """
    prepared: _Prepared | None = None
    alarm = own_alarm = np.zeros(0, dtype=np.bool_)
    for window in windows:
        if prepared is None:
            prepared = _prepare(window, overrides, redesign=redesign)
            alarm = np.zeros(len(window.links), dtype=np.bool_)
            own_alarm = np.zeros(len(prepared.topics.monitors), dtype=np.bool_)
        lying = prepared.spoofed.rows(window.streams, window.first_step, window.steps)
        outputs, fields = prepared.watch.follow(window, lying, {} if overrides else window.given)
        alarms = link_alarms(outputs, alarm, window.first_step, window.links)
        if prepared.topics.combined is not None and fields is not None:
            alarms += local_alarms(fields, own_alarm, window.first_step, prepared.topics.combined)
            own_alarm = fields.local["alarm"][-1] if fields.local and window.steps else own_alarm
        arrays = judged(outputs) | ({} if fields is None else said(fields))
        team = None
        if prepared.team is not None:
            told, team = replayed_team(prepared.team, window)
            arrays |= told_arrays(told)
        yield replace(
            window,
            topics=prepared.topics,
            arrays=measured(prepared.topics, window.arrays) | arrays,
            designs=prepared.designs,
            input_designs=prepared.input_designs,
            alarms=tuple(in_order(alarms)),
            attachments=prepared.attachments,
            team=team,
        )
        alarm = outputs.alarm[-1] if window.steps else alarm


def concluded(windows: Iterable[RunRecord], overrides: Sequence[str] = ()) -> Iterator[RunRecord]:
    """As recorded, where somebody watched; else as `replay_windows`.

    A stream that was imported holds what its monitors are told and the histories that they learn from, and no
    conclusions: nobody has watched it yet.

    Args:
        windows: Consecutive windows from step 0 on.
        overrides: As for `replay`; any lets fresh monitors watch.

    Raises:
        Exception: As `replay`, with the first window.
    """
    rest = iter(windows)
    first = next(rest, None)
    if first is None:
        return
    told = not first.scenario_text and MONITOR_ATTACHMENT in first.attachments
    known = {link.source for link in first.links} <= {one.dgu for one in first.histories}
    unwatched = told and known and not first.designs
    yield from replay_windows(chain([first], rest), overrides) if overrides or unwatched else chain([first], rest)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Prepared:
    """What a replay designs before its first step; `watch` takes the windows in order."""

    topics: RunTopics
    watch: Watcher
    spoofed: Spoofed
    designs: Mapping[Link, DesignRecord]
    input_designs: Mapping[Link, DesignRecord]
    attachments: Mapping[str, bytes]
    team: TeamProgress | None


def _prepare(record: RunRecord, overrides: Sequence[str], *, redesign: bool) -> _Prepared:
    check_overrides(overrides)
    check_plug_ins(record.path, record.scenario_text, record.versions)
    settings, scenario, attachment = _settings(record, overrides)
    histories = histories_of(record)
    states = max((one.states for one in histories.values()), default=record.topics.widths.states)
    widths = record.topics.widths._replace(states=states)
    parts, rows = parts_of(settings), with_conclusions(record.topics.rows)
    topics = replace(record.topics, parts=parts, has_team=settings.team is not None, widths=widths, rows=rows)
    team = None
    if scenario is not None and topics.has_team:
        if record.team is None or not record.team.histories:
            missing = "/grid/history" if record.topics.has_team else f"/dgu_{record.topics.dgus[0]}/estimate"
            raise BagError(f"{record.path}: holds no {missing}, expected the record of a run with monitor.team")
        if topics.announcing and not any(name.startswith("announced.") for name in record.arrays):
            raise BagError(f"{record.path}: holds no /dgu_{topics.announcing[0]}/inputs, expected it of a team")
        team = team_told(scenario, topics, record.team.histories)
    carried = None if redesign else carried_by(record)
    with said_of(f"{record.path}/{SCENARIO_ATTACHMENT}", overrides):
        designs = design_run(topics, settings, histories, carried=carried, team=team)
        designs.check_start()
        watch = Watcher(designs=designs)
    records = [design for _, design in designs.messages()]
    estimators = len(record.links) if topics.has(Need.INPUTS) else 0
    progress = None
    if designs.team is not None and record.team is not None:
        progress = TeamProgress(team=designs.team, histories=record.team.histories)
    return _Prepared(
        topics=topics,
        watch=watch,
        spoofed=Spoofed(topics.links),
        designs=_by_link(records[: len(records) - estimators]),
        input_designs=_by_link(records[len(records) - estimators :]),
        attachments={**record.attachments, **attachment},
        team=progress,
    )


def carried_by(record: RunRecord) -> Carried:
    """The designs of a recorded run.

    Raises:
        BagError: The record does not say what its monitors were told.
        dgu_sim.errors.ScenarioError: Its scenario cannot be used.
    """
    topics, team = record.topics, {} if record.team is None else record.team.designs
    found = {topics.design(link).topic.name: design for link, design in record.designs.items()}
    found |= {topics.input_design(link).topic.name: design for link, design in record.input_designs.items()}
    found |= {topics.team_design(member).topic.name: design for member, design in team.items()}
    return Carried(settings=_settings(record, ())[0], records=found)


def _by_link(designs: Sequence[DesignRecord]) -> dict[Link, DesignRecord]:
    return {Link(one.source, one.monitor): one for one in designs}


def _settings(record: RunRecord, overrides: Sequence[str]) -> tuple[MonitorSettings, Scenario | None, dict[str, bytes]]:
    """The monitor section, its scenario unless it is of a stream from outside, and the document that tells it."""
    if record.scenario_text:
        scenario = replayed_scenario(record.path, record.scenario_text, overrides)
        versions = with_plug_ins(record.versions, used_plug_ins(scenario.model_dump(mode="json")))
        told = {SCENARIO_ATTACHMENT: scenario.to_yaml().encode()} | (
            {VERSIONS_ATTACHMENT: versions} if versions else {}
        )
        return settings_of(scenario), scenario, told
    if MONITOR_ATTACHMENT not in record.attachments:
        raise BagError(f"{record.path}: holds no {SCENARIO_ATTACHMENT}, expected the scenario of the run")
    source = f"{record.path}/{MONITOR_ATTACHMENT}"
    settings = parse_monitor(record.attachments[MONITOR_ATTACHMENT].decode(), source, overrides)
    return settings, None, {MONITOR_ATTACHMENT: dump(settings.model_dump(mode="json")).encode()}


def histories_of(record: RunRecord) -> dict[int, History]:
    """The recorded history of every DGU that somebody listens to.

    Raises:
        BagError: One is missing or incomplete.
        monitor.errors.HistoryError: Experiments that do not belong together.
    """
    found: dict[int, History] = {}
    for dgu in sorted({link.source for link in record.links}):
        experiments = [one for one in record.histories if one.dgu == dgu]
        if not experiments:
            raise BagError(f"{record.path}: holds no history of DGU {dgu}, expected one: `--history` names another bag")
        announced = experiments[0].experiments
        if len(experiments) != announced:
            raise BagError(f"{record.path}: {len(experiments)} experiments of DGU {dgu}, expected {announced}")
        found[dgu] = history_of(experiments)
    return found
