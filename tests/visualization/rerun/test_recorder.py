from __future__ import annotations

import math
import time

import cv2
import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import LaserScan, Path2D, PointCloud, Pose, Pose2D, RGBDImage
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.rerun.open_recording import RecordingSetup
from bestman_bt.visualization.rerun.recorder import RerunRecorder
from bestman_bt.visualization.rerun.sensed import SensorRecording
from bestman_bt.visualization.snapshot import RobotSnapshot
from tests.visualization.conftest import changed


def snapshot(stamp: float, x: float = 0.0, **changes) -> RobotSnapshot:
    return RobotSnapshot(
        stamp,
        round(stamp * 20),
        Pose.from_xyz_rpy((x, 0.0, 0.0)),
        {"arm_shoulder": 0.1 * x, "arm_slide": 0.04},
        **changes,
    )


def test_snapshots_lie_on_simulated_time_and_on_ticks(record, recorded):
    with record() as recorder:
        for k in range(5):
            recorder.snapshot(snapshot(0.1 * k, x=0.2 * k))
    rows = recorded().rows("/joints")
    assert [row["sim_time"] for row in rows] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert [row["tick"] for row in rows] == [0, 2, 4, 6, 8]
    assert [row["Scalars:scalars"][0] for row in rows] == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08])


def test_only_frames_that_moved_are_written_again(record, recorded):
    with record() as recorder:
        for k in range(10):
            recorder.snapshot(snapshot(0.1 * k, body_poses={"cup": Pose.from_xyz_rpy((1.0, 0.0, 0.01 * k))}))
    moved = [row["Transform3D:child_frame"][0] for row in recorded().rows("/world/transforms")]
    assert moved.count("body/cup") == 11
    assert moved.count("robot/floor_point") == 1
    assert moved.count("body/table top") == 1


def test_bodies_keep_their_shape_colour_and_place(record, recorded):
    with record():
        pass
    run = recorded()
    assert run.column("/world/scene/table_top/0", "Boxes3D:half_sizes", static=True) == [
        [pytest.approx([0.6, 0.4, 0.02])]
    ]
    assert run.column("/world/scene/cup/0", "Cylinders3D:colors", static=True) == [[0xCC3333FF]]
    place = {row["Transform3D:child_frame"][0]: row for row in run.rows("/world/transforms")}["body/cup"]
    assert place["Transform3D:translation"] == [pytest.approx([1.4, 0.4, 0.77])]
    assert place["Transform3D:parent_frame"] == ["map"]


def test_the_tree_is_written_once_and_then_only_its_colours(record, recorded, fetch_tree):
    with record() as recorder:
        recorder.changes(changed(0.1, (1, RUNNING), (2, RUNNING), tick=1))
        recorder.changes(changed(0.2, (2, SUCCESS), tick=2))
        recorder.changes(changed(0.3, (2, SUCCESS), tick=3))
    run = recorded()
    assert run.column("/tree", "GraphNodes:labels", static=True) == [
        [
            *("→ fetch", "to the table", "? get it", "→ Sequence", "PlanGrasp", "Grasp"),
            *("→ look again", "LookAt", "second grasp", "put down"),
        ]
    ]
    edges = run.column("/tree", "GraphEdges:edges", static=True)[0]
    assert {(edge["first"], edge["second"]) for edge in edges} == {
        (str(node.parent), str(node.uid)) for node in fetch_tree.nodes if node.parent is not None
    }
    rows = run.rows("/tree")
    assert [row["tick"] for row in rows] == [0, 1, 2]
    differences = [
        sum(a != b for a, b in zip(rows[i]["GraphNodes:colors"], rows[i + 1]["GraphNodes:colors"], strict=True))
        for i in (0, 1)
    ]
    assert differences == [2, 1]


def test_messages_of_nodes_and_lines_of_text_reach_the_log_with_their_level(record, recorded):
    with record() as recorder:
        recorder.changes(changed(1.0, (6, RUNNING, "closing"), (5, SUCCESS)))
        recorder.changes(changed(2.0, (6, FAILURE, "SLIPPED: the cup slipped")))
        recorder.text("ERROR", "gave up", 3.0)
    rows = recorded().rows("/log")
    assert [(row["sim_time"], row["TextLog:level"][0], row["TextLog:text"][0]) for row in rows] == [
        (1.0, "INFO", "Grasp: closing"),
        (2.0, "WARN", "Grasp: SLIPPED: the cup slipped"),
        (3.0, "ERROR", "gave up"),
    ]


