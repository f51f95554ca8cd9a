"""The numerical tests under other BLAS kernels than the processor's own: `make kernels`.

OpenBLAS picks its kernels by processor, and with them the order of sums. OPENBLAS_CORETYPE makes the OpenBLAS in the
wheels of numpy and scipy take those of an older processor; which ones this processor can run its flags tell.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

# newest first: the kernels' name, and what they need of the processor
CORES = (
    ("SkylakeX", {"avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512cd"}),
    ("Haswell", {"avx2", "fma"}),
    ("Sandybridge", {"avx"}),
    ("Nehalem", {"sse4_2"}),
)
HOW_MANY = 2
TESTS = (
    "tests/monitor",
    *(f"tests/papers/test_{name}.py" for name in ("turan_2021", "ruio_example", "delayed", "input_reconstruction")),
    "tests/bags/test_golden.py",
    "tests/fuzz",
)
_ASK = (
    "import json, numpy, scipy.linalg, threadpoolctl; "
    "print(json.dumps([one['architecture'] for one in threadpoolctl.threadpool_info() if one['user_api'] == 'blas']))"
)


def kernels_in_use(core: str | None) -> set[str]:
    """Kernels that numpy and scipy take when asked for those of `core`, or when asked for none."""
    found = subprocess.run([sys.executable, "-c", _ASK], env=_environment(core), check=True, capture_output=True)
    return set(json.loads(found.stdout))


def others() -> list[str]:
    """The newest kernels that this processor can run and does not take by itself."""
    cpu = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    flags = set(next(line for line in cpu.splitlines() if line.startswith("flags")).split())
    own = kernels_in_use(None)
    return [core for core, needed in CORES if needed <= flags and core not in own][:HOW_MANY]


def _environment(core: str | None) -> dict[str, str]:
    """One thread, and the kernels asked for whatever was asked for outside."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("OPENBLAS_CORETYPE", None)
    return environment if core is None else {**environment, "OPENBLAS_CORETYPE": core}


def main() -> int:
    """Run all kernels beside each other, tell of each, and fail when one does."""
    cores, failed = others(), False
    if len(cores) < HOW_MANY:
        print(f"only {cores} besides {kernels_in_use(None)} can run here, expected {HOW_MANY} kernels")
        return 1
    with tempfile.TemporaryDirectory() as folder:
        logs = [Path(folder) / core for core in cores]
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(sys.argv[1:] or TESTS)]
        running = []
        for core, log in zip(cores, logs, strict=True):
            if kernels_in_use(core) != {core}:
                print(f"OPENBLAS_CORETYPE={core} gives {kernels_in_use(core)}")
                return 1
            with log.open("wb") as out:
                running.append(subprocess.Popen(command, env=_environment(core), stdout=out, stderr=out))
        for core, log, process in zip(cores, logs, running, strict=True):
            failed |= process.wait() != 0
            lines = log.read_text(encoding="utf-8").splitlines()
            print(f"{core}:", *(lines if process.returncode else lines[-1:]), sep="\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
