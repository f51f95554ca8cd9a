"""Recorded runs: records <-> bytes <-> rosbag2 directories, replay and report."""
