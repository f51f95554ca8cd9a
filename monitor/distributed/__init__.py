"""Distributed data-driven unknown-input observers: nodes that see little each and together estimate the whole state."""

from monitor.distributed.designing import KIND, DistributedOptions, design
from monitor.distributed.gains import NodeGains
from monitor.distributed.network import Network, linked, ring
from monitor.distributed.node import NodeObserver, NodeOutput
from monitor.distributed.regressors import Regressors, derivatives, filtered, integral, sampled
from monitor.distributed.report import DistributedDesign, DistributedReport

__all__ = [
    "KIND",
    "DistributedDesign",
    "DistributedOptions",
    "DistributedReport",
    "Network",
    "NodeGains",
    "NodeObserver",
    "NodeOutput",
    "Regressors",
    "derivatives",
    "design",
    "filtered",
    "integral",
    "linked",
    "ring",
    "sampled",
]
