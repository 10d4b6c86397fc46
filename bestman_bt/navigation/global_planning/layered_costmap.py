"""The costmap of a robot's beliefs: which layers it has is a matter of the configuration, as in nav2."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.messages import OccupancyGrid
from bestman_bt.navigation.global_planning.costmap import Costmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.world_model.openness import open_leaves
from bestman_bt.world_model.world_model import WorldModel


@dataclass(frozen=True)
class LayeredCostmap(Rasterization):
    """Creates costmaps of the map with the believed door positions, or of an occupancy grid.

    ``obstacle``: whether planning costmaps include obstacles that the lidar sees and the map lacks. ``unknown``:
    whether unseen cells are obstacles.
    """

    obstacle: bool = True
    unknown: bool = True

    def of_world(self, world: WorldModel, footprint: Footprint) -> Costmap:
        """Return the costmap of walls, furniture, room doors, and open doors and drawers."""
        leaves = open_leaves(world) if self.doors else ()
        return Costmap.from_map(world.map, footprint, leaves, self)

    def of_grid(self, grid: OccupancyGrid, footprint: Footprint) -> Costmap:
        """Return the costmap of the occupied cells of ``grid`` and, if ``unknown`` is set, of its unknown cells."""
        return Costmap.from_grid(grid, footprint, self.unknown, self)
