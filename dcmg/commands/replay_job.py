"""What `dcmg replay` does, once its arguments are parsed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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
    from bags.runs.reader import open_run  # noqa: PLC0415 (heavy)
    from bags.runs.replay import replay_windows  # noqa: PLC0415
    from bags.runs.replay_bag import write_replayed  # noqa: PLC0415
    from bags.runs.replay_settings import history_messages, with_histories  # noqa: PLC0415
    from dcmg.run_tables import show_run  # noqa: PLC0415

    run = open_run(bag)
    windows, told = run.windows(), {}
    if changes.history is not None:
        windows = with_histories(windows, changes.history)
        told = history_messages(changes.history, sorted({link.source for link in run.topics.links}))
    windows = replay_windows(windows, changes.overrides)
    if out is not None:
        windows = write_replayed(out / "bag", windows, told)
    pictures, shown_bag = (None, bag) if out is None else (out / "plots", out / "bag")
    show_run(windows, run.steps, shown_bag, what="replaying", pictures=pictures, json=json)
    return 0
