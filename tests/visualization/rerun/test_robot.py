from __future__ import annotations

import numpy as np
import pinocchio
import pytest

from bestman_bt.messages import Pose
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.snapshot import RobotSnapshot

MESHLESS = """
<robot name="r"><link name="a"><visual><geometry><mesh filename="none.obj"/></geometry></visual></link></robot>
"""


def link_pose(recorded, link: str) -> Pose:
    """map_from_link, composed from all transforms of the recording as a viewer does it."""
    edges = {}
    for entity, static in (("/world/static_transforms", True), ("/world/transforms", False)):
        for row in recorded.rows(entity, static=static):
            edges[row["Transform3D:child_frame"][0]] = (
                row["Transform3D:parent_frame"][0],
                Pose(np.array(row["Transform3D:translation"][0]), np.array(row["Transform3D:quaternion"][0])),
            )
    pose, frame = Pose(), f"robot/{link}"
    while frame != "map":
        frame, transform = edges[frame]
        pose = transform @ pose
    return pose


def test_links_stand_where_forward_kinematics_puts_them(record, recorded, robot_urdf):
    map_from_base = Pose.from_xyz_rpy((1.0, -2.0, 0.0), (0.0, 0.0, 0.7))
    joints = {"arm_shoulder": 0.9, "arm_slide": 0.25}
    with record() as recorder:
        recorder.snapshot(RobotSnapshot(1.0, 20, map_from_base, joints))
    model = pinocchio.buildModelFromXML(robot_urdf)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, np.array([joints[name] for name in list(model.names)[1:]]))
    for link in ("chassis", "upper_arm", "hand"):
        expected = map_from_base @ Pose.from_matrix(data.oMf[model.getFrameId(link)].homogeneous)
        assert link_pose(recorded(), link).matrix == pytest.approx(expected.matrix, abs=1e-6)


def test_a_base_frame_that_is_fixed_to_the_root_places_the_whole_robot(record, recorded):
    with record(base_frame="chassis") as recorder:
        recorder.snapshot(RobotSnapshot(1.0, 20, Pose.from_xyz_rpy((0.0, 0.0, 1.0)), {}))
    assert link_pose(recorded(), "floor_point").position == pytest.approx([0.0, 0.0, 0.8])


def test_collision_shapes_stay_out_of_the_recording_and_primitives_are_solid(record, recorded):
    with record():
        pass
    run = recorded()
    shape = "/world/cart/visual_geometries/chassis/visual_0"
    assert shape in run.entities
    assert not [entity for entity in run.entities if "collision" in entity]
    solid = 3
    assert run.column(shape, "Boxes3D:fill_mode", static=True)[-1] == [solid]


def test_a_joint_that_the_robot_does_not_have_is_named(record):
    with record() as recorder, pytest.raises(RecordingError, match="'elbow' is not a movable joint of robot 'cart'"):
        recorder.snapshot(RobotSnapshot(0.0, 0, Pose(), {"elbow": 0.1}))


@pytest.mark.parametrize(
    ("urdf", "words"),
    [
        ("<robot name='r'><link", "robot URDF"),
        (MESHLESS, "mesh 'none.obj' should be the absolute path"),
    ],
)
def test_a_urdf_that_cannot_be_shown_is_an_error(record, urdf, words):
    with pytest.raises(RecordingError, match=words), record(urdf=urdf, base_frame="a"):
        pass


def test_a_base_frame_beyond_a_moving_joint_is_refused(record):
    with pytest.raises(RecordingError, match="base_frame 'hand' should be the root link"), record(base_frame="hand"):
        pass
