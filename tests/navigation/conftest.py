from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose, Pose2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface, SemanticMap


def furniture(name, pose, footprint, height, solid):
    surface = MapSurface("top", Pose(np.array([0.0, 0.0, height])), footprint)
    return MapFurniture(name, pose, footprint, height, (surface,), solid)


@pytest.fixture(scope="session")
def kitchen() -> SemanticMap:
    """A room of 5.2 by 4.9 m, cut by a thin wall with a doorway of 0.95 m; a table on legs and a solid counter."""
    outer = [(-1, -2.4, 4.2, -2.4), (4.2, -2.4, 4.2, 2.5), (4.2, 2.5, -1, 2.5), (-1, 2.5, -1, -2.4)]
    wall = [(1.5, -2.4, 1.5, 0.0), (1.6, -2.4, 1.6, 0.0), (1.5, 0.0, 1.6, 0.0)]
    wall += [(1.5, 0.95, 1.5, 2.5), (1.6, 0.95, 1.6, 2.5), (1.5, 0.95, 1.6, 0.95)]
    table = furniture("table", Pose2D(3.4, -0.9, 0.0), (0.8, 1.2), 0.75, solid=False)
    counter = furniture("counter", Pose2D(2.9, 2.2, math.pi / 2), (0.6, 1.2), 0.9, solid=True)
    return SemanticMap(np.array(outer + wall, dtype=float), {"table": table, "counter": counter})


@pytest.fixture(scope="session")
def footprint() -> Footprint:
    return Footprint(np.array([[-0.28, -0.26], [0.28, -0.26], [0.28, 0.26], [-0.28, 0.26]]))


@pytest.fixture(scope="session")
def costmap(kitchen, footprint) -> Costmap:
    return Costmap.from_map(kitchen, footprint)
