"""Localization: the base's pose on the map."""

from bestman_bt.navigation.localization.base import (
    GlobalLocalizer,
    LocalizationEstimate,
    Localizer,
    OdometryScan,
    Place,
    ScanMatch,
)
from bestman_bt.navigation.localization.correlative_search import CorrelativeSearch
from bestman_bt.navigation.localization.distance_field import DistanceField
from bestman_bt.navigation.localization.ekf import OdometryEkf, OdometryFilter, WheelOdometry
from bestman_bt.navigation.localization.front_edge import FrontEdge, front_edge
from bestman_bt.navigation.localization.map_lines import MapLines, PlanarMap, map_lines
from bestman_bt.navigation.localization.ray_casting import cast_rays
from bestman_bt.navigation.localization.scan_to_map import ScanToMap

__all__ = [
    "CorrelativeSearch",
    "DistanceField",
    "FrontEdge",
    "GlobalLocalizer",
    "LocalizationEstimate",
    "Localizer",
    "MapLines",
    "OdometryEkf",
    "OdometryFilter",
    "OdometryScan",
    "Place",
    "PlanarMap",
    "ScanMatch",
    "ScanToMap",
    "WheelOdometry",
    "cast_rays",
    "front_edge",
    "map_lines",
]
