"""Segmentation of views into support surfaces and the things on them."""

from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, Side, SupportPlane
from bestman_bt.perception.segmentation.open3d_dbscan import Open3DDbscan, Open3DDbscanParameters
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan, PlaneDbscanParameters
from bestman_bt.perception.segmentation.region_growing import RegionGrowing, RegionGrowingParameters
from bestman_bt.perception.segmentation.support_surfaces import (
    SupportSurfaces,
    SupportSurfacesParameters,
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
    "Open3DDbscanParameters",
    "PlaneDbscan",
    "PlaneDbscanParameters",
    "Region",
    "RegionGrowing",
    "RegionGrowingParameters",
    "Segmentation",
    "SegmentedScene",
    "Side",
    "SupportPlane",
    "SupportSurfaces",
    "SupportSurfacesParameters",
    "SurfaceCoverage",
    "surface_coverage",
    "surface_regions",
]
