"""Analysis of a new object: symmetry, convex parts, and mesh simplification."""
