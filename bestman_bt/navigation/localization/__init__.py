"""Localization: the base's pose on the map."""

from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, ScanMatch

__all__ = ["LocalizationEstimate", "Localizer", "ScanMatch"]
