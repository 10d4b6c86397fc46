"""The footprint of a base holds all its shapes, meshes among them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from bestman_bt.messages import Pose
from bestman_bt.robot_model.footprint import convex_hull, footprint


def test_a_chassis_that_is_a_mesh_counts(tmp_path: Path) -> None:
    file = tmp_path / "chassis.stl"
    trimesh.creation.box((0.6, 0.4, 0.2)).export(file)
    geometry = f'<geometry><mesh filename="{file}"/></geometry>'
    link = ET.fromstring(f'<link name="chassis"><collision><origin xyz="0.1 0 0"/>{geometry}</collision></link>')
    corners = np.array(footprint([link], {"chassis": Pose()}))
    np.testing.assert_allclose(np.sort(corners, axis=0)[[0, -1]], [[-0.2, -0.2], [0.4, 0.2]], atol=1e-3)


@settings(deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=30))
def test_the_hull_holds_all_points_goes_round_to_the_left_and_has_no_corner_on_an_edge(
    points: list[tuple[int, int]],
) -> None:
    cloud = np.array(points, float)
    hull = convex_hull(cloud)
    assert {tuple(corner) for corner in hull} <= {tuple(point) for point in cloud}
    if len(hull) < 3:
        assert np.linalg.matrix_rank(cloud - cloud[0]) <= 1
        return
    ahead, after = np.roll(hull, -1, axis=0), np.roll(hull, -2, axis=0)
    turns = np.cross(np.c_[ahead - hull, np.zeros(len(hull))], np.c_[after - ahead, np.zeros(len(hull))])[:, 2]
    assert np.all(turns > 0.0)
    for corner, following in zip(hull, ahead, strict=True):
        edge, there = following - corner, cloud - corner
        assert np.all(edge[0] * there[:, 1] - edge[1] * there[:, 0] >= 0.0)


def test_all_shapes_of_all_links_count_where_they_are() -> None:
    box = (
        '<collision><origin xyz="0 0.3 9" rpy="0 0 1.5707963"/><geometry><box size="0.4 0.2 1"/></geometry></collision>'
    )
    links = [ET.fromstring(f'<link name="{name}">{box}<visual/></link>') for name in ("a", "b")]
    poses = {"a": Pose(), "b": Pose.from_xyz_rpy((1.0, 0.0, -3.0), (0.0, 0.0, np.pi))}
    corners = footprint(links, poses)
    expected = [(-0.1, 0.1), (-0.1, 0.5), (0.1, 0.5), (0.9, -0.5), (1.1, -0.5), (1.1, -0.1)]
    np.testing.assert_allclose(sorted(corners), expected, atol=2e-4)
