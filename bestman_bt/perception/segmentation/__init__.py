"""Segmentation of views into support surfaces and the things on them."""

from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, SupportPlane
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan, PlaneDbscanParameters
from bestman_bt.perception.segmentation.region_growing import RegionGrowing, RegionGrowingParameters
from bestman_bt.perception.segmentation.surface_coverage import (
    ABSENT,
    FREE,
    OCCUPIED,
    UNSEEN,
    SurfaceCoverage,
    surface_coverage,
)

__all__ = [
    "ABSENT",
    "FREE",
    "OCCUPIED",
    "UNSEEN",
    "Cluster",
    "PlaneDbscan",
    "PlaneDbscanParameters",
    "Region",
    "RegionGrowing",
    "RegionGrowingParameters",
    "Segmentation",
    "SegmentedScene",
    "SupportPlane",
    "SurfaceCoverage",
    "surface_coverage",
]
