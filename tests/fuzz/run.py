"""Fuzzing of all public designs: `make fuzz MINUTES=10`, or one case again with `--kind … --seed …`."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: matrices are small, and there is a process a core

import argparse
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from multiprocessing import get_context
from secrets import randbelow
from typing import TYPE_CHECKING

from tests.fuzz.judge import Outcome, Result
from tests.fuzz.trials import TRIALS, judged

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from concurrent.futures import Future

_ROUND = 4  # times the shares of all kinds a worker takes at a time
_SHOWN = 12  # findings of one kind and outcome that are printed in full


@dataclass(slots=True)
class Tally:
    """What was found so far."""

    counts: Counter[tuple[str, Outcome]] = field(default_factory=Counter)
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    findings: list[Result] = field(default_factory=list)

    def add(self, results: Sequence[tuple[Result, float]], shown: frozenset[Outcome]) -> None:
        """Take the results of one worker, print what is worth it."""
        for result, seconds in results:
            key = (result.kind, result.outcome)
            self.counts[key] += 1
            self.seconds[result.kind] += seconds
            if result.outcome.bad:
                self.findings.append(result)
            if result.outcome in shown and self.counts[key] <= _SHOWN:
                print(f"{result.outcome.value}: {result.example}  # {result.detail[:900]}", flush=True)


def attempt(kinds: Sequence[str], first: int, rounds: int) -> list[tuple[Result, float]]:
    """Judge one chunk of cases."""
    results, seed = [], first
    for _ in range(rounds):
        for kind in kinds:
            for _ in range(TRIALS[kind].share):
                start = time.perf_counter()
                result = judged(kind, seed)
                results.append((result, time.perf_counter() - start))
                seed += 1
    return results


def chunks(first: int) -> Iterator[int]:
    """First seeds of the chunks."""
    while True:
        yield first
        first += 1000


def explore(kinds: Sequence[str], options: argparse.Namespace) -> Tally:
    """Let all workers run until the time is over."""
    tally, end = Tally(), time.monotonic() + 60.0 * options.minutes
    shown = frozenset(one for one in Outcome if one.bad or one.name.lower() in options.show)
    pending: set[Future[list[tuple[Result, float]]]] = set()
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        for seed in chunks(options.first):
            pending.add(pool.submit(attempt, kinds, seed, _ROUND))
            if len(pending) > options.workers:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                for one in done:
                    tally.add(one.result(), shown)
            if time.monotonic() > end:
                break
        for one in pending:
            tally.add(one.result(), shown)
    return tally


def table(tally: Tally) -> str:
    """Counts of every kind as a Markdown table."""
    kinds = [kind for kind in TRIALS if any(key[0] == kind for key in tally.counts)]
    used = [one for one in Outcome if one.bad or any(tally.counts[kind, one] for kind in kinds)]
    lines = ["| kind | designs | " + " | ".join(one.value for one in used) + " | ms each |"]
    lines.append("|---" * (len(used) + 3) + "|")
    for kind in (*kinds, "all"):
        chosen = kinds if kind == "all" else [kind]
        counts = [sum(tally.counts[one, outcome] for one in chosen) for outcome in used]
        total = sum(tally.counts[one, outcome] for one in chosen for outcome in Outcome)
        each = 1e3 * sum(tally.seconds[one] for one in chosen) / max(total, 1)
        lines.append(f"| {kind} | {total} | " + " | ".join(map(str, counts)) + f" | {each:.1f} |")
    return "\n".join(lines)


def main() -> int:
    """Explore or repeat; 1 when a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--first", type=int, default=randbelow(10**9) * 1000, help="first seed; fresh unless given")
    parser.add_argument("--kind", action="append", help=f"one of {', '.join(TRIALS)}; all unless given")
    parser.add_argument("--seed", type=int, help="repeat this one case of --kind")
    parser.add_argument("--show", nargs="*", default=["disputed"], help="outcomes to print besides the bad ones")
    options = parser.parse_args()
    kinds = options.kind or list(TRIALS)
    if options.seed is not None:
        results = [judged(kind, options.seed) for kind in kinds]
        for result in results:
            print(f"{result.kind} {result.seed}: {result.outcome.value}\n  {result.detail}")
        return int(any(result.outcome.bad for result in results))
    start = time.monotonic()
    tally = explore(kinds, options)
    total, elapsed = sum(tally.counts.values()), time.monotonic() - start
    print(table(tally))
    print(f"\n{total} designs in {elapsed:.0f} s, {total / elapsed:.0f} a second; first seed {options.first}")
    if tally.findings:
        print(f"{len(tally.findings)} broken promises; examples for tests/fuzz/counter_examples.py:")
        print("\n".join(result.example for result in tally.findings))
    return int(bool(tally.findings))


if __name__ == "__main__":
    sys.exit(main())
