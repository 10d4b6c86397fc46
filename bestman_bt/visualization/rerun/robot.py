"""The robot in a recording: its meshes once, its joints at every snapshot."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.frame_transforms import FrameTransforms

if TYPE_CHECKING:
    import rerun as rr
    from rerun.urdf import UrdfJoint, UrdfTree

MOVABLE_JOINTS = frozenset({"revolute", "continuous", "prismatic"})


@dataclass(frozen=True, eq=False)
class _Joint:
    parent: str
    child: str
    prismatic: bool
    axis: NDArray[np.float64]
    origin: Pose

    def transform(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.prismatic:
            return self.origin.position + self.origin.rotation @ (self.axis * value), self.origin.quaternion
        x1, y1, z1, w1 = self.origin.quaternion
        x2, y2, z2 = self.axis * np.sin(value / 2)
        w2 = np.cos(value / 2)
        quaternion = np.array(
            [
                w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
                w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
                w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
                w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            ]
        )
        return self.origin.position, quaternion


class RecordedRobot:
    """A URDF robot: ``urdf`` is its text with absolute mesh paths, ``base_frame`` the link whose pose is given."""

    def __init__(self, urdf: str, base_frame: str) -> None:
        self.base_frame = base_frame
        self._urdf = urdf
        self._joints: dict[str, _Joint] = {}
        self._base_from_root = Pose()
        self._root = base_frame
        self.name = ""

    def write_model(self, recording: rr.RecordingStream) -> None:
        """Write the visual meshes and the fixed joints; RecordingError if the URDF or a mesh cannot be read."""
        from rerun.urdf import UrdfTree

        text = _without_collision(self._urdf)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_bytes(text)
            try:
                tree = UrdfTree.from_file_path(
                    path,
                    entity_path_prefix=entities.WORLD,
                    frame_prefix=entities.ROBOT_FRAME_PREFIX,
                    static_transform_entity_path=entities.STATIC_TRANSFORMS,
                )
                tree.log_urdf_to_recording(recording)
                _fill_primitives(recording, tree, text)
            except (RuntimeError, ValueError, OSError) as error:
                raise RecordingError(f"robot URDF: {error}") from error
        self.name = tree.name
        self._root = tree.root_link().name
        joints = tree.joints()
        self._base_from_root = self._pose_of_root(joints)
        for joint in joints:
            if joint.joint_type in MOVABLE_JOINTS:
                axis = np.asarray(joint.axis, dtype=float)
                self._joints[joint.name] = _Joint(
                    joint.parent_link,
                    joint.child_link,
                    joint.joint_type == "prismatic",
                    axis / np.linalg.norm(axis),
                    Pose.from_xyz_rpy(joint.origin_xyz, joint.origin_rpy),
                )

    def place(self, transforms: FrameTransforms, map_from_base: Pose, joint_positions: Mapping[str, float]) -> None:
        """Add the frames of the base and of the joints; RecordingError for a joint that the URDF does not have."""
        transforms.add_pose(
            entities.MAP_FRAME, entities.ROBOT_FRAME_PREFIX + self._root, map_from_base @ self._base_from_root
        )
        for name, position in joint_positions.items():
            if name not in self._joints:
                raise RecordingError(
                    f"snapshot: joint {name!r} is no movable joint of robot {self.name!r}; "
                    f"it has {', '.join(self._joints) or 'none'}"
                )
            joint = self._joints[name]
            translation, quaternion = joint.transform(position)
            prefix = entities.ROBOT_FRAME_PREFIX
            transforms.add(prefix + joint.parent, prefix + joint.child, translation, quaternion)

    def _pose_of_root(self, joints: Sequence[UrdfJoint]) -> Pose:
        """base_from_root, where the base frame hangs on the root by fixed joints."""
        by_child = {joint.child_link: joint for joint in joints}
        root_from_base, link = Pose(), self.base_frame
        while link != self._root:
            joint = by_child.get(link)
            if joint is None or joint.joint_type != "fixed":
                raise RecordingError(
                    f"base_frame {self.base_frame!r} should be the root link {self._root!r} of the robot "
                    f"or be fixed to it"
                )
            root_from_base = Pose.from_xyz_rpy(joint.origin_xyz, joint.origin_rpy) @ root_from_base
            link = joint.parent_link
        return root_from_base.inverse()


def _fill_primitives(recording: rr.RecordingStream, tree: UrdfTree, urdf: bytes) -> None:
    """Draw boxes, cylinders and balls solid: Rerun's own choice is see-through."""
    import rerun as rr

    archetypes: dict[str, Any] = {"box": rr.Boxes3D, "cylinder": rr.Cylinders3D, "sphere": rr.Ellipsoids3D}
    for link in ElementTree.fromstring(urdf).iter("link"):
        shapes = [shape.tag for shape in link.findall("visual/geometry/*")]
        for path, shape in zip(tree.get_visual_geometry_paths(link.get("name", "")), shapes, strict=True):
            if shape in archetypes:
                solid = archetypes[shape].from_fields(fill_mode=rr.components.FillMode.Solid)
                recording.log(path, solid, static=True)


def _without_collision(urdf: str) -> bytes:
    """The same robot without collision shapes: they would double the recording and hide the visual ones."""
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise RecordingError(f"robot URDF: {error}") from error
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
    for mesh in root.iter("mesh"):
        path = Path(mesh.get("filename", "").removeprefix("file://"))
        if not path.is_absolute() or not path.is_file():
            raise RecordingError(f"robot URDF: mesh {mesh.get('filename')!r} should be the absolute path of a file")
    return ElementTree.tostring(root)
