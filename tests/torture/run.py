"""Torture: `make torture MINUTES=10`, or one case again with `--kind … --seed …`."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from tests.torture.composed import composed
from tests.torture.damaged import damaged
from tests.torture.hostile import hostile
from tests.torture.kills import killed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tests.torture.outcome import Outcome

KINDS: Mapping[str, Callable[[int, Path], Outcome]] = {
    "kills": killed,
    "composed": composed,
    "bags": damaged,
    "entries": hostile,
}


def table(outcomes: Sequence[Outcome]) -> str:
    """Counts of every row as a Markdown table."""
    total: Counter[tuple[str, str]] = Counter((one.kind, one.row) for one in outcomes)
    broken: Counter[tuple[str, str]] = Counter((one.kind, one.row) for one in outcomes if one.broken)
    longest: defaultdict[tuple[str, str], float] = defaultdict(float)
    notes: defaultdict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for one in outcomes:
        key = (one.kind, one.row)
        longest[key] = max(longest[key], one.seconds) if one.seconds == one.seconds else longest[key]
        notes[key].update([one.note] if one.note else [])
    lines = ["| kind | case | tried | promise broken | longest, s | of these |", "|---|---|---|---|---|---|"]
    for key in sorted(total):
        said = ", ".join(f"{count} {note}" for note, count in sorted(notes[key].items()))
        cells = (key[0], key[1].replace(" | ", ", "), total[key], broken[key], f"{longest[key]:.1f}", said)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    for kind in sorted({one.kind for one in outcomes}):
        chosen = [one for one in outcomes if one.kind == kind]
        lines.append(f"| {kind} | all | {len(chosen)} | {sum(bool(one.broken) for one in chosen)} | | |")
    return "\n".join(lines)


def tried(kind: str, seed: int, folder: Path) -> Outcome:
    """Try one case, and print it when a promise is broken."""
    outcome = KINDS[kind](seed, folder)
    if outcome.broken:
        again = f"python -m tests.torture.run --kind {kind} --seed {seed}"
        print(f"BROKEN {outcome.what}  # {again}\n  " + "\n  ".join(outcome.broken), flush=True)
    return outcome


def main() -> int:
    """Torture or repeat; 1 when a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="of all kinds together, shared equally")
    parser.add_argument("--kind", action="append", choices=[*KINDS], help="all unless given")
    parser.add_argument("--first", type=int, default=0, help="first seed of each kind")
    parser.add_argument("--count", type=int, default=sys.maxsize, help="most cases of each kind")
    parser.add_argument("--seed", type=int, help="repeat this one case of --kind")
    options = parser.parse_args()
    kinds = options.kind or [*KINDS]
    outcomes: list[Outcome] = []
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="dcmg_torture_") as folder:
        for number, kind in enumerate(kinds, start=1):
            end = start + 60.0 * options.minutes * number / len(kinds)
            for seed in range(options.first, options.first + options.count) if options.seed is None else [options.seed]:
                outcomes.append(tried(kind, seed, Path(folder)))
                if time.monotonic() > end:
                    break
    print(table(outcomes))
    print(f"\n{len(outcomes)} cases in {time.monotonic() - start:.0f} s; first seed {options.first}")
    return int(any(one.broken for one in outcomes))


if __name__ == "__main__":
    sys.exit(main())
