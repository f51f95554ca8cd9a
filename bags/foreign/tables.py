"""Tables of any kind, told apart by the names of their files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from bags.foreign.column_files import open_hdf5, open_mat, open_netcdf3, open_parquet, open_spreadsheet
from bags.foreign.columns import Table
from bags.foreign.text_tables import SUFFIXES as TEXT_SUFFIXES
from bags.foreign.text_tables import open_text
from bags.mcap.errors import BagError
from bags.mcap.kinds import POINTERS, kind_of

_HDF5_MAGIC = b"\x89HDF"
_NETCDF: Final = (".nc", ".netcdf", ".cdf")
_READERS: Mapping[str, Callable[[Path], Table]] = {
    **dict.fromkeys(TEXT_SUFFIXES, open_text),
    **dict.fromkeys((".parquet", ".pq"), open_parquet),
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), open_hdf5),
    ".mat": open_mat,
    ".xlsx": open_spreadsheet,
}
# known, and read by nothing here
_OTHERS: Final = {
    ".xls": "save it as .xlsx or .csv",
    ".ods": "save it as .xlsx or .csv",
    ".feather": "save it as .parquet",
    ".arrow": "save it as .parquet",
    ".json": "save it as .csv",
    ".tdms": "save it as .csv or .h5",
    ".pkl": "a pickle runs code when it is opened: save it as .parquet",
    ".npy": "save it as .csv or .parquet",
    ".npz": "save it as .csv or .parquet",
    ".xz": "decompress it, or use .gz or .zst",
    ".zip": "unpack it",
    ".7z": "unpack it",
    ".tgz": "unpack it",
    ".tar.gz": "unpack it",
    ".html": "save it as .csv",
}


def is_table(source: Path) -> bool:
    """Whether the name of a file says that it is a table."""
    name = source.name.lower()
    return not source.is_dir() and name.endswith((*_READERS, *_NETCDF, *_OTHERS))


def open_table(file: Path) -> Table:
    """Open a table.

    Raises:
        BagError: It cannot be read, or is of a kind that is not supported: one line.
    """
    name = file.name.lower()
    other = next((advice for suffix, advice in _OTHERS.items() if name.endswith(suffix)), None)
    if other is not None:
        raise BagError(f"{file}: tables of this kind are not supported: {other}")
    kind = kind_of(file)
    if kind in POINTERS:
        raise BagError(f"{file}: is {kind.value}")
    if name.endswith(_NETCDF):
        with file.open("rb") as stream:
            return open_hdf5(file) if stream.read(4) == _HDF5_MAGIC else open_netcdf3(file)
    suffix = max((one for one in _READERS if name.endswith(one)), key=len)
    return _READERS[suffix](file)
