"""Recorded data in the containers of other libraries: Arrow tables, pandas data frames, xarray data sets."""

import json
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bags.mcap.bag import Bag, TopicBlock
from bags.mcap.definitions import Decoder
from bags.mcap.errors import BagError
from bags.mcap.typestore import PACKAGE
from bags.runs.reader import WINDOW_STEPS, Run, open_run
from bags.tables.rows import kinds, rows, standard_decoder

_ROWS = 1000
_ARROW = {
    "float32": "float32",
    "float64": "float64",
    "bool": "bool_",
    "string": "string",
    "byte": "uint8",
    "char": "uint8",
}
# dimensions and unit of every array of a run; the last axis of states, outputs and residuals is "component"
_VECTOR, _PER_LINK = ("component",), ("step", "link")
_ARRAYS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "x": (("step", "dgu", *_VECTOR), "V, A, V s", "true state: V, I_t, v"),
    "y": (("step", "dgu", *_VECTOR), "V, A, V s", "output as sent"),
    "load_current": (("step", "dgu"), "A", "load current I_L"),
    "reference": (("step", "dgu"), "V", "V_ref + alpha"),
    "alpha": (("step", "dgu"), "V", "secondary correction"),
    "received": ((*_PER_LINK, *_VECTOR), "V, A, V s", "output as received"),
    "delivered": (_PER_LINK, "", "whether the sample arrived"),
    "estimate": ((*_PER_LINK, *_VECTOR), "V, A, V s", "state estimate"),
    "residual": ((*_PER_LINK, *_VECTOR), "V, A, V s", "residual"),
    "threshold": ((*_PER_LINK, *_VECTOR), "V, A, V s", "threshold"),
    "phase": (_PER_LINK, "", "phase of the monitor, as in Residual.msg"),
    "alarm": (_PER_LINK, "", "verdict of the monitor"),
}


def table(bag: Bag, topic: str) -> Any:  # noqa: ANN401 - pyarrow ships no types
    """All messages of a topic as a `pyarrow.Table`: `time_ns`, then one column a number; lists where lengths vary.

    Raises:
        BagError: No such topic, an unknown type, or the bag is damaged.
    """
    arrow = library("pyarrow")
    parts = list(tables(bag, topic, text_lists=False))
    return arrow.concat_tables(parts) if parts else arrow.table({"time_ns": arrow.array([], arrow.int64())})


def dataframe(bag: Bag, topic: str) -> Any:  # noqa: ANN401 - an optional library
    """The same as a `pandas.DataFrame`.

    Raises:
        BagError: As `table`, or pandas is not installed.
    """
    library("pandas")
    return table(bag, topic).to_pandas()


def dataset(run: Run | Path | str) -> Any:  # noqa: ANN401 - an optional library
    """A whole run as an `xarray.Dataset` with the dimensions step, dgu, link and component, and units.

    Raises:
        BagError: Not a run, or xarray is not installed.
    """
    xarray = library("xarray")
    opened = run if isinstance(run, Run) else open_run(run)
    (record,) = opened.windows(max(opened.steps, 1))
    variables = {
        name: (dimensions, getattr(record, name), _attributes(unit, what))
        for name, (dimensions, unit, what) in _ARRAYS.items()
    }
    time = ("step", record.time_sec, _attributes("s", "simulated time"))
    return xarray.Dataset(variables, coords={"time": time, **_labels(opened)}, attrs=_about(opened))


def write_netcdf(path: Path | str, file: Path | str, window_steps: int = WINDOW_STEPS) -> Path:
    """Write a run as one netCDF-4 file, window by window: the data set of `dataset`, however long the run is.

    Args:
        path: The bag's directory.
        file: Where to.
        window_steps: How many steps are in memory.

    Raises:
        BagError: Not a run, or one without a step; h5netcdf is not installed, or the file cannot be written.
    """
    h5netcdf = library("h5netcdf")
    run, file = open_run(path), Path(file)
    if not run.steps:
        raise BagError(f"{path}: the run has no complete step, expected at least one")
    try:
        with h5netcdf.File(file, "w") as out:
            out.dimensions = {"step": run.steps, "dgu": len(run.topics.dgus), "link": len(run.links), "component": 3}
            for name, value in _about(run).items():
                out.attrs[name] = value
            text = library("h5py").string_dtype()
            for name, values in _labels(run).items():
                labels = np.array(values, dtype=object if name != "dgu" else np.int64)
                out.create_variable(name, (name,), dtype=text if name != "dgu" else labels.dtype)[...] = labels
            targets = {name: _variable(out, name) for name in _ARRAYS}
            time = out.create_variable("time", ("step",), "f8")
            time.attrs["units"] = "s"
            for window in run.windows(window_steps):
                at = slice(window.first_step, window.end_step)
                time[at] = window.time_sec
                for name, target in targets.items():
                    values = getattr(window, name)
                    target[at] = values.astype("i1") if values.dtype == np.bool_ else values
    except OSError as error:
        raise BagError(f"{file}: cannot write the file ({error.strerror or error})") from error
    return file


