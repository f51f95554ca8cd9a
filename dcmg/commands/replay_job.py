"""What `dcmg replay` does, once its arguments are parsed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dcmg.commands.showing import print_summary, shown

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorChanges:
    """How the monitors of a replay differ from those of the run.

    Attributes:
        overrides: changes of the monitor section, "monitor.a.b=value".
        history: bag with the histories that they are designed from, None: those of the run.
    """

    overrides: Sequence[str] = ()
    history: Path | None = None

    @property
    def none(self) -> bool:
        """Whether they are the same."""
        return not self.overrides and self.history is None


def evaluate(bag: Path, changes: MonitorChanges, *, out: Path | None, json: bool) -> int:
    """Evaluate the recorded received outputs of a run again; return the exit code."""
    from bags.reporting.outline import outline  # noqa: PLC0415 (heavy)
    from bags.reporting.plots import draw  # noqa: PLC0415
    from bags.reporting.report import summary  # noqa: PLC0415
    from bags.runs.reader import open_run  # noqa: PLC0415
    from bags.runs.replay import replay_windows  # noqa: PLC0415
    from bags.runs.replay_bag import write_replayed  # noqa: PLC0415
    from bags.runs.replay_settings import history_messages, with_histories  # noqa: PLC0415

    run = open_run(bag)
    windows, told = run.windows(), {}
    if changes.history is not None:
        windows = with_histories(windows, changes.history)
        told = history_messages(changes.history, sorted({link.source for link in run.topics.links}))
    windows = replay_windows(windows, changes.overrides)
    if out is not None:
        windows = write_replayed(out / "bag", windows, told)
    found = outline(shown(windows, run.steps, "replaying"), run.steps)
    pictures = draw(found, out / "plots") if out is not None else ()
    print_summary(summary(found, bag if out is None else out / "bag"), pictures, json=json)
    return 0
