"""G's module of the own state: a Luenberger observer that takes the neighbours' received voltages for known inputs."""

from monitor.local.designing import LocalDesign, carried, design, refused
from monitor.local.module import LocalModule, LocalOutput, LocalState

__all__ = ["LocalDesign", "LocalModule", "LocalOutput", "LocalState", "carried", "design", "refused"]