def tables(bag: Bag, topic: str, *, text_lists: bool) -> Iterator[Any]:
    """A topic as consecutive `pyarrow.Table`s of one schema.

    Args:
        bag: The bag.
        topic: ROS topic name.
        text_lists: Whether what varies in length is written as JSON, for formats that know only numbers and texts.

    Raises:
        BagError: As `table`.
    """
    arrow = library("pyarrow")
    # only our own strings never change; those of others are columns of text
    if bag.is_fixed(topic) and bag.type_of(topic).startswith(PACKAGE):
        for block in bag.blocks(topic):
            yield arrow.table({name: np.ascontiguousarray(values) for name, values in columns(block).items()})
        return
    make = table_maker(standard_decoder(bag.type_of(topic)), text_lists=text_lists)
    for part in _batched(rows(bag, topic)):
        yield make(part)


def table_maker(decoder: Decoder, *, text_lists: bool) -> Callable[[Sequence[dict[str, Any]]], Any]:
    """What makes a `pyarrow.Table` of rows of one type, `time_ns` first.

    Args:
        decoder: Of the type.
        text_lists: As for `tables`.
    """
    arrow = library("pyarrow")
    types = {"time_ns": arrow.int64(), **_arrow_types(arrow, decoder)}
    nested = [name for name, kind in types.items() if text_lists and (kind is None or arrow.types.is_list(kind))]
    texts: dict[str, Callable[[object], object]] = dict.fromkeys(nested, json.dumps)

    def make(part: Sequence[dict[str, Any]]) -> Any:  # noqa: ANN401 - pyarrow ships no types
        return arrow.table(
            {
                name: arrow.array(
                    [texts.get(name, _same)(row[name]) for row in part], arrow.string() if name in texts else kind
                )
                for name, kind in types.items()
            }
        )

    return make


def columns(block: TopicBlock) -> dict[str, NDArray[Any]]:
    """The numbers of a block as columns of shape (messages,), by name."""
    found: dict[str, NDArray[Any]] = {"time_ns": block.time_ns}
    for name in block.data.dtype.names or ():
        values = block.data[name]
        if values.dtype.kind in "SV":  # the string and the encapsulation are the same in every message
            continue
        if name.endswith(".length") and name.removesuffix(".length") in (block.data.dtype.names or ()):
            continue
        if values.ndim == 1:
            found[name] = values
        else:
            found |= {f"{name}[{position}]": values[:, position] for position in range(values.shape[1])}
    return found


def library(name: str) -> ModuleType:
    """Import a library that only this needs.

    Raises:
        BagError: It is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise BagError(f"this needs the Python package {name}, found none: pip install 'dcmg[tables]'") from error


def _batched(found: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while part := list(islice(found, _ROWS)):
        yield part


def _same(value: object) -> object:
    return value


def _arrow_types(arrow: ModuleType, decoder: Decoder) -> dict[str, Any]:
    """Arrow type of each column, None where Arrow is to find it out: for lists of messages."""
    found: dict[str, Any] = {}
    for name, kind in kinds(decoder).items():
        base = None if kind == ("struct",) else getattr(arrow, _ARROW.get(kind[-1], kind[-1]))()
        found[name] = arrow.list_(base) if kind[0] == "list" else base
    return found


def _variable(out: Any, name: str) -> Any:  # noqa: ANN401 - h5netcdf ships no types
    dimensions, unit, what = _ARRAYS[name]
    dtype = "i1" if name in {"delivered", "alarm"} else "u1" if name == "phase" else "f8"
    variable = out.create_variable(name, dimensions, dtype, compression="gzip", compression_opts=1)
    for key, value in _attributes(unit, what).items():
        variable.attrs[key] = value
    return variable


def _attributes(unit: str, what: str) -> dict[str, str]:
    return {"long_name": what, **({"units": unit} if unit else {})}


def _labels(run: Run) -> dict[str, list[int] | list[str]]:
    return {
        "dgu": list(run.topics.dgus),
        "link": [str(link) for link in run.links],
        "component": ["V", "I_t", "v"],
    }


def _about(run: Run) -> dict[str, str | float]:
    return {"bag": str(run.path), "sampling_period_sec": run.topics.sampling_period_ns * 1e-9}
