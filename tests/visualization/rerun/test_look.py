"""A look as a recording: pictures where the camera was, clouds, and every mark in the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Box, Handle, ObjectModel, PlacedShape, PointCloud, Pose, RGBDImage, YawSet
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.marks import GraspMark, HandleMark, ObjectMark, SceneMarks, SurfaceMark
from bestman_bt.visualization.rerun.look import RecordedLook, write_look

BOX = ObjectModel("box", (0.2, 0.3, 0.8), 0.3, 0.6, (PlacedShape(Box((0.1, 0.2, 0.3)), Pose()),), symmetry_order=2)
PLACE = Pose.from_xyz_rpy((1.0, 0.2, 0.9))
POINTS = np.array([[0.95, 0.2, 0.9], [0.95, 0.25, 0.95]])
BAR = Handle("bar", Pose.from_xyz_rpy((1.2, 0.0, 0.5)), 0.007, 0.3, 0.04, np.array([-1.0, 0.0, 0.0]), 0.9, 0.002)
MARKS = SceneMarks(
    objects=(ObjectMark("box 1", BOX, PLACE, 0.9, 0.001, YawSet(), POINTS),),
    handles=(HandleMark("fridge/handle_1", BAR),),
    grasps=(GraspMark("box 1", PLACE, 0.1, 0.05, 1.0),),
    surfaces=(SurfaceMark("table/top", Pose.from_xyz_rpy((1.0, 0.0, 0.75)), (0.6, 1.2)),),
)


@pytest.fixture
def two_looks(picture, intrinsics) -> list[RecordedLook]:
    depth = np.full((48, 64), 1.5, dtype=np.float32)
    return [
        RecordedLook(
            "head",
            RGBDImage(picture, depth, intrinsics, stamp),
            Pose.from_xyz_rpy((stamp, 0.0, 1.6)),
            PointCloud(POINTS),
        )
        for stamp in (1.0, 2.5)
    ]


def test_each_picture_lies_where_and_when_its_camera_took_it(tmp_path: Path, recorded, two_looks) -> None:
    write_look(tmp_path / "run.rrd", two_looks, MARKS)
    run = recorded()
    for number, stamp in enumerate((1.0, 2.5)):
        (row,) = run.rows(f"/world/camera/head_{number}/rgb")
        assert row["sim_time"] == stamp
        places = run.column(f"/world/camera/head_{number}", "Transform3D:translation")
        assert places == [[pytest.approx([stamp, 0.0, 1.6])]]
        assert run.column(f"/world/sensed/head_{number}", "Points3D:positions") == [
            [pytest.approx(point) for point in POINTS]
        ]


def test_marks_are_in_sight_from_the_first_picture_on(tmp_path: Path, recorded, two_looks) -> None:
    write_look(tmp_path / "run.rrd", two_looks, MARKS)
    run = recorded()
    marked = {entity for entity in run.entities if entity.startswith(("/world/scene", "/world/markers"))}
    assert {entity.split("/")[3] for entity in marked if entity.startswith("/world/scene")} == {
        "objects",
        "handles",
        "grasps",
        "surfaces",
    }
    assert {row["sim_time"] for entity in marked for row in run.rows(entity)} == {1.0}


def test_marks_have_the_place_and_size_of_what_they_stand_for(tmp_path: Path, recorded, two_looks) -> None:
    write_look(tmp_path / "run.rrd", two_looks, MARKS)
    run = recorded()
    (edges,) = run.column("/world/scene/objects/box_1/box", "LineStrips3D:strips")
    corners = np.array(edges).reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx([0.95, 0.1, 0.75], abs=1e-6)
    assert corners.max(axis=0) == pytest.approx([1.05, 0.3, 1.05], abs=1e-6)
    (points,) = run.column("/world/scene/objects/box_1/points", "Points3D:positions")
    assert points == [pytest.approx(point) for point in POINTS]
    ((bar,),) = run.column("/world/scene/handles/fridge_handle_1", "LineStrips3D:strips")
    assert bar == [pytest.approx([1.05, 0.0, 0.5]), pytest.approx([1.35, 0.0, 0.5])]
    ((pull,),) = run.column("/world/scene/handles/fridge_handle_1/opening", "Arrows3D:vectors")
    assert pull[0] < 0.0
    ((half,),) = run.column("/world/scene/surfaces/table_top", "Boxes3D:half_sizes")
    assert half[:2] == pytest.approx([0.3, 0.6])


def test_a_look_that_found_nothing_is_a_recording_all_the_same(tmp_path: Path, recorded, two_looks) -> None:
    write_look(tmp_path / "run.rrd", two_looks, SceneMarks())
    run = recorded()
    assert "/world/camera/head_0/rgb" in run.entities
    assert not any(entity.startswith("/world/scene") for entity in run.entities)
    assert len(run.reader.blueprints()) == 1


def test_a_path_that_cannot_be_written_is_an_error(tmp_path: Path, two_looks) -> None:
    with pytest.raises(RecordingError, match="cannot be written"):
        write_look(tmp_path / "nowhere" / "run.rrd", two_looks, MARKS)
