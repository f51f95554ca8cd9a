"""Recordings of any origin, message by message: MCAP, sqlite3, ROS 1."""
