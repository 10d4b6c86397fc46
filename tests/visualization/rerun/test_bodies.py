from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere
from bestman_bt.visualization.rerun.bodies import bounds
from bestman_bt.visualization.snapshot import RecordedBody

GREY = (0.5, 0.5, 0.5, 1.0)
TETRAHEDRON = Mesh(
    np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def body(shape, x=0.0, color=GREY):
    return RecordedBody("body", (PlacedShape(shape, Pose()),), (color,), Pose.from_xyz_rpy((x, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("shape", "lower", "upper"),
    [
        (Box((1.0, 2.0, 4.0)), (-0.5, -1.0, -2.0), (0.5, 1.0, 2.0)),
        (Cylinder(0.5, 2.0), (-0.5, -0.5, -1.0), (0.5, 0.5, 1.0)),
        (Sphere(0.3), (-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)),
        (TETRAHEDRON, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    ],
)
def test_bounds_enclose_every_kind_of_shape(shape, lower, upper):
    assert bounds([body(shape)]) == pytest.approx(np.array([lower, upper]))
    assert bounds([body(shape), body(shape, x=3.0)])[1][0] == pytest.approx(3.0 + upper[0])


def test_meshes_keep_flat_faces_with_normals_that_point_outwards(record, recorded):
    with record(bodies=[body(TETRAHEDRON)]):
        pass
    run = recorded()
    (positions,) = run.column("/world/scene/body/0", "Mesh3D:vertex_positions", static=True)
    (normals,) = run.column("/world/scene/body/0", "Mesh3D:vertex_normals", static=True)
    assert len(positions) == len(normals) == 12
    centre = np.full(3, 0.25)
    assert all(np.dot(normal, np.array(point) - centre) > 0 for point, normal in zip(positions, normals, strict=True))


def test_see_through_colours_are_drawn_as_a_frame_with_a_hint_of_surface(record, recorded):
    with record(bodies=[body(Box((1.0, 1.0, 1.0)), color=(1.0, 1.0, 1.0, 0.2))]):
        pass
    transparent, solid = 4, 3
    modes = recorded().column("/world/scene/body/0", "Boxes3D:fill_mode", static=True)
    assert modes == [[transparent]]
    assert modes != [[solid]]


def test_a_body_needs_a_colour_for_each_shape():
    with pytest.raises(ValueError, match="1 shapes, 0 colors"):
        RecordedBody("cup", (PlacedShape(Sphere(0.1), Pose()),), (), Pose())


def test_the_floor_lies_under_everything(record, recorded):
    with record(bodies=[body(Box((4.0, 2.0, 1.0)), x=1.0)]):
        pass
    run = recorded()
    ((half,),) = run.column("/world/floor", "Boxes3D:half_sizes", static=True)
    ((centre,),) = run.column("/world/floor", "Boxes3D:centers", static=True)
    assert half == pytest.approx([2.2, 1.2, 0.01])
    assert centre[:2] == pytest.approx([1.0, 0.0])
    assert -0.01 < centre[2] + half[2] < 0.0
