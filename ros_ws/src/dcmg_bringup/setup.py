"""Installs the dcmg command, the scenarios and the launch files, as an ament package and as a Python distribution."""

from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "dcmg_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The dcmg command, the supervisor of a run, the shipped scenarios and the launch files",
    license="Apache-2.0",
    python_requires=">=3.11,<3.14",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", [str(path) for path in sorted(Path("launch").glob("*.launch.py"))]),
    ],
    entry_points={"console_scripts": ["dcmg = dcmg_bringup.cli:main"]},
    zip_safe=False,
)
