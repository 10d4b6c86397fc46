"""What the robot believes: the semantic map, seen objects, what it holds, where it is."""

from bestman_bt.world_model.openness import (
    Openness,
    containers_before,
    handle_shape,
    is_open,
    is_shut,
    leaf_called,
    leaf_shapes,
    open_leaves,
    openness_of,
)
from bestman_bt.world_model.semantic_map import MapFurniture, MapLeaf, MapSurface, SemanticMap
from bestman_bt.world_model.world_model import (
    MOVED,
    BasePose,
    HandleBelief,
    HeldObject,
    ObjectBelief,
    ObjectChange,
    Obstacle,
    WorldModel,
)

__all__ = [
    "MOVED",
    "BasePose",
    "HandleBelief",
    "HeldObject",
    "MapFurniture",
    "MapLeaf",
    "MapSurface",
    "ObjectBelief",
    "ObjectChange",
    "Obstacle",
    "Openness",
    "SemanticMap",
    "WorldModel",
    "containers_before",
    "handle_shape",
    "is_open",
    "is_shut",
    "leaf_called",
    "leaf_shapes",
    "open_leaves",
    "openness_of",
]
