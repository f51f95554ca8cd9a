"""Installs the nodes as an ament package and as an ordinary Python distribution."""

from setuptools import find_packages, setup

PACKAGE = "dcmg_nodes"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The nodes of the distributed DC-microgrid simulator",
    license="Apache-2.0",
    python_requires=">=3.11,<3.14",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "fastdds.xml", "gate.xml", "player.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    zip_safe=False,
)
