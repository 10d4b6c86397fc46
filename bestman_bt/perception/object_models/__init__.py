"""What is worked out once about a new object: its symmetry, convex parts and a mesh of a sensible size."""

from bestman_bt.perception.object_models.convex_parts import ConvexDecomposition, is_closed, simplified
from bestman_bt.perception.object_models.symmetry import SymmetrySearch

__all__ = ["ConvexDecomposition", "SymmetrySearch", "is_closed", "simplified"]
