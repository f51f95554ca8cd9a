"""How far designs lie apart on processors with other BLAS kernels: `python -m tests.monitor.kernel_figures`."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np

from monitor.observers import LinearObserver, design
from tests.monitor.conftest import dgu_plant

KERNELS = ("Haswell", "Sandybridge", "Nehalem", "Prescott")
CASES: dict[str, tuple[str, dict[str, object], float]] = {
    "full_order, minimum_norm": ("full_order", {}, 0.0),
    "full_order, dual_lqr": ("full_order", {"strategy": "dual_lqr"}, 0.0),
    "full_order, pole_placement": ("full_order", {"strategy": "pole_placement"}, 0.0),
    "full_order, max_sensitivity": ("full_order", {"strategy": "max_sensitivity"}, 0.0),
    "reduced_order, minimum_norm": ("reduced_order", {}, 0.0),
    "full_order, noise 1e-3": ("full_order", {"unknown_inputs": 2}, 1e-3),
}


def designs() -> dict[str, list[float]]:
    """All entries of the matrices of every case, over the six DGUs, 100 samples each."""
    found = {}
    for name, (kind, options, noise_std) in CASES.items():
        numbers: list[float] = []
        for dgu in range(1, 7):
            generator = np.random.default_rng(dgu)
            history = dgu_plant(dgu).history(generator, samples=100, mean=(11.0, 50.0), noise_std=noise_std)
            observer = design(kind, history, options).observer
            if isinstance(observer, LinearObserver):
                for matrix in observer.matrices().values():
                    numbers += matrix.ravel().tolist()
        found[name] = numbers
    return found


def with_kernel(kernel: str) -> dict[str, list[float]]:
    """The designs of a fresh process with these kernels, '' for those of the processor."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    if kernel:
        environment["OPENBLAS_CORETYPE"] = kernel
    command = [sys.executable, "-m", "tests.monitor.kernel_figures", "--designs"]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found: dict[str, list[float]] = json.loads(answer.stdout)
    return found


def apart(kernels: tuple[str, ...]) -> dict[str, tuple[float, int, int]]:
    """For each case the largest difference between any two kernels, how many entries differ, and of how many."""
    found = [with_kernel(kernel) for kernel in kernels]
    table = {}
    for name in CASES:
        entries = np.array([one[name] for one in found])
        spread = np.max(entries, axis=0) - np.min(entries, axis=0)
        table[name] = (float(np.max(spread)), int(np.count_nonzero(spread)), entries.shape[1])
    return table


def main() -> None:
    """Print the designs of this process, or the table."""
    if "--designs" in sys.argv:
        print(json.dumps(designs()))
        return
    print("| design | largest difference | entries that differ |\n|---|---|---|")
    for name, (difference, count, entries) in apart(KERNELS).items():
        print(f"| {name} | {difference:.1g} | {count} of {entries} |")


if __name__ == "__main__":
    main()
