"""What is worked out once about a new object: its symmetry, convex parts and a mesh of a sensible size."""
