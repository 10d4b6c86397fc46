"""Grasps of a network with the input and output of AnyGrasp, which is not part of this package.

Fang et al., "AnyGrasp: Robust and Efficient Grasp Perception in Spatial and Temporal Domains", 2023. Its detector has
``get_grasp(points, colors, lims)`` in a camera frame, which returns a ``GraspGroup`` of graspnetAPI: rows of 17
numbers, score, width, height, depth, rotation (9, row by row), translation (3), object id. In these, x of the rotation
is the approach, y the closing direction, and the finger tips are ``depth`` beyond the translation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.hand_poses import HandPoses, different_hands
from bestman_bt.perception.grasp_pose.hand_shape import HandPlacement, HandShape, HandSize
from bestman_bt.perception.grasp_pose.ranking import surroundings_of
from bestman_bt.robot_model.model import GripperModel

ROW = 17
"""Numbers of a grasp in graspnetAPI's arrays."""


@dataclass(frozen=True)
class AnyGraspAdapter(GraspPlanner):
    """Queries a network with the interface of AnyGrasp. Raises PerceptionError for targets without cloud or viewpoint.

    Lengths in metres. ``network``: ``"module:factory"``; the factory takes no arguments and returns the loaded
    detector, an object with ``get_grasp`` or a callable with its signature. It is loaded on first use. ``region``:
    margin around the target's points in which grasps are requested; ``on_target``: maximum distance of the middle
    between the fingertips from one of them. ``max_tilt``: of the approach from straight down, radians.
    ``object_clearance``, ``surroundings_clearance``: of the open hand. ``max_candidates``: maximum number of returned
    grasps.
    """

    network: str = ""
    region: Annotated[float, "m"] = 0.03
    on_target: Annotated[float, "m"] = 0.025
    max_tilt: Annotated[float, "rad"] = math.radians(100.0)
    object_clearance: Annotated[float, "m"] = 0.0
    surroundings_clearance: Annotated[float, "m"] = 0.004
    max_candidates: int = 80
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def plan(self, target: GraspTarget, gripper: GripperModel, support_height: float) -> tuple[GraspCandidate, ...]:
        """Return the network's grasps, best first. Raises PerceptionError if the network is missing or its output has
        another format.
        """
        if target.cloud is None or target.viewpoints is None or not len(target.viewpoints):
            raise PerceptionError("AnyGraspAdapter needs a target with a cloud and the viewpoint that it was seen from")
        kept = np.isfinite(target.cloud.points).all(axis=1)
        points = target.cloud.points[kept]
        if not len(points):
            return ()
        others = surroundings_of(target, support_height, 0.3)
        frame_from_camera = camera_looking_at(np.asarray(target.viewpoints, dtype=float)[0], points.mean(axis=0))
        colors = None if target.cloud.colors is None else target.cloud.colors[kept]
        rows = self._ask(frame_from_camera, points, colors, target.surroundings)
        hands, widths = tool_poses(rows, frame_from_camera, gripper)
        widths = np.maximum(widths - 2 * self.hand.clearance, gripper.part.min_width + 1e-4)
        shape = HandShape(gripper, self.shape)
        openings = self.hand.openings(widths, gripper)
        free = np.array([self.hand.fits(float(width), gripper) for width in widths], dtype=bool)
        free &= hands.rotations[:, 2, 2] < -math.cos(self.max_tilt)
        free &= cKDTree(points).query(hands.positions)[0] < self.on_target if len(hands) else free
        lowest = shape.lowest(hands, openings) - support_height
        free &= ~shape.touches(hands, openings, points, self.object_clearance) & (lowest > 0.0)
        around = shape.clearances(hands, openings, others)
        free &= around > self.surroundings_clearance
        order = np.argsort(-rows[:, 0], kind="stable")
        chosen = different_hands(hands, order[free[order]], self.max_candidates, 0.005, math.radians(10.0))
        candidates = []
        for index in chosen:
            rotation = hands.rotations[index]
            kind = "top" if rotation[2, 2] < -math.cos(math.pi / 4) else "side"
            candidate = self.hand.candidate(
                hands.positions[index],
                rotation[:, 2],
                rotation[:, 1],
                float(widths[index]),
                float(rows[index, 0]),
                kind,
                gripper,
            )
            candidates.append(replace(candidate, clearance=float(min(around[index], lowest[index]))))
        return tuple(candidates)

    def _ask(
        self,
        frame_from_camera: Pose,
        points: NDArray[np.float64],
        colors: NDArray[np.uint8] | None,
        surroundings: NDArray[np.float64] | None,
    ) -> NDArray[np.float64]:
        """Return the network's rows (N, 17), those that are finite."""
        camera_from_frame = frame_from_camera.inverse()
        scene = points if surroundings is None else np.concatenate([points, surroundings])
        seen = camera_from_frame.apply(scene)
        seen = seen[np.isfinite(seen).all(axis=1)].astype(np.float32)
        shades = np.full((len(seen), 3), 0.5, dtype=np.float32)
        if colors is not None:
            shades[: len(points)] = colors.astype(np.float32) / 255.0
        target = camera_from_frame.apply(points)
        lower, upper = target.min(axis=0) - self.region, target.max(axis=0) + self.region
        limits = [float(value) for pair in zip(lower, upper, strict=True) for value in pair]
        answer = getattr(self._network, "get_grasp", self._network)(seen, shades, limits)
        return grasp_rows(answer)

    @cached_property
    def _network(self) -> Any:
        return load_network(self.network)


