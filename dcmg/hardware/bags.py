"""Writes the example's two bags with the `rosbags` library, from standard messages: nothing of ours is in them.

The numbers come from our simulator and are written down as if they had been measured: single-precision voltages and
currents, stamps of a clock that jitters, and a recording that hears of each message a little later.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dgu_sim.experiment import run_experiments
from dgu_sim.simulate import simulate

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

LAB, FIELD = "lab", "field"
ATTACK_SEC = 4.0
_FIELD_SEC = 6.0
_LAB_SAMPLES = 500
_EPOCH_NS = 1_760_000_000_000_000_000
_JITTER_NS = 20_000
_DELAY_NS = 2_000_000
_SCENARIO = "gallo_six_dgu"
_RESTLESS_LOAD = "dgus.0.load=[{kind: constant, current_a: 10}, {kind: uniform, low_a: -0.5, high_a: 0.5}]"
_STORE = get_typestore(Stores.ROS2_JAZZY)
_BATTERY, _VECTOR = "sensor_msgs/msg/BatteryState", "geometry_msgs/msg/Vector3Stamped"
_HOUSE = "sensor_msgs/msg/JointState"


def write_lab_bag(path: Path, storage: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """Record the bench experiment on DGU 1: connected as in the field, load and reference shaken.

    Args:
        path: directory of the bag; must not exist.
        storage: MCAP or sqlite3.
    """
    scenario = load_scenario(scenario_path(_SCENARIO), [f"history.samples={_LAB_SAMPLES}"])
    (experiment,) = run_experiments(scenario, 1)
    y, d, w = experiment.y, experiment.d, experiment.w
    topics = {
        "/bench/battery": (_BATTERY, [_battery(*row[:2]) for row in y]),
        "/bench/controller": (_VECTOR, [_vector(0.0, 0.0, row[2] * 1e3) for row in y]),
        "/bench/applied": (_VECTOR, [_vector(row[0], row[1], 0.0) for row in d]),
        "/bench/house": (_HOUSE, [_house(row) for row in w]),
    }
    return _write(path, topics, scenario.sampling_period_ns, storage)


def write_field_bag(path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    """Record what arrives at DGU 2 from DGU 1 over the network: from four seconds on, somebody changes it.

    Args:
        path: directory of the bag; must not exist.
        storage: MCAP or sqlite3.
    """
    attack = f"attacks=[{{kind: bias, link: 1-2, start_sec: {ATTACK_SEC}, bias: [0.1, 0.1, 0.1]}}]"
    scenario = load_scenario(scenario_path(_SCENARIO), [f"duration_sec={_FIELD_SEC}", attack, _RESTLESS_LOAD])
    (block,) = simulate(scenario, block_steps=scenario.steps)
    link = [str(one) for one in scenario.links].index("1-2")
    y = block.received[:, 0, link]
    topics = {
        "/from_dgu_1/battery": (_BATTERY, [_battery(*row[:2]) for row in y]),
        "/from_dgu_1/controller": (_VECTOR, [_vector(0.0, 0.0, row[2] * 1e3) for row in y]),
    }
    return _write(path, topics, scenario.sampling_period_ns, storage)


def _write(path: Path, topics: Mapping[str, tuple[str, list[Any]]], period_ns: int, storage: StoragePlugin) -> Path:
    generator = np.random.default_rng(1)
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections = {name: writer.add_connection(name, kind, typestore=_STORE) for name, (kind, _) in topics.items()}
        samples = len(next(iter(topics.values()))[1])
        for step in range(samples):
            stamp = _EPOCH_NS + step * period_ns + int(generator.integers(-_JITTER_NS, _JITTER_NS))
            for name, (kind, messages) in topics.items():
                message = messages[step]
                message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
                heard = stamp + int(generator.integers(_DELAY_NS))
                writer.write(connections[name], heard, _STORE.serialize_cdr(message, kind))
    return path


def _header() -> Any:  # noqa: ANN401 (rosbags makes its classes at run time)
    types: Any = _STORE.types
    return types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")


def _battery(voltage: float, current: float) -> Any:  # noqa: ANN401 (rosbags makes its classes at run time)
    types: Any = _STORE.types
    unmeasured, cells = float("nan"), np.zeros(0, dtype=np.float32)
    numbers = (unmeasured,) * 4  # charge, capacity, design capacity, percentage
    return types[_BATTERY](
        _header(),
        float(voltage),
        unmeasured,
        float(current),
        *numbers,
        0,
        0,
        0,
        True,  # noqa: FBT003 (`present`, by position as rosbags makes its classes)
        cells,
        cells,
        "",
        "",
    )


def _vector(x: float, y: float, z: float) -> Any:  # noqa: ANN401 (rosbags makes its classes at run time)
    types: Any = _STORE.types
    return types[_VECTOR](_header(), types["geometry_msgs/msg/Vector3"](float(x), float(y), float(z)))


def _house(numbers: NDArray[np.float64]) -> Any:  # noqa: ANN401 (rosbags makes its classes at run time)
    types: Any = _STORE.types
    nothing = np.zeros(0)
    names = ["load", "neighbour_2", "neighbour_3", "neighbour_6"][: len(numbers)]
    return types[_HOUSE](_header(), names, np.ascontiguousarray(numbers), nothing, nothing)
