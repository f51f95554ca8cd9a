"""`python -m dcmg_nodes NAME … --scenario FILE --out DIR`: nodes of a run in this process."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from dgu_sim.errors import DguSimError
from dgu_sim.scenario import load_scenario

from dcmg_nodes.executor import ExecutorKind
from dcmg_nodes.main import NodeOptions, UnknownNodeError, run_nodes
from dcmg_nodes.pacing import PacingMode


def main() -> int:
    """Parse the command line and run the nodes; 0 when the run ended well or was interrupted."""
    parser = argparse.ArgumentParser(prog="python -m dcmg_nodes", description=__doc__)
    parser.add_argument("names", nargs="+", metavar="NAME", help="node: clock, dgu_1, attacker, monitor_1, recorder, …")
    parser.add_argument("--scenario", type=Path, required=True, help="scenario file")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run; the recorder writes its bag there")
    parser.add_argument("--pacing", type=PacingMode, default=PacingMode.LOCKSTEP, help="lockstep or realtime")
    parser.add_argument("--rate", type=float, default=1.0, help="realtime factor of the clock")
    parser.add_argument("--executor", type=ExecutorKind, default=ExecutorKind.EVENTS, help="events or single")
    parser.add_argument("--start-timeout", type=float, default=30.0, help="how long the clock waits for all nodes [s]")
    arguments = parser.parse_args()
    options = NodeOptions(
        out=arguments.out,
        pacing=arguments.pacing,
        rate=arguments.rate,
        executor=arguments.executor,
        start_timeout_sec=arguments.start_timeout,
    )
    try:
        failure = run_nodes(arguments.names, load_scenario(arguments.scenario), options)
    except (DguSimError, UnknownNodeError) as error:
        failure = str(error)
    if failure is not None:
        sys.stderr.write(f"{failure}\n")
    return 0 if failure is None else 1


if __name__ == "__main__":
    sys.exit(main())
