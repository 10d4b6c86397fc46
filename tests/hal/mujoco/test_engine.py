"""MuJoCo as an engine: what somebody writes past the API counts, what it cannot do is refused, nonsense ends a run."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, Cylinder, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.scene import PlacedFurniture, PlacedObject
from hal.api import MobileBase
from hal.conformance.command_line import empty_room
from hal.simulation.bodies import SimulationError, Viewpoint

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

from hal.mujoco.package import mujoco
from hal.mujoco.parameters import MujocoParameters
from hal.mujoco.robot import WRITTEN, MujocoEngine, MujocoRobot, UnstableError

CAN = ObjectModel("can", (1.0, 0.0, 0.0), 0.3, 0.6, (PlacedShape(Cylinder(0.03, 0.12), Pose()),))
WORLD = dataclasses.replace(empty_room(), objects=(PlacedObject("can", CAN, Pose(np.array([1.0, 0.0, 0.06]))),))


@pytest.fixture
def robot() -> Iterator[MujocoRobot]:
    with MujocoRobot(load_robot_model("turtle"), WORLD) as made:
        yield made


def engine_of(robot: MujocoRobot) -> MujocoEngine:
    engine = robot.simulation.reader.__self__._engine
    assert isinstance(engine, MujocoEngine)
    return engine


@pytest.mark.parametrize(("name", "kind"), WRITTEN.items())
def test_what_a_program_writes_into_the_data_is_counted(robot, name: str, kind: str) -> None:
    getattr(engine_of(robot).data, name)[-1] += 0.01
    robot.clock.sleep(0.1)
    assert robot.audit_record().calls[name] == 1
    assert getattr(robot.audit_record(), kind) == 1


def test_the_velocity_of_the_robot_is_that_of_its_centre_of_mass_whatever_it_turns_about(robot) -> None:
    engine = engine_of(robot)
    body, data = engine.built.robot, engine.data
    start = engine._free[body]
    off = data.xipos[body] - data.xpos[body]
    assert np.linalg.norm(off) > 0.01
    moving, turning = np.array([0.3, -0.2, 0.1]), np.array([0.4, -0.5, 1.2])
    data.qvel[start : start + 3] = moving
    data.qvel[start + 3 : start + 6] = data.xmat[body].reshape(3, 3).T @ turning
    velocity, rate = engine.body_velocity(body)
    assert rate == pytest.approx(turning)
    assert velocity == pytest.approx(moving + np.cross(turning, off))


def test_a_finger_is_as_hard_to_accelerate_as_its_motor() -> None:
    speeds = []
    for parameters in (MujocoParameters(), MujocoParameters(finger_armature=0.0)):
        engine = MujocoEngine(load_robot_model("diff_panda"), WORLD, parameters)
        finger = engine.built.joints["panda_finger_joint1"]
        engine.turn(engine.built.robot, [finger], [0.0], [0.0])
        engine.exert([finger], np.array([-1.0]))
        engine.step()
        speeds.append(engine.joint_states(engine.built.robot, [finger])[1][0])
    assert speeds[1] / speeds[0] == pytest.approx(1.0 + MujocoParameters().finger_armature, rel=0.2)


def test_an_honest_run_is_clean(robot) -> None:
    robot.part("base", MobileBase).set_velocity(0.3, 0.0, 0.0)
    robot.clock.sleep(0.3)
    record = robot.audit_record()
    assert not record.calls
    found = (*record.jumps, *record.changes, *record.unexplained_forces, *record.hidden_constraints)
    assert not found


def test_a_body_that_is_put_elsewhere_past_the_api_jumps(robot) -> None:
    data = engine_of(robot).data
    data.qpos[-7] += 0.05  # of the can: the robot comes after the objects
    data.qpos[0] += 0.05
    robot.clock.sleep(0.1)
    assert any("jumped" in finding.text for finding in robot.audit_record().jumps)


def test_a_changed_mass_or_a_loosened_coupling_is_a_finding(robot) -> None:
    engine = engine_of(robot)
    engine.model.body_mass[engine.built.objects["can"]] *= 2.0
    assert [finding.text.partition(" changed")[0] for finding in robot.audit_record().changes] == ["mass of can"]


@pytest.mark.parametrize("value", [math.nan, 1e12])
def test_a_simulation_that_explodes_ends_with_its_code(robot, value: float) -> None:
    engine_of(robot).data.qvel[0] = value
    with pytest.raises(UnstableError, match="simulation_unstable") as caught:
        robot.clock.sleep(0.1)
    assert caught.value.code == "simulation_unstable"


def test_a_part_that_it_cannot_simulate_is_named() -> None:
    with pytest.raises(SimulationError, match=r"a1: parts\.base is a base on legs, which MuJoCo does not simulate"):
        MujocoRobot(load_robot_model("a1"), empty_room()).connect()


def test_there_is_no_window() -> None:
    with pytest.raises(SimulationError, match="--gui"):
        MujocoRobot(load_robot_model("turtle"), empty_room(), gui=True).connect()


def test_without_a_renderer_the_message_reports_what_to_install(robot, monkeypatch) -> None:
    def none(width: int, height: int) -> None:
        raise RuntimeError("no EGL")

    monkeypatch.setattr("hal.mujoco.renderer._graphics", none)
    with pytest.raises(SimulationError, match=r"no EGL.*apt-get install -y libegl1"):
        engine_of(robot).depth_image(Pose(), CameraIntrinsics(8, 6, 8.0, 8.0, 3.5, 2.5), 0.1, 5.0)


def test_rays_pass_what_they_begin_in_and_report_what_they_hit(robot) -> None:
    engine = engine_of(robot)
    starts = np.array([[0.6, 0.0, 0.06], [1.0, 0.0, 0.06], [1.0, 0.0, 0.06]])
    bodies, shares = engine.cast_rays(starts, np.array([[2.6, 0.0, 0.06], [5.0, 0.0, 0.06], [1.0, 0.0, 5.0]]))
    assert bodies.tolist()[0] == engine.built.objects["can"]
    assert bodies.tolist()[1] in engine.built.walls.values()
    assert bodies.tolist()[2] == -1
    assert shares == pytest.approx([0.185, 0.4875, 1.0], abs=1e-3)


def test_contacts_weigh_what_rests(robot) -> None:
    engine = engine_of(robot)
    can = engine.built.objects["can"]
    points = engine.contacts(can)
    assert {point.second for point in points} == {engine.built.floor}
    assert sum(point.force()[2] for point in points) == pytest.approx(0.3 * 9.81, rel=0.02)
    assert engine.contacts(engine.built.floor, other=can)[0].force()[2] < 0.0
    assert engine.gaps(can, engine.built.floor, 0.1) == pytest.approx([0.0], abs=1e-3)


@pytest.mark.slow
def test_a_camera_sees_colours_and_distances_where_they_are(robot) -> None:
    engine, k = engine_of(robot), CameraIntrinsics(160, 120, 150.0, 150.0, 79.5, 59.5)
    ahead = Pose.from_matrix([[0, 0, 1, 0.45], [-1, 0, 0, 0], [0, -1, 0, 0.1], [0, 0, 0, 1]])
    rgb, depth = engine.depth_image(ahead, k, 0.05, 2.0)
    row, column = 71, 80
    assert depth[row, column] == pytest.approx(0.52, abs=0.002)
    assert rgb[row, column, 0] > 2 * rgb[row, column, 1]
    assert depth[30, 80] == 0.0  # the wall is further than what it sees
    unseen, hidden = engine.depth_image(ahead, k, 0.05, 2.0, without=engine.built.objects["can"])
    assert hidden[row, column] == 0.0
    assert (unseen == rgb).all()


@pytest.mark.slow
def test_equal_seeds_give_equal_runs() -> None:
    def course() -> bytes:
        with MujocoRobot(load_robot_model("turtle"), WORLD, seed=3, parameters=MujocoParameters()) as made:
            made.part("base", MobileBase).set_velocity(0.3, 0.0, 0.4)
            made.clock.sleep(0.5)
            return bytes(engine_of(made).data.qpos.tobytes())

    assert course() == course()


def test_an_object_is_drawn_before_white() -> None:
    front = Viewpoint((0.1, -0.5, 0.1), (0.0, 0.0, 0.0), 30.0)
    picture = MujocoRobot.render_object([(CAN.collision[0], CAN.color)], front, 60, 40).astype(int)
    assert picture.shape == (40, 60, 3)
    assert picture[20, 30, 0] > picture[20, 30, 1:].max() + 100
    assert (picture[[0, -1]] == 255).all()


def test_dry_friction_slows_a_door_fully_and_never_drives_it() -> None:
    at = Pose2D(2.0, 0.5, 0.6)
    fridge = PlacedFurniture("fridge", read_furniture("fridge"), at, at, open={"upper_door": 0.6})
    with MujocoRobot(load_robot_model("turtle"), dataclasses.replace(WORLD, furniture=(fridge,))) as robot:
        engine = engine_of(robot)
        body, joint = engine.built.articulations["fridge/upper_door"]
        (dof,) = engine.model.joint("fridge/upper_door").dofadr
        friction = fridge.model.articulations[0].friction
        inertia = np.zeros((engine.model.nv, engine.model.nv))
        mujoco.mj_fullM(engine.model, engine.data, inertia)
        for braked in (0.0, 0.6, 0.8, 0.9):  # share of its speed that something else takes in a step
            engine.data.qvel[dof] = -0.4
            engine.data.qfrc_applied[dof] = braked * 0.4 * inertia[dof, dof] / robot.simulation.parameters.time_step
            mujoco.mj_step(engine.model, engine.data)
            engine.data.qfrc_applied[:] = 0.0
            _, (speed,), (effort,) = engine.joint_states(body, [joint])
            assert -0.4 < speed < 0.0
            assert effort == pytest.approx(friction, rel=1e-3)
