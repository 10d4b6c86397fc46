"""Localization: the base's pose on the map."""

from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch
from bestman_bt.navigation.localization.ray_casting import cast_rays
from bestman_bt.navigation.localization.scan_to_map import ScanToMap, ScanToMapParameters

__all__ = ["LocalizationEstimate", "Localizer", "ScanMatch", "ScanToMap", "ScanToMapParameters", "cast_rays"]