def load_network(name: str) -> Any:
    """Import and call the factory ``"module:factory"``. Raises PerceptionError naming the missing module or
    function."""
    module, _, factory = name.partition(":")
    if not module or not factory:
        raise PerceptionError(
            "AnyGraspAdapter: network should be 'module:factory', where the factory returns a loaded detector, "
            f"but is {name!r}"
        )
    try:
        make = getattr(import_module(module), factory)
    except ModuleNotFoundError as error:
        raise PerceptionError(
            f"AnyGraspAdapter: network {name!r} cannot be loaded: no module {error.name!r}; AnyGrasp's gsnet comes "
            "from its authors with a licence and needs a GPU, it is not installed with this package"
        ) from error
    except AttributeError as error:
        raise PerceptionError(f"AnyGraspAdapter: network {name!r} cannot be loaded: {error}") from error
    return make()


def grasp_rows(answer: Any) -> NDArray[np.float64]:
    """Return the rows (N, 17) of a detector's output: a GraspGroup or its array, alone or first of a tuple; None: no
    rows.

    Rows with numbers that are not finite are omitted. Raises PerceptionError for another format.
    """
    group = answer[0] if isinstance(answer, tuple) else answer
    if group is None:
        return np.zeros((0, ROW))
    rows: NDArray[np.float64] = np.asarray(getattr(group, "grasp_group_array", group), dtype=float)
    if rows.size == 0:
        return np.zeros((0, ROW))
    if rows.ndim != 2 or rows.shape[1] != ROW:
        raise PerceptionError(f"AnyGraspAdapter: grasps should be an (N, {ROW}) array but are {rows.shape}")
    return rows[np.isfinite(rows).all(axis=1)]


def tool_poses(
    rows: NDArray[np.float64], frame_from_camera: Pose, gripper: GripperModel
) -> tuple[HandPoses, NDArray[np.float64]]:
    """Return tool poses in the target's frame, and the opening widths (N,), metres, for rows (N, 17) of the network.

    The fingertips of the network's hand and ours coincide: half a pad beyond our tool frame.
    """
    turn = frame_from_camera.rotation
    theirs = turn @ rows[:, 4:13].reshape(-1, 3, 3)
    approach, closing = theirs[:, :, 0], theirs[:, :, 1]
    rotations = np.stack([np.cross(closing, approach), closing, approach], axis=2)
    tips = frame_from_camera.apply(rows[:, 13:16]) + approach * rows[:, 3:4]
    return HandPoses(rotations, tips - approach * gripper.part.pad_size[1] / 2), rows[:, 1]


def camera_looking_at(viewpoint: NDArray[np.float64], middle: NDArray[np.float64]) -> Pose:
    """Return an optical frame (z forward, y down) at ``viewpoint`` that looks at ``middle``, both (3,) with z up."""
    forward = (middle - viewpoint) / np.linalg.norm(middle - viewpoint)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:
        right = np.array([0.0, -1.0, 0.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    matrix[:3, 3] = viewpoint
    return Pose.from_matrix(matrix)
