"""What a replay may change of its run: the monitors, and the histories that they are designed from."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from bags.mcap.errors import BagError
from bags.runs.run_record import RunRecord
from bags.watch.histories import read_histories
from bags.watch.scenarios import parse_scenario
from bags.wire.origin import SCENARIO_ATTACHMENT
from bags.wire.schema import run_topics
from dgu_sim.scenario import Scenario

_MONITOR_SECTION = "monitor."


def check_overrides(overrides: Sequence[str]) -> None:
    """See that only monitors are to be changed.

    Raises:
        BagError: Something else is.
    """
    for override in overrides:
        if not override.startswith(_MONITOR_SECTION):
            raise BagError(f"override {override!r}: a replay changes only {_MONITOR_SECTION}observer and .detector")


def replayed_scenario(path: Path, text: str, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a recorded run with changed monitors.

    Args:
        path: The bag.
        text: Its scenario as YAML, "" when it holds none.
        overrides: Changes of the monitor section, "monitor.observer.kind=value" and the like.

    Raises:
        BagError: The bag holds no scenario; an override is not about monitors.
        dgu_sim.errors.ScenarioError: An override does not fit the scenario.
    """
    check_overrides(overrides)
    if not text:
        raise BagError(f"{path}: holds no {SCENARIO_ATTACHMENT}, expected the scenario of the run")
    return parse_scenario(text, source=f"{path}/{SCENARIO_ATTACHMENT}", overrides=overrides)


def with_histories(windows: Iterable[RunRecord], path: Path) -> Iterator[RunRecord]:
    """The windows of a run as if its DGUs had been recorded in other experiments.

    Args:
        windows: Consecutive windows.
        path: Bag with a history of every DGU that somebody listens to; the run's scenario will name it.

    Raises:
        BagError: The bag cannot be read or lacks one.
    """
    histories = None
    text = b""
    for window in windows:
        if histories is None:
            sources = sorted({link.source for link in window.links})
            histories = tuple(record for source in sources for record in read_histories(path, source))
            if window.scenario_text:
                text = _naming(window, path).encode()
        attachments = {**window.attachments, SCENARIO_ATTACHMENT: text} if text else window.attachments
        # what was designed from the run's own histories is of no use to these
        yield replace(window, histories=histories, attachments=attachments, designs={}, input_designs={})


def history_messages(path: Path, dgus: Sequence[int]) -> dict[str, list[bytes]]:
    """The messages that tell the histories in a bag, by topic.

    Args:
        path: Bag with a history of every DGU asked for.
        dgus: Numbers of the DGUs.

    Raises:
        BagError: The bag cannot be read or lacks one.
    """
    codecs = [run_topics((dgu,), (), 1).history(dgu) for dgu in dgus]
    return {codec.topic.name: [codec.encode(one) for one in read_histories(path, codec.dgu)] for codec in codecs}


def _naming(window: RunRecord, path: Path) -> str:
    overrides = [f"history.bag={json.dumps(str(path.resolve()))}"]
    return parse_scenario(window.scenario_text, source=str(window.path), overrides=overrides).to_yaml()
