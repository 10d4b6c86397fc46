"""Segmentation of views into support surfaces and the things on them."""

from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, SupportPlane
from bestman_bt.perception.segmentation.surface_coverage import (
    ABSENT,
    FREE,
    OCCUPIED,
    UNSEEN,
    SurfaceCoverage,
)

__all__ = [
    "ABSENT",
    "FREE",
    "OCCUPIED",
    "UNSEEN",
    "Cluster",
    "Region",
    "Segmentation",
    "SegmentedScene",
    "SupportPlane",
    "SurfaceCoverage",
]
