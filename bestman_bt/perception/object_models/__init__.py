"""What is worked out once about a new object: its symmetry, convex parts and a mesh of a sensible size."""

from bestman_bt.perception.object_models.closed import is_closed
from bestman_bt.perception.object_models.convex_parts import ConvexPartsParameters, convex_parts
from bestman_bt.perception.object_models.simplified import simplified
from bestman_bt.perception.object_models.symmetry import SymmetryParameters, symmetry_order

__all__ = ["ConvexPartsParameters", "SymmetryParameters", "convex_parts", "is_closed", "simplified", "symmetry_order"]
