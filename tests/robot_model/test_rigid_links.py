"""Links on fixed joints merged into those that they hang on: the same body, with fewer links."""

import numpy as np
import pinocchio
import pytest

from bestman_bt.messages import Pose
from bestman_bt.robot_model import load_robot_model
from bestman_bt.robot_model.bare_frames import without_bare_frames
from bestman_bt.robot_model.rigid_links import with_rigid_links_merged

KEEP = {"front_caster", "rear_caster", "panda_hand"}


@pytest.fixture(scope="module")
def urdf():
    return without_bare_frames(load_robot_model("diff_panda").urdf)[0]


@pytest.fixture(scope="module")
def merged(urdf):
    return with_rigid_links_merged(urdf, KEEP)


def test_only_the_kept_links_stay_on_fixed_joints(merged):
    model = pinocchio.buildModelFromXML(merged[0])
    fixed = {frame.name for frame in model.frames if frame.type == pinocchio.FrameType.FIXED_JOINT}
    assert fixed - {"universe"} == {"front_caster_joint", "rear_caster_joint", "gripper_mount_joint"}


def test_the_dynamics_stay_the_same(urdf, merged):
    before, after = (pinocchio.buildModelFromXML(text, pinocchio.JointModelFreeFlyer()) for text in (urdf, merged[0]))
    rng = np.random.default_rng(3)
    for _ in range(5):
        velocity = {name: rng.normal(size=joint.nv) for name, joint in zip(before.names, before.joints, strict=True)}
        acceleration = {name: rng.normal(size=values.size) for name, values in velocity.items()}
        told = _efforts(before, velocity, acceleration)
        for name, effort in _efforts(after, velocity, acceleration).items():
            np.testing.assert_allclose(effort, told[name], atol=1e-9)


def _efforts(model, velocity, acceleration):
    """Efforts by joint name, where the joints stand as far from zero as ``velocity`` takes them in a second."""
    v, a = np.zeros(model.nv), np.zeros(model.nv)
    slots = {name: slice(j.idx_v, j.idx_v + j.nv) for name, j in zip(model.names, model.joints, strict=True) if j.nv}
    for name, slot in slots.items():
        v[slot], a[slot] = velocity[name], acceleration[name]
    q = pinocchio.integrate(model, pinocchio.neutral(model), v)
    effort = pinocchio.rnea(model, model.createData(), q, v, a)
    return {name: effort[slot] for name, slot in slots.items()}


def test_shapes_stay_where_they_are(urdf, merged):
    before, after = (pinocchio.buildModelFromXML(text) for text in (urdf, merged[0]))
    placed = []
    for model, text in ((before, urdf), (after, merged[0])):
        geometry = pinocchio.buildGeomFromUrdfString(model, text, pinocchio.COLLISION)
        data = geometry.createData()
        pinocchio.updateGeometryPlacements(model, model.createData(), geometry, data, pinocchio.neutral(model))
        placed.append(sorted(np.round(placement.homogeneous, 9).ravel().tolist() for placement in data.oMg))
    assert len(placed[0]) == len(placed[1])
    np.testing.assert_allclose(placed[1], placed[0], atol=1e-8)


def test_merged_links_are_told_as_frames(urdf, merged):
    before, after = (pinocchio.buildModelFromXML(text) for text in (urdf, merged[0]))
    holder, holder_from_camera = merged[1]["wrist_camera_link"]
    assert holder == "panda_hand"
    at = {}
    for model, name in ((before, "wrist_camera_link"), (after, holder)):
        data = model.createData()
        pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
        at[name] = data.oMf[model.getFrameId(name)].homogeneous
    expected = Pose.from_matrix(at["panda_hand"]) @ holder_from_camera
    np.testing.assert_allclose(expected.matrix, at["wrist_camera_link"], atol=1e-9)
