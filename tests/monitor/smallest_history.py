"""Smallest history from which on every shipped DGU gets its observer: `python -m tests.monitor.smallest_history`."""

from __future__ import annotations

from pathlib import Path

from bags.wire.convert import history_of, history_records
from dgu_sim import load_scenario, run_experiments
from monitor.observers import design

SCENARIO = Path(__file__).parents[2] / "dcmg/scenarios/gallo_six_dgu.yaml"
LONGEST = 40
CASES: dict[str, tuple[tuple[str, ...], dict[str, object]]] = {
    "exact": ((), {}),
    "noise 1e-3, m_d given": (("history.noise_std=1e-3",), {"unknown_inputs": 2}),
    "noise 1e-3, noise_std given": (("history.noise_std=1e-3",), {"noise_std": 1e-3}),
}


def smallest(dgu: int, overrides: tuple[str, ...], options: dict[str, object]) -> int | None:
    """Fewest samples T from which on every T up to 40 is accepted with two unknown inputs; None when 40 are not."""
    for samples in range(LONGEST, 2, -1):
        scenario = load_scenario(SCENARIO, (f"history.samples={samples}", *overrides))
        made = design("full_order", history_of(history_records(dgu, run_experiments(scenario, dgu))), options)
        data = made.certificate.data
        if not made.accepted or data is None or data.unknown_inputs != 2:
            return samples + 1 if samples < LONGEST else None
    return 3


def main() -> None:
    """Print the table."""
    print("| history | " + " | ".join(f"DGU {dgu}" for dgu in range(1, 7)) + " |")
    print("|---" * 7 + "|")
    for name, (overrides, options) in CASES.items():
        found = [smallest(dgu, overrides, options) for dgu in range(1, 7)]
        print(f"| {name} | " + " | ".join("-" if one is None else str(one) for one in found) + " |")


if __name__ == "__main__":
    main()
