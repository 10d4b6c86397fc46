from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.film.rendering import ReplayScene, opening
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.visualization.blender.painting import BlenderRobot
from hal.simulation.bodies import Viewpoint

DOOR = "fridge/upper_door"


def _looking_at(point: np.ndarray) -> Viewpoint:
    x, y, z = map(float, point)
    return Viewpoint((x - 0.5, y, z + 0.6), (x, y, z))


@pytest.mark.slow
def test_the_robot_stands_where_it_stood_with_its_arm_as_it_was(run: FilmedRun, stage: ReplayScene) -> None:
    start = run.motion.at(0.0)
    joints = dict(start.joint_positions) | {"panda_joint1": 0.4, "panda_joint4": -1.1}
    base = Pose.from_xyz_rpy((1.0, 0.5, 0.0), (0.0, 0.0, 2.0))
    stage.set(dataclasses.replace(start, map_from_base=base, joint_positions=joints))

    links = BlenderRobot(run.robot_model.urdf, run.robot_model.base_frame).link_poses(base, joints)

    hand = next(iter(run.robot_model.of(GripperModel).values())).hand_link
    assert stage.hand() == pytest.approx(links[hand].position, abs=1e-4)


def test_an_object_is_seen_where_it_was_and_not_where_it_was_before(run: FilmedRun, stage: ReplayScene) -> None:
    start = run.motion.at(0.0)
    place = np.array([0.3, 0.2, 1.6])
    stage.set(dataclasses.replace(start, body_poses={**start.body_poses, "cup": Pose(place)}))
    assert stage.seen(_looking_at(place), ["cup"])[1] > 0.005

    stage.set(start)
    assert stage.seen(_looking_at(place), ["cup"])[1] == 0.0


def test_a_door_is_as_far_open_as_it_was(run: FilmedRun, stage: ReplayScene) -> None:
    start = run.motion.at(0.0)
    piece = next(piece for piece in run.world.furniture if piece.name == "fridge")
    door = next(door for door in piece.model.articulations if door.name == "upper_door")
    inside = piece.surface_pose(next(s for s in piece.model.surfaces if door.moved(1.0) is not None)).position
    before = stage.seen(_looking_at(inside), [DOOR])[1]
    swung = piece.pose @ door.moved(1.2) @ Pose(np.array(door.origin))
    stage.set(dataclasses.replace(start, body_poses={**start.body_poses, DOOR: swung}))

    assert opening(piece, door, swung) == pytest.approx(1.2, abs=1e-6)
    assert stage.seen(_looking_at(inside), [DOOR])[1] != before


@pytest.mark.parametrize("position", [0.0, 0.3, 1.5, 2.6])
def test_how_far_a_door_is_open_is_reported_by_where_its_joint_frame_is(run: FilmedRun, position: float) -> None:
    for piece in run.world.furniture:
        for door in piece.model.articulations:
            there = piece.pose @ door.moved(position) @ Pose(np.array(door.origin))
            assert opening(piece, door, there) == pytest.approx(position, abs=1e-6)


def test_a_robot_that_has_changed_since_the_run_is_refused(run: FilmedRun, stage: ReplayScene) -> None:
    start = run.motion.at(0.0)

    with pytest.raises(FilmError, match="it has no joint third_elbow"):
        stage.set(dataclasses.replace(start, joint_positions={"third_elbow": math.pi}))