def test_images_come_back_as_they_were_within_the_losses_of_their_formats(record, recorded, intrinsics, picture):
    depth = np.linspace(0.5, 3.0, 48 * 64, dtype=np.float32).reshape(48, 64)
    depth[0, :5] = 0.0
    with record(sensors=SensorRecording(jpeg_quality=95, depth_step=0.002)) as recorder:
        recorder.image("head", RGBDImage(picture, depth, intrinsics, 1.5))
    run = recorded()
    (row,) = run.rows("/world/camera/head/rgb")
    assert row["sim_time"] == 1.5
    rgb = cv2.imdecode(np.array(row["EncodedImage:blob"][0], dtype=np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    assert np.abs(rgb.astype(int) - picture).mean() < 3.0
    (row,) = run.rows("/world/camera/head/depth")
    steps = cv2.imdecode(np.array(row["EncodedDepthImage:blob"][0], dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    assert steps / row["EncodedDepthImage:meter"][0] == pytest.approx(depth, abs=0.00101)
    assert np.all(steps[0, :5] == 0)


def test_the_camera_hangs_on_the_robots_optical_frame(record, recorded):
    with record():
        pass
    assert recorded().column("/world/camera/head", "Pinhole:parent_frame", static=True) == [["robot/eye"]]


def test_scans_clouds_and_paths_are_drawn_in_the_map(record, recorded):
    scan = LaserScan(np.array([1.0, np.inf, 2.0]), 0.0, math.pi / 2, 0.1, 10.0, 0.5)
    cloud = PointCloud(np.random.default_rng(0).random((1000, 3)))
    with record(sensors=SensorRecording(most_cloud_points=100)) as recorder:
        recorder.scan("lidar", scan, Pose.from_xyz_rpy((5.0, 0.0, 0.3), (0.0, 0.0, math.pi / 2)))
        recorder.cloud("seen", cloud, 0.5)
        recorder.path("planned", Path2D(np.array([[0.0, 0.0], [1.0, 2.0]]), Pose2D(1.0, 2.0)), 0.5)
    run = recorded()
    (points,) = run.column("/world/sensed/lidar", "Points3D:positions")
    assert points == [pytest.approx([5.0, 1.0, 0.3]), pytest.approx([5.0, -2.0, 0.3])]
    assert [len(points) for points in run.column("/world/sensed/seen", "Points3D:positions")] == [100]
    ((strip,),) = run.column("/world/paths/planned", "LineStrips3D:strips")
    assert strip == [pytest.approx([0.0, 0.0, 0.02]), pytest.approx([1.0, 2.0, 0.02])]


def test_the_driven_path_grows_with_the_base_and_not_with_time(record, recorded):
    with record() as recorder:
        for k in range(50):
            recorder.snapshot(snapshot(0.1 * k, x=min(1.0, 0.1 * k)))
    strips = [strips[0] for strips in recorded().column("/world/paths/driven", "LineStrips3D:strips")]
    assert [len(strip) for strip in strips] == list(range(1, 12))
    assert strips[-1][-1] == pytest.approx([1.0, 0.0, 0.02])


def test_a_pose_is_a_labelled_triad_until_it_is_cleared(record, recorded):
    with record() as recorder:
        recorder.pose("grasp 1", Pose.from_xyz_rpy((1.0, 0.0, 0.5), (0.0, 0.0, math.pi / 2)), 1.0, axis_length=0.1)
        recorder.clear("grasp 1", 2.0)
    run = recorded()
    (vectors,) = run.column("/world/markers/grasp_1", "Arrows3D:vectors")
    assert vectors[0] == pytest.approx([0.0, 0.1, 0.0], abs=1e-6)
    assert run.column("/world/markers/grasp_1/label", "Points3D:labels") == [["grasp 1"]]
    assert [row["sim_time"] for row in run.rows("/world/markers/grasp_1") if row.get("Clear:is_recursive")] == [2.0]


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_what_was_recorded_is_on_disk_before_the_recording_is_closed(record, tmp_path):
    from rerun.chunk import RrdReader

    with record() as recorder:
        recorder.snapshot(snapshot(1.0, x=3.0))
        deadline = time.monotonic() + 60.0
        entities: set[str] = set()
        while "/joints" not in entities and time.monotonic() < deadline:
            time.sleep(0.1)
            entities = {chunk.entity_path for chunk in RrdReader(tmp_path / "run.rrd").stream()}
        assert "/joints" in entities


def test_the_recording_brings_its_blueprint(record, recorded):
    with record():
        pass
    assert len(recorded().reader.blueprints()) == 1


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda recorder: recorder.text("LOUD", "x", 0.0), "DEBUG, INFO, WARN, ERROR but is 'LOUD'"),
        (lambda recorder: recorder.snapshot(snapshot(0.0, body_poses={"ghost": Pose()})), "'ghost' was not announced"),
        (lambda recorder: recorder.open(), "is open already"),
    ],
)
def test_what_cannot_be_recorded_is_refused_in_words(record, call, words):
    with record() as recorder, pytest.raises(RecordingError, match=words):
        call(recorder)


def test_an_image_of_an_unknown_camera_is_refused(record, intrinsics, picture):
    image = RGBDImage(picture, np.ones((48, 64), dtype=np.float32), intrinsics, 0.0)
    with record() as recorder, pytest.raises(RecordingError, match="camera 'wrist' was not announced; there are head"):
        recorder.image("wrist", image)


def test_nothing_can_be_recorded_before_opening_and_after_closing(tmp_path, robot_urdf, fetch_tree):
    recorder = RerunRecorder(tmp_path / "run.rrd", RecordingSetup(robot_urdf, "floor_point", fetch_tree))
    assert not (tmp_path / "run.rrd").exists()
    with pytest.raises(RecordingError, match="is not open"):
        recorder.snapshot(snapshot(0.0))
    with recorder:
        recorder.snapshot(snapshot(0.0))
    with pytest.raises(RecordingError, match="is not open"):
        recorder.snapshot(snapshot(1.0))


def test_a_path_that_cannot_be_written_is_an_error(tmp_path, robot_urdf, fetch_tree):
    missing = tmp_path / "no" / "folder" / "run.rrd"
    recorder = RerunRecorder(missing, RecordingSetup(robot_urdf, "floor_point", fetch_tree))
    with pytest.raises(RecordingError, match="cannot be written"):
        recorder.open()
