"""A job checked before anything moves: what each waypoint of a path or robot program would do, and what would help."""
