from __future__ import annotations

import sys
import types
from typing import Any
from unittest import mock

import numpy as np
import pytest

from bestman_bt.messages import Box, PlacedShape, PointCloud, Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.anygrasp import AnyGraspAdapter, camera_looking_at
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from tests.robot_models import gripper_model

GRIPPER = gripper_model(finger_depth=0.039, pad_size=(0.02, 0.02))
SUPPORT, EYE = 0.7, np.array([0.0, 0.1, 1.4])
MIDDLE = np.array([0.5, 0.0, SUPPORT + 0.05])
POINTS = sample_shape(Box((0.04, 0.06, 0.10)), 0.004)[0] + MIDDLE
CAMERA = camera_looking_at(EYE, POINTS.mean(axis=0))


def at(x: float, y: float, z: float) -> np.ndarray:
    """A point that far from the middle of the box."""
    return MIDDLE + np.array([x, y, z])


def target(**more: Any) -> GraspTarget:
    box = PlacedShape(Box((0.04, 0.06, 0.10)), Pose(MIDDLE))
    values = {"cloud": PointCloud(POINTS), "viewpoints": EYE[None], **more}
    return GraspTarget(box, **values)


def row(
    tips: np.ndarray, approach: tuple[float, ...], closing: tuple[float, ...], score: float = 0.5, width: float = 0.06
) -> np.ndarray:
    """A grasp as graspnetAPI writes it, in the camera frame, its finger tips at ``tips`` in the z-up frame."""
    depth = 0.02
    x, y = np.array(approach), np.array(closing)
    rotation = CAMERA.rotation.T @ np.stack([x, y, np.cross(x, y)], axis=1)
    translation = CAMERA.inverse().apply((tips - depth * x)[None])[0]
    return np.concatenate([[score, width, 0.02, depth], rotation.ravel(), translation, [-1]])


FROM_TOP = row(at(0, 0, 0.03), (0, 0, -1), (1, 0, 0))


class Network:
    """Answers in the published format; keeps what it was asked."""

    def __init__(self, *rows: np.ndarray) -> None:
        self.rows = np.array(rows, dtype=np.float32).reshape(-1, 17)
        self.asked: tuple[np.ndarray, np.ndarray, list[float]] | None = None

    def get_grasp(self, points: np.ndarray, colors: np.ndarray, lims: list[float]) -> tuple[Any, None]:
        self.asked = (points, colors, lims)
        return types.SimpleNamespace(grasp_group_array=self.rows), None


def plan(network: Any, of: GraspTarget | None = None) -> tuple[GraspCandidate, ...]:
    module = types.ModuleType("a_grasp_network")
    module.load = lambda: network
    with mock.patch.dict(sys.modules, a_grasp_network=module):
        return AnyGraspAdapter(network="a_grasp_network:load").plan(of or target(), GRIPPER, SUPPORT)


def test_the_finger_tips_come_where_the_network_puts_its_own() -> None:
    (candidate,) = plan(Network(FROM_TOP))
    grasp = candidate.grasp
    np.testing.assert_allclose(grasp.rotation[:, 2], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(grasp.rotation[:, 1], [1, 0, 0], atol=1e-6)
    assert np.linalg.det(grasp.rotation) == pytest.approx(1.0)
    half_pad = GRIPPER.part.pad_size[1] / 2
    np.testing.assert_allclose(grasp.apply(np.array([[0, 0, half_pad]]))[0], at(0, 0, 0.03), atol=1e-6)
    assert candidate.opening == pytest.approx(0.07)
    assert candidate.quality == pytest.approx(0.5)
    assert candidate.approach == "top"


def test_the_network_sees_the_cloud_in_the_camera_frame_as_floats() -> None:
    network = Network(FROM_TOP)
    colors = np.tile(np.array([[255, 0, 51]], dtype=np.uint8), (len(POINTS), 1))
    others = np.array([[0.5, 0.3, 0.75]])
    plan(network, target(cloud=PointCloud(POINTS, colors), surroundings=others))
    points, shades, limits = network.asked
    assert points.dtype == shades.dtype == np.float32
    assert points.shape == shades.shape == (len(POINTS) + 1, 3)
    np.testing.assert_allclose(CAMERA.apply(points[:-1].astype(float)), POINTS, atol=1e-5)
    np.testing.assert_allclose(shades[0], [1.0, 0.0, 0.2], atol=1e-6)
    assert np.all(points[:, 2] > 0), "before the camera"
    xmin, xmax, ymin, ymax, zmin, zmax = limits
    inside = points[:-1]
    assert np.all((inside > [xmin, ymin, zmin]) & (inside < [xmax, ymax, zmax]))
    assert not np.all((points[-1] > [xmin, ymin, zmin]) & (points[-1] < [xmax, ymax, zmax]))


def test_scores_order_the_grasps() -> None:
    other = row(at(0, 0, 0.03), (0, 0, -1), (0, 1, 0), score=0.8, width=0.075)
    assert [candidate.quality for candidate in plan(Network(FROM_TOP, other))] == pytest.approx([0.8, 0.5])


def test_grasps_elsewhere_too_wide_from_below_or_in_collision_are_left_out() -> None:
    elsewhere = row(at(0.2, 0, 0.03), (0, 0, -1), (1, 0, 0))
    too_wide = row(at(0, 0, 0.03), (0, 0, -1), (1, 0, 0), width=0.10)
    from_below = row(MIDDLE, (0, 0, 1), (1, 0, 0))
    through_it = row(at(0, 0, -0.03), (0, 0, -1), (1, 0, 0))
    into_the_table = row(at(0, 0, -0.06), (1, 0, 0), (0, 1, 0))
    assert plan(Network(elsewhere, too_wide, from_below, through_it, into_the_table)) == ()
    beside = target(surroundings=MIDDLE + np.array([[0.045, 0.0, 0.04]]))
    assert plan(Network(FROM_TOP), beside) == ()


def test_an_array_alone_an_empty_group_and_nothing_are_answers_too() -> None:
    assert len(plan(lambda points, colors, lims: np.array([FROM_TOP]))) == 1
    assert plan(lambda points, colors, lims: None) == ()
    assert plan(Network()) == ()
    assert plan(Network(np.full(17, np.nan))) == ()


def test_another_format_is_refused() -> None:
    with pytest.raises(PerceptionError, match=r"\(N, 17\) array but are \(2, 7\)"):
        plan(lambda points, colors, lims: np.zeros((2, 7)))


def test_the_network_is_loaded_by_the_name_of_its_factory(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("a_grasp_network")
    module.load = lambda: Network(FROM_TOP)
    monkeypatch.setitem(sys.modules, "a_grasp_network", module)
    adapter = AnyGraspAdapter(network="a_grasp_network:load")
    assert len(adapter.plan(target(), GRIPPER, SUPPORT)) == 1


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "should be 'module:factory'"),
        ("gsnet_is_not_here:load", "no module 'gsnet_is_not_here'; AnyGrasp's gsnet comes from its authors"),
        ("math:load", "has no attribute 'load'"),
    ],
)
def test_a_network_that_is_missing_is_reported_to_be(name: str, message: str) -> None:
    with pytest.raises(PerceptionError, match=message):
        AnyGraspAdapter(network=name).plan(target(), GRIPPER, SUPPORT)


def test_a_target_without_a_viewpoint_is_refused() -> None:
    with pytest.raises(PerceptionError, match="the viewpoint that it was seen from"):
        plan(Network(FROM_TOP), target(viewpoints=None))
