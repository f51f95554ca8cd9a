"""A recorded run as what is shown: at any moment, at any speed, forward and back."""

import tempfile
from pathlib import Path

import numpy as np

from bags.mcap.errors import BagError
from bags.runs.live import LiveRun
from bags.runs.reader import open_run
from bags.runs.reproduce import steered
from bags.runs.run_record import RunRecord
from bags.watch.carried import read_carried
from bags.watch.designs import design_scenario
from bags.watch.scenarios import parse_scenario
from bags.wire.origin import SCENARIO_ATTACHMENT
from dcmg.page.board import Board, Steps
from dcmg.page.messages import Attack, Outline
from dcmg.page.outlines import of_record, outline
from dcmg.page.source import RefusalError
from dgu_sim.errors import DguSimError, ScenarioError
from dgu_sim.scenario import Scenario
from monitor.errors import MonitorError


class Recorded:
    """A bag, read as far as somebody has looked; what does not fit into 96 MB stands in a file without a name.

    Args:
        path: The bag.

    Raises:
        BagError: It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        """Stand before step 0."""
        self._run = open_run(path)
        run, topics = self._run, self._run.topics
        outputs = topics.widths.outputs
        self._windows = run.windows()
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the source
        period_sec = topics.sampling_period_ns * 1e-9
        self.board = Board(topics.dgus, topics.links, period_sec, outputs, steps=run.steps, file=self._file)
        self._head = 0
        self._again: LiveRun | None = None
        scenario = _scenario_of(run.attachments.get(SCENARIO_ATTACHMENT, b"").decode(), path)
        self.outline: Outline = outline(
            scenario,
            [of_record(link, run.designs.get(link)) for link in topics.links],
            topics.dgus,
            source="bag",
            name=path.name if scenario is None else scenario.name,
            sampling_period_sec=self.board.sampling_period_sec,
            end_step=run.steps,
            outputs=outputs,
        )

    @property
    def head(self) -> int:
        """One past the step that is shown."""
        return self._head

    def advance(self, steps: int) -> int:
        """Play; see `Source`."""
        before = self._head
        self.seek(before + steps)
        return self._head - before

    def seek(self, step: int) -> None:
        """Show the steps before `step`; what lies between is read first."""
        self._head = min(step, self._run.steps)
        while self.board.trace.end < self._head:
            self.board.add(_happened(next(self._windows)))

    def attack(self, order: Attack) -> str:
        """Refuse: it is over."""
        raise RefusalError(
            f"attack on {order.links[0]}: a recorded run is over; `dcmg page` of its scenario can be attacked"
        )

    def fork(self) -> LiveRun:
        """The scenario run again up to the moment that is shown, with the bag's own designs, attacks by hand included.

        Raises:
            RefusalError: The bag cannot be run again.
        """
        try:
            if self._again is None or self._again.state.step > self._head:
                scenario = steered(self._run.path)
                designs = design_scenario(scenario, carried=read_carried(self._run.path))
                self._again = LiveRun.of(scenario, designs)
            if self._again.state.step < self._head:
                self._again.advance(self._head - self._again.state.step)
        except (BagError, DguSimError, MonitorError) as error:
            raise RefusalError(str(error)) from error
        return self._again.fork()

    def close(self) -> None:
        """Give the file back."""
        self._file.close()


def _scenario_of(text: str, path: Path) -> Scenario | None:
    """The scenario in a bag; None where there is none, or one of another version."""
    try:
        return parse_scenario(text, str(path)) if text else None
    except ScenarioError:
        return None


def _happened(window: RunRecord) -> Steps:
    """A window as it is shown; what an imported stream does not know is NaN."""
    unknown = np.full((window.steps, len(window.topics.dgus)), np.nan)
    y = window.arrays.get("output.y")
    outputs = 0 if y is None else y.shape[-1]
    voltage, current = (unknown if y is None or one >= outputs else y[:, :, one] for one in range(2))
    return Steps(
        first_step=window.first_step,
        voltage=voltage,
        current=current,
        alpha=window.arrays.get("state.alpha", unknown),
        residual=window.residual,
        threshold=window.threshold,
        alarm=window.alarm,
        phase=window.phase,
        events=[one for one in window.events if window.first_step <= one.step < window.end_step],
    )
