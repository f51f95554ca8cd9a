"""The environment variables of a run's processes; light, because every client of a run needs it."""

from __future__ import annotations

from importlib import resources


def ros_environment(domain: int) -> dict[str, str]:
    """Return the environment variables of every process that takes part in a run on this machine.

    The Fast DDS profile keeps everything on the loopback interface, over UDP alone: as fast here as shared memory, and
    nothing stays behind in /dev/shm when a node is killed. The discovery range must be SUBNET: with LOCALHOST, rmw
    puts its own transports (shared memory, at most 32 processes) in the place of the profile's.
    """
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(resources.files("dcmg_nodes") / "fastdds.xml"),
    }
