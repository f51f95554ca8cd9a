"""The arrays of a MAT file, read in a process of its own: scipy's reader can crash on a damaged one."""

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError


def mat_arrays(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays by name, `structure.field` for those inside a structure.

    Raises:
        BagError: They cannot be read.
    """
    # no pool of processes: that runs the user's script once more
    words = [sys.executable, "-m", __name__, str(file.resolve())]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)  # noqa: S603 - ourselves
    if done.returncode:
        raise BagError(f"{file}: cannot be read as MAT (damaged: its reader crashed)")
    found = pickle.loads(done.stdout)  # noqa: S301 - written below
    if isinstance(found, str):
        raise BagError(f"{file}: cannot be read as MAT ({found:.200})")
    arrays: dict[str, NDArray[Any]] = found
    return arrays


def _read(file: Path) -> dict[str, NDArray[Any]] | str:
    """The arrays, or why there are none."""
    from scipy.io import loadmat  # noqa: PLC0415 - heavy

    arrays: dict[str, NDArray[Any]] = {}
    try:
        for name, value in loadmat(str(file), squeeze_me=False, chars_as_strings=True).items():
            if not name.startswith("__"):
                _flatten(name, value, arrays)
    except Exception as error:  # noqa: BLE001 - scipy raises whatever the damaged bytes lead to
        return " ".join(str(error).split()) or type(error).__name__
    return arrays


def _flatten(name: str, value: Any, found: dict[str, NDArray[Any]]) -> None:  # noqa: ANN401 - of scipy
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        for inner in value.dtype.names:
            _flatten(f"{name}.{inner}", value.ravel()[0][inner], found)
    elif isinstance(value, np.ndarray):
        found[name] = value


if __name__ == "__main__":
    sys.stdout.buffer.write(pickle.dumps(_read(Path(sys.argv[1]))))
