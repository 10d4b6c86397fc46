"""What a recording of a simulated run is told of its cameras."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rerun.chunk import RrdReader

from behaviours.manipulation.grasp import PlannedGrasp
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import ManualClock, load_tree
from bestman_bt.evaluation.recording import RecordedBeliefs, Recording, goal_points
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.robot_session import open_session
from hal.simulation.scene_recorder import SceneRecorder

NOTHING_TO_DO = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'


def test_goals_that_are_places_are_marked_and_others_are_not() -> None:
    entries = {
        "goal": Pose(np.array([1.0, 2.0, 0.8])),
        "where": Pose2D(3.0, 4.0, 0.5),
        "facts": ("on cup table",),
        "object": "cup",
        "goals": [{"goal": Pose()}],
    }
    points = goal_points(entries)
    assert points.keys() == {"goal", "where"}
    np.testing.assert_array_equal(points["goal"], [1.0, 2.0, 0.8])
    np.testing.assert_array_equal(points["where"], [3.0, 4.0, 0.0])


@pytest.mark.slow
def test_a_task_whose_goal_is_no_place_is_recorded_with_what_the_robot_knows(tmp_path: Path) -> None:
    shown = entities_of("plan_fetch_cup", tmp_path / "run.rrd")
    assert {"/world/markers/belief", "/world/map", "/blackboard"} <= shown
    assert not any(entity.endswith("/label") for entity in shown)


def test_people_are_recorded_where_they_walk(tmp_path: Path) -> None:
    shown = entities_of("navigate_kitchen_walkers", tmp_path / "run.rrd")
    assert "/world/scene/walker_1/0" in shown


def entities_of(task: str, path: Path) -> set[str]:
    """What a recording of a moment of ``task`` holds."""
    scenes: list[SceneRecorder] = []
    with open_session(load_run(task, seed=1), lambda robot: scenes.append(SceneRecorder(robot))) as session:
        recording = Recording(path, session, session.load(NOTHING_TO_DO), scenes[0])
        recording.open()
        session.robot.clock.sleep(0.1)
        recording.after_tick()
        recording.close()
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


@pytest.mark.slow
def test_the_pictures_of_each_camera_are_recorded_when_a_skill_takes_one(tmp_path: Path) -> None:
    scenes: list[SceneRecorder] = []
    path = tmp_path / "run.rrd"
    with open_session(load_run("fetch_cup", seed=1), lambda robot: scenes.append(SceneRecorder(robot))) as session:
        tree = session.load(NOTHING_TO_DO)
        recording = Recording(path, session, tree, scenes[0])
        recording.open()
        assert session.skills.wrist_camera is not None
        times = {}
        for sensor in (session.skills.camera, session.skills.wrist_camera, session.skills.wrist_camera):
            session.robot.clock.sleep(0.1)
            times.setdefault(sensor.name, []).append(sensor.capture().stamp)
        recording.close()
    shown: dict[str, list[float]] = {}
    entities: set[str] = set()
    for chunk in RrdReader(path).stream():
        entities.add(chunk.entity_path)
        if chunk.entity_path.endswith("/rgb") and not chunk.is_static:
            stamps = chunk.to_record_batch().column("sim_time").cast("int64").to_pylist()
            shown.setdefault(chunk.entity_path, []).extend(stamp * 1e-9 for stamp in stamps)
    assert shown.keys() == {"/world/camera/head_camera/rgb", "/world/camera/wrist_camera/rgb"}
    assert {f"/world/sensed/{camera}_cloud" for camera in times} <= entities
    for camera, stamps in times.items():
        assert sorted(shown[f"/world/camera/{camera}/rgb"]) == pytest.approx(stamps)


def test_a_planned_grasp_is_marked_where_the_tool_will_be() -> None:
    told: list[Any] = []
    skills = SimpleNamespace(
        has=lambda kind: True,
        base=SimpleNamespace(path=None, last_scan=None),
        world=SimpleNamespace(objects={}),
        gripper_model=SimpleNamespace(part=SimpleNamespace(finger_depth=0.04)),
    )
    session: Any = SimpleNamespace(
        setup=SimpleNamespace(robot_model=load_robot_model("diff_panda")),
        skills=skills,
        robot=SimpleNamespace(clock=ManualClock(2.0)),
    )
    recorder: Any = SimpleNamespace(blackboard=lambda *_: None, grasps=lambda marks, stamp: told.append((marks, stamp)))
    tree = load_tree(NOTHING_TO_DO)
    map_from_tool = Pose.from_xyz_rpy((1.0, 2.0, 0.9), (0.0, 0.0, 0.5))
    map_from_object = Pose.from_xyz_rpy((1.1, 2.0, 0.8), (0.0, 0.0, -1.0))
    candidate: Any = SimpleNamespace(width=0.05, quality=0.7)
    grasp = PlannedGrasp(candidate, cast(Any, None), map_from_object, map_from_tool.inverse() @ map_from_object)
    tree.blackboard.set("grasps", [grasp])
    RecordedBeliefs(recorder, session, tree).after_tick()
    ((mark,), stamp), *others = told
    assert (others, stamp, mark.width, mark.finger_depth, mark.quality) == ([], 2.0, 0.05, 0.04, 0.7)
    np.testing.assert_allclose(mark.pose.matrix, map_from_tool.matrix, atol=1e-9)
