"""Launch every node of a scenario on a full ROS 2 installation: `ros2 launch dcmg_bringup run.launch.py`.

`dcmg run` does the same with supervision, a progress display and a table at the end; this is for people who put the
nodes into launch files of their own.
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from bags.watch.scenarios import load_scenario
from dcmg.shipped import scenario_path
from dcmg_nodes.wiring import wiring_of

ARGUMENTS = {
    "scenario": ("gallo_six_dgu", "name of a shipped scenario or path of a file"),
    "out": ("out/launch", "new folder for the bag"),
    "pacing": ("realtime", "lockstep or realtime"),
    "rate": ("1.0", "real-time factor, with realtime pacing"),
}


def nodes(context: object) -> list[Node]:
    """Return one launch action a node of the scenario."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    scenario = load_scenario(scenario_path(given["scenario"]))
    options = ["--scenario", given["scenario"], "--out", str(Path(given["out"]).resolve())]
    options += ["--pacing", given["pacing"], "--rate", given["rate"]]
    return [
        Node(
            package="dcmg_bringup",
            executable="dcmg",
            arguments=["node", name, *options],
            output="screen",
            on_exit=end_with,
        )
        for name in wiring_of(scenario).nodes
    ]


def end_with(event: ProcessExited, _context: LaunchContext) -> list[EmitEvent]:
    """End all nodes with one that fails; those that have done their steps end by themselves."""
    if event.returncode == 0:
        return []
    reason = f"{event.process_name} ended with exit code {event.returncode}"
    return [EmitEvent(event=Shutdown(reason=reason))]


def generate_launch_description() -> LaunchDescription:
    """Return the launch description that ros2 launch asks for."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])
