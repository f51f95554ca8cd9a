"""Installs what the dcmg command does over ROS 2, as an ament package and as a Python distribution."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "dcmg_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="What the dcmg command does over ROS 2: the supervisor of a run, attacks by hand, launch files",
    license="Apache-2.0",
    python_requires=">=3.11,<3.14",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", [str(path) for path in sorted(Path("launch").glob("*.launch.py"))]),
    ],
    entry_points={
        # the command itself is of the distribution dcmg; colcon puts this one where ros2 run and launch files look
        "console_scripts": ["dcmg = dcmg.cli:main"],
        "dcmg.commands": [
            f"run = {PACKAGE}.run_command:run",
            f"node = {PACKAGE}.node_command:node",
            f"host = {PACKAGE}.host_command:host",
            f"attach = {PACKAGE}.attach_command:attach_app",
            f"attack.start = {PACKAGE}.attack_commands:start_app",
            f"attack.stop = {PACKAGE}.attack_commands:stop",
            f"attack.list = {PACKAGE}.attack_commands:list_",
            f"monitor = {PACKAGE}.monitor_command:monitor",
            f"page.attach = {PACKAGE}.page_command:attach_page",
            f"player = {PACKAGE}.player_commands:app",
            f"replay.publish = {PACKAGE}.replay_publish:publish",
        ],
    },
    zip_safe=False,
)
