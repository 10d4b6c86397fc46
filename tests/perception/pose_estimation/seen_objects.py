"""Single objects on a table, rendered, segmented: what the tests of this folder look at."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks.rendered_table import TrueObject, mast_camera, render_table
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.segmentation.base import Cluster, Region
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.view import View
from bestman_bt.scene.object_file import read_object

TABLE, SIZE = Pose.from_xyz_rpy((0.7, 0.0, 0.75)), (0.8, 1.2)
MAST = mast_camera(0.8, 0.0)


@cache
def shipped(name: str) -> ObjectModel:
    return read_object(name)


def standing(model: ObjectModel, x: float, y: float, yaw: float) -> TrueObject:
    """On the table, x and y from its centre."""
    height = -float(model.bounds()[0, 2])
    return TrueObject(model, TABLE @ Pose.from_xyz_rpy((x, y, height), (0.0, 0.0, yaw)), True)


def photographed(items: Sequence[TrueObject], frame_from_camera: Pose = MAST, seed: int = 0) -> View:
    return render_table(items, TABLE, SIZE, np.random.default_rng(seed), False, None, frame_from_camera).view


def cluster_of(view: View, item: TrueObject) -> Cluster:
    clusters = PlaneDbscan().segment(view, Region(TABLE, (0.9, 1.3)), np.random.default_rng(0)).clusters
    return min(clusters, key=lambda c: float(np.linalg.norm(c.bounding_box.pose.position - item.pose.position)))
