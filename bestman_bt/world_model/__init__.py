"""What the robot believes: the semantic map, seen objects, what it holds, where it is."""
