"""Everything that one DGU's monitor runs, stepped as one object."""

from typing import Any

import numpy as np

from monitor.combined import DguMonitor, Received
from monitor.detectors import build
from monitor.link_monitor import LinkMonitor
from monitor.observers import LinearObserver

T_SEC = 0.01


def test_known_inputs_reach_every_link() -> None:
    """Linked as one DGU, two links that send known inputs conclude what each does by itself, bit by bit."""
    generator = np.random.default_rng(1)
    widths = {"A": 2, "B": 3, "M": 2, "D": 3, "H": 2, "J": 3, "Z": 3}  # of v = (u, y): 3, of z: 2
    numbers: dict[str, Any] = {name: generator.uniform(-0.3, 0.3, (2, width)) for name, width in widths.items()}
    alone = LinkMonitor(
        observer=LinearObserver(inputs=1, outputs=2, **numbers),
        detector=build("fixed", {"settle_sec": 0.05, "calibrate_sec": 0.1}, T_SEC),
    )
    together = DguMonitor(links=(alone, alone))
    states, state = [alone.init(), alone.init()], together.init()
    for _ in range(50):
        y, u = generator.uniform(-1.0, 1.0, (2, 2)).tolist(), generator.uniform(-1.0, 1.0, (2, 1)).tolist()
        state, output = together.step(state, [Received(y[0], True, u[0]), Received(y[1], True, u[1])])  # noqa: FBT003
        for at in range(2):
            states[at], expected = alone.step(states[at], y[at], delivered=True, u=u[at])
            np.testing.assert_equal(output.links[at]._asdict(), expected._asdict())
