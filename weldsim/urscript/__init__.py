"""URScript: text to syntax tree to Python generators, one generator a thread of the robot program; functions that need no robot."""
