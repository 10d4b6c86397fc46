"""The views of a dataset that show its board, with the poses of both ends of the chain from the encoders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import BoardSighting, CalibrationError, ContradictingViewsError
from bestman_bt.perception.calibration.depth_error import DepthCalibration
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, JointGroupModel
from bestman_bt.runtime.calibration.dataset import Dataset, Progress, RecordedView, pose_of
from bestman_bt.runtime.calibration.result import CalibrationResult
from bestman_bt.runtime.calibration.robot_chain import RobotChain


@dataclass(frozen=True, eq=False)
class Seen:
    """The views that show the board, and their camera; ``left_out``: names of contradicting views."""

    views: tuple[RecordedView, ...]
    sightings: tuple[BoardSighting, ...]
    intrinsics: CameraIntrinsics
    recorded: int
    left_out: tuple[str, ...] = ()

    def without(self, indices: Sequence[int]) -> Seen:
        """Return the remaining views; those at ``indices`` are moved to ``left_out``."""
        kept = [index for index in range(len(self.views)) if index not in indices]
        return replace(
            self,
            views=tuple(self.views[index] for index in kept),
            sightings=tuple(self.sightings[index] for index in kept),
            left_out=tuple(self.views[index].name for index in indices),
        )

    @contextmanager
    def named(self) -> Iterator[None]:
        """Inside this context, ContradictingViewsError names the views instead of their indices."""
        try:
            yield
        except ContradictingViewsError as error:
            raise ContradictingViewsError(error.views, [view.name for view in self.views]) from None


def chain_of(dataset: Dataset) -> RobotChain | None:
    """Return the robot's chain to the camera, or None for a dataset without a robot."""
    if dataset.config.robot is None:
        return None
    return RobotChain(load_robot_model(dataset.config.robot), dataset.config.camera)


def seen_views(dataset: Dataset, chain: RobotChain | None, progress: Progress) -> Seen:
    """Find the board in all images. Raises ConfigurationError if the camera's intrinsics are not known."""
    views, size = dataset.read(progress)
    intrinsics = dataset.intrinsics(size)
    if intrinsics is None and chain is not None:
        intrinsics = chain.intrinsics
        if (intrinsics.width, intrinsics.height) != size:
            own = f"{intrinsics.width} × {intrinsics.height}"
            message = f"the images have {size[0]} × {size[1]} pixels, the robot's camera {own}"
            raise ConfigurationError([dataset.document.problem(("camera",), message)])
    if intrinsics is None:
        message = "is missing: without a robot the dataset should state the camera's intrinsics"
        raise ConfigurationError([dataset.document.problem(("intrinsics",), message)])
    with_board = [(view, view.sighting) for view in views if view.sighting is not None]
    return Seen(tuple(v for v, _ in with_board), tuple(s for _, s in with_board), intrinsics, len(views))


def both_ends(dataset: Dataset, chain: RobotChain | None, seen: Seen) -> tuple[list[Pose], list[Pose]]:
    """Return base_from_carrier (of the camera) and base_from_holder (of the board) of each view.

    Raises ConfigurationError if joint positions or hand poses are missing.
    """
    config, problems = dataset.config, []
    carriers, holders = [], []
    for view in seen.views:
        recorded = config.views[view.index]
        if chain is None:
            if recorded.hand is None:
                problems.append(dataset.document.problem(("views", view.index), "'hand' is missing: the hand's pose"))
                continue
            hand = pose_of(recorded.hand)
            carriers.append(hand if config.setup == "eye_in_hand" else Pose())
            holders.append(Pose() if config.setup == "eye_in_hand" else hand)
            continue
        wanted = chain.joints_to(chain.carrier) + (chain.joints_to(config.board_on) if config.board_on else [])
        movable = {
            j
            for group in (chain.robot.of(ArmModel), chain.robot.of(JointGroupModel))
            for m in group.values()
            for j in m.joint_names
        }
        missing = [joint for joint in dict.fromkeys(wanted) if joint in movable and joint not in recorded.joints]
        if missing:
            message = f"positions of {', '.join(missing)} are missing"
            problems.append(dataset.document.problem(("views", view.index, "joints"), message))
            continue
        try:
            carriers.append(chain.kinematics.pose(chain.carrier, recorded.joints))
            holders.append(chain.kinematics.pose(config.board_on, recorded.joints) if config.board_on else Pose())
        except ManipulationError as error:
            problems.append(dataset.document.problem(("views", view.index, "joints"), str(error)))
    if problems:
        raise ConfigurationError(problems)
    return carriers, holders


def add_depth(seen: Seen, poses: Sequence[Pose], settings: dict[str, Any], figures: dict[str, Any]) -> list[str]:
    """Calibrate the depth if the views have it; returns notes on what failed."""
    with_depth = [
        (sighting, pose, view.depth)
        for view, sighting, pose in zip(seen.views, seen.sightings, poses, strict=True)
        if view.depth is not None
    ]
    if not with_depth:
        return []
    try:
        found = DepthCalibration().calibrate(with_depth, seen.intrinsics)
    except CalibrationError as error:
        return [f"depth was not calibrated: {error}"]
    settings |= {"depth_scale": found.correction.scale, "depth_offset": found.correction.offset}
    figures["depth"] = {
        "scale_std": found.scale_std,
        "offset_std_mm": 1e3 * found.offset_std,
        "residual_mm": 1e3 * float(np.sqrt(np.mean(found.residuals**2))),
        "nearest_m": float(found.distances.min()),
        "farthest_m": float(found.distances.max()),
    }
    return []


def result_of(
    kind: str,
    dataset: Dataset,
    seen: Seen,
    offsets: Sequence[np.ndarray],
    parts: dict[str, dict[str, Any]],
    figures: dict[str, Any],
    notes: list[str],
) -> CalibrationResult:
    """Return the result, with a note on the unused views."""
    errors = np.array([np.sqrt(np.mean(np.sum(offset**2, axis=1))) for offset in offsets])
    without = seen.recorded - len(seen.views) - len(seen.left_out)
    if seen.left_out:
        which = ", ".join(seen.left_out)
        notes = [*notes, f"left out because they contradict the other views: {which}; check pose and image"]
    if without:
        notes = [*notes, f"{without} of {seen.recorded} views do not show enough of the board"]
    return CalibrationResult(
        kind, dataset.config.robot, dataset.config.camera, seen.recorded, tuple(view.name for view in seen.views),
        errors, tuple(offsets), parts, figures, tuple(notes),
    )  # fmt: skip
