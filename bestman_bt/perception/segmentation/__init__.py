"""Segmentation of views into support surfaces and the things on them."""

from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, Side, SupportPlane
from bestman_bt.perception.segmentation.plane_dbscan import Open3DDbscan, PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.segmentation.support_surfaces import (
    SupportSurfaces,
    surface_regions,
)
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
    "Open3DDbscan",
    "PlaneDbscan",
    "Region",
    "RegionGrowing",
    "Segmentation",
    "SegmentedScene",
    "Side",
    "SupportPlane",
    "SupportSurfaces",
    "SurfaceCoverage",
    "surface_coverage",
    "surface_regions",
]
