"""What `dcmg replay` does, once its arguments are parsed."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from bags.runs.run_record import RunRecord
    from bags.watch.carried import Carried


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorChanges:
    """How the monitors of a replay differ from those of the run.

    Attributes:
        overrides: changes of the monitor section, "monitor.a.b=value".
        history: bag with the histories that they are designed from, None: those of the run.
        redesign: everything is designed anew, from the same histories too.
    """

    overrides: Sequence[str] = ()
    history: Path | None = None
    redesign: bool = False

    @property
    def none(self) -> bool:
        """Whether they are the same."""
        return not self.overrides and not self.anew

    @property
    def anew(self) -> bool:
        """Whether the designs in the bag are of no use."""
        return self.redesign or self.history is not None


def evaluate(bag: Path, changes: MonitorChanges, *, out: Path | None, json: bool) -> int:
    """Evaluate the recorded received outputs of a run again; return the exit code."""
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from bags.runs.replay import replay_windows  # noqa: PLC0415
    from bags.runs.replay_bag import write_replayed  # noqa: PLC0415
    from bags.runs.replay_settings import history_messages, with_histories  # noqa: PLC0415
    from bags.wire.origin import SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT  # noqa: PLC0415
    from bags.wire.plugins import check_plug_ins  # noqa: PLC0415
    from dcmg.commands.showing import messages  # noqa: PLC0415
    from dcmg.run_tables import show_run  # noqa: PLC0415

    run = open_run(bag)
    scenario, versions = (run.attachments.get(name, b"") for name in (SCENARIO_ATTACHMENT, VERSIONS_ATTACHMENT))
    for line in check_plug_ins(run.path, scenario.decode(), versions):
        messages.print(line, highlight=False, markup=False, soft_wrap=True)
    recorded: list[Carried] = []
    windows, told = _noted(run.windows(), recorded), {}
    if changes.history is not None:
        windows = with_histories(windows, changes.history)
        told = history_messages(changes.history, sorted({link.source for link in run.topics.links}))
    windows = _noted(replay_windows(windows, changes.overrides, redesign=changes.anew), recorded)
    if out is not None:
        windows = write_replayed(out / "bag", windows, told)
    pictures, shown_bag = (None, bag) if out is None else (out / "plots", out / "bag")
    show_run(windows, run.steps, shown_bag, what="replaying", pictures=pictures, json=json)
    for name, record in recorded[-1].records.items():
        if not record.accepted:
            messages.print(f"not monitored: {name}: {record.verdict}", highlight=False, markup=False, soft_wrap=True)
    for name, apart in recorded[0].compared(recorded[1].records).items() if len(recorded) > 1 else ():
        if apart or changes.redesign:
            messages.print(f"designed anew: {name}: {_words(apart)}", highlight=False, markup=False, soft_wrap=True)
    return 0


def _noted(windows: Iterable[RunRecord], designs: list[Carried]) -> Iterator[RunRecord]:
    """Pass windows on and note what the first one says about designs."""
    from bags.runs.replay import carried_by  # noqa: PLC0415 (heavy)

    for number, window in enumerate(windows):
        if number == 0:
            designs.append(carried_by(window))
        yield window


def _words(apart: float) -> str:
    if isfinite(apart):
        return f"matrices within {apart:.1e} of the recorded ones, relative to the largest entry"
    return "of another kind than the recorded one"
