"""What a recording of a simulated run is told of its cameras."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration import load_run
from bestman_bt.evaluation.recording import Recording
from bestman_bt.runtime import open_session
from hal.pybullet import SceneRecorder


def test_the_pictures_of_each_camera_are_recorded_when_a_skill_takes_one(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    scenes: list[SceneRecorder] = []
    path = tmp_path / "run.rrd"
    with open_session(load_run("fetch_cup", seed=1), lambda robot: scenes.append(SceneRecorder(robot))) as session:
        tree = session.load('<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>')
        recording = Recording(path, session, tree, scenes[0])
        recording.open()
        assert session.skills.wrist_camera is not None
        times = {}
        for sensor in (session.skills.camera, session.skills.wrist_camera, session.skills.wrist_camera):
            session.robot.clock.sleep(0.1)
            times.setdefault(sensor.name, []).append(sensor.capture().stamp)
        recording.close()
    shown: dict[str, list[float]] = {}
    for chunk in RrdReader(path).stream():
        if chunk.entity_path.endswith("/rgb") and not chunk.is_static:
            stamps = chunk.to_record_batch().column("sim_time").cast("int64").to_pylist()
            shown.setdefault(chunk.entity_path, []).extend(stamp * 1e-9 for stamp in stamps)
    assert shown.keys() == {"/world/camera/head_camera/rgb", "/world/camera/wrist_camera/rgb"}
    for camera, stamps in times.items():
        assert sorted(shown[f"/world/camera/{camera}/rgb"]) == pytest.approx(stamps)
