"""The robot's belief: the semantic map, observed objects, held objects, the base pose."""
