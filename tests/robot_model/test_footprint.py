"""The footprint of a base holds all its shapes, meshes among them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import trimesh

from bestman_bt.messages import Pose
from bestman_bt.robot_model.footprint import footprint


def test_a_chassis_that_is_a_mesh_counts(tmp_path: Path) -> None:
    file = tmp_path / "chassis.stl"
    trimesh.creation.box((0.6, 0.4, 0.2)).export(file)
    geometry = f'<geometry><mesh filename="{file}"/></geometry>'
    link = ET.fromstring(f'<link name="chassis"><collision><origin xyz="0.1 0 0"/>{geometry}</collision></link>')
    corners = np.array(footprint([link], {"chassis": Pose()}))
    np.testing.assert_allclose(np.sort(corners, axis=0)[[0, -1]], [[-0.2, -0.2], [0.4, 0.2]], atol=1e-3)
