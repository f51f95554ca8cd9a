"""`dcmg simulate`: a run without ROS."""

from __future__ import annotations

from contextlib import closing

import typer

from bags.mcap.recording import ChunkPreset
from dcmg.commands import recording_options as recorded
from dcmg.commands import scenario_options as options


def simulate(
    scenario: options.Scenario,
    *,
    duration: options.Duration = None,
    seed: options.Seed = None,
    out: options.Out = None,
    history: options.History = None,
    designs: options.Designs = None,
    set_: options.Set = None,
    json: options.Json = False,
    plots: options.Plots = True,
    anyway: options.Anyway = False,
    bag_compression: recorded.BagCompression = recorded.CompressionName.ZSTD,
    bag_chunks: recorded.BagChunks = ChunkPreset.COMPACT,
    bag_split_mb: recorded.BagSplitMb = None,
    bag_split_sec: recorded.BagSplitSec = None,
    bag_topics: recorded.BagTopics = None,
    bag_exclude: recorded.BagExclude = None,
) -> None:
    """Do the same run without ROS: the same numbers bit for bit, the same bag, much faster."""
    chosen = options.ScenarioOptions(
        name=scenario,
        duration_sec=duration,
        seed=seed,
        out=out,
        overrides=set_ or [],
        history=history,
        anyway=anyway,
    )
    recording = recorded.recording_of(
        compression=bag_compression,
        chunks=bag_chunks,
        split_mb=bag_split_mb,
        split_sec=bag_split_sec,
        topics=bag_topics,
        exclude=bag_exclude,
    )
    from bags.runs.offline import simulate_to_bag  # noqa: PLC0415 (heavy)
    from bags.wire.origin import host_facts  # noqa: PLC0415 (heavy)
    from dcmg.commands.checking import check_monitors  # noqa: PLC0415 (heavy)
    from dcmg.commands.showing import is_partial, messages, show  # noqa: PLC0415 (heavy)
    from dcmg.live import LiveDisplay  # noqa: PLC0415 (heavy)

    loaded = chosen.load()
    folder = chosen.folder(loaded)
    chosen.check_size(loaded, folder)
    designed = check_monitors(loaded, chosen, designs)
    folder.mkdir(parents=True, exist_ok=True)
    with closing(LiveDisplay(messages, loaded.steps, loaded.sampling_period_sec)) as display:
        bag = simulate_to_bag(loaded, folder / "bag", display.steps, recording, host_facts(), designs=designed)
    show(bag, folder if plots else None, json=json, partial=is_partial(loaded, recording))
    raise typer.Exit(0)
