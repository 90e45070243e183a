"""Depth and cloud files in, points in the robot base out: `files`, `depth_files`, `deproject`, `filters`."""
