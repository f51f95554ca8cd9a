"""The front door: the public API, the `dcmg` command, scenarios, studies, the papers: everything that needs no ROS."""
