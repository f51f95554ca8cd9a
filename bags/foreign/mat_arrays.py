"""The arrays of a MAT file, read in a process of its own: scipy's reader can crash on a damaged one.

What comes back from there are the bytes of an .npz file without objects: nothing that a file holds is ever run.
"""

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.errors import BagError

_REASON, _ARRAY = "reason", "array "  # names in what comes back


def mat_arrays(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays by name, `structure.field` for those inside a structure.

    Raises:
        BagError: They cannot be read.
    """
    # no pool of processes, which runs the user's script once more; no module of the working folder
    words = [sys.executable, "-P", "-m", __name__, str(file.resolve())]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)  # noqa: S603 - ourselves
    if done.returncode:
        raise BagError(f"{file}: cannot be read as MAT (damaged: its reader crashed)")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as read:
        found = dict(read)
    reason = found.pop(_REASON, None)
    if reason is not None:
        raise BagError(f"{file}: cannot be read as MAT ({reason!s:.200})")
    return {name.removeprefix(_ARRAY): values for name, values in found.items()}


def _read(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays, or why there are none; what holds no numbers as texts of its shape."""
    from scipy.io import loadmat  # noqa: PLC0415 - heavy

    arrays: dict[str, NDArray[Any]] = {}
    try:
        for name, value in loadmat(str(file), squeeze_me=False, chars_as_strings=True).items():
            if not name.startswith("__"):
                _flatten(name, value, arrays)
    except Exception as error:  # noqa: BLE001 - scipy raises whatever the damaged bytes lead to
        return {_REASON: np.array(" ".join(str(error).split()) or type(error).__name__)}
    return {
        f"{_ARRAY}{name}": values if values.dtype.kind in "biufcSU" else np.empty(values.shape, dtype="U1")
        for name, values in arrays.items()
    }


def _flatten(name: str, value: Any, found: dict[str, NDArray[Any]]) -> None:  # noqa: ANN401 - of scipy
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        for inner in value.dtype.names:
            _flatten(f"{name}.{inner}", value.ravel()[0][inner], found)
    elif isinstance(value, np.ndarray):
        found[name] = value


if __name__ == "__main__":
    np.savez(sys.stdout.buffer, **_read(Path(sys.argv[1])))  # type: ignore[arg-type] # its names are no keywords of numpy
