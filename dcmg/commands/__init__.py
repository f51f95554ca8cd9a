"""The sub-commands that need no ROS, one file each."""
