"""Occupancy: which space is free, occupied or not yet seen."""

from bestman_bt.perception.occupancy.base import OccupancyMapper, VoxelRegion
from bestman_bt.perception.occupancy.freeing import freed
from bestman_bt.perception.occupancy.hidden import hidden_share
from bestman_bt.perception.occupancy.log_odds import LogOdds

__all__ = ["LogOdds", "OccupancyMapper", "VoxelRegion", "freed", "hidden_share"]
