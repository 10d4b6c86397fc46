"""How far a map reaches."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap

TABLE = MapFurniture("table", Pose2D(3.2, -0.4, 0.0), (0.8, 1.2), 0.75, (), solid_at_lidar=False)
ROOM = np.array([[-2.0, -1.0, 2.0, -1.0], [2.0, -1.0, 2.0, 3.0], [2.0, 3.0, -2.0, 3.0], [-2.0, 3.0, -2.0, -1.0]])


@pytest.mark.parametrize(
    ("walls", "furniture", "bounds"),
    [
        (ROOM, {}, (-2, -1, 2, 3)),
        (ROOM, {"table": TABLE}, (-2, -1, 4, 3)),
        (np.zeros((0, 4)), {"table": TABLE}, (-3, -4, 7, 4)),
        (np.zeros((0, 4)), {}, (-3, -3, 3, 3)),
        (ROOM[:1], {}, (-5, -4, 5, 3)),
    ],
)
def test_a_map_reaches_around_walls_and_furniture_and_where_no_walls_end_it_some_metres_farther(
    walls: np.ndarray, furniture: dict[str, MapFurniture], bounds: tuple[int, ...]
) -> None:
    assert SemanticMap(walls, furniture).bounds() == bounds


def test_a_margin_is_added() -> None:
    assert SemanticMap(ROOM, {}).bounds(margin=0.2) == (-3, -2, 3, 4)
