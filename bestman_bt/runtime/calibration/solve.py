"""Solvers: from a dataset to intrinsics, the mount of a camera on a head or arm, or its pose beside an arm."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import (
    BoardSighting,
    CalibrationError,
    ContradictingViewsError,
    board_pose,
    project,
)
from bestman_bt.perception.calibration.depth_error import DepthCalibration
from bestman_bt.perception.calibration.head_camera import BoardView, ChainCalibration, ChainPoses, calibrate_head_camera
from bestman_bt.perception.calibration.intrinsics import IntrinsicsCalibration
from bestman_bt.registry import ALGORITHMS, class_and_preset
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, JointGroupModel
from bestman_bt.runtime.calibration.dataset import Dataset, Progress, RecordedView, pose_of
from bestman_bt.runtime.calibration.robot_chain import RobotChain, written


def plot_residuals(result: CalibrationResult, path: Path) -> None:
    """Write a PNG: offsets of all corners in pixels, and the root mean square of each view."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    scatter, bars = figure.subplots(1, 2, width_ratios=(1.0, 1.6))
    offsets = np.concatenate(result.offsets)
    reach = 1.1 * max(float(np.percentile(np.abs(offsets), 99.5)), 0.05)
    shades = np.concatenate([np.full(len(offset), i) for i, offset in enumerate(result.offsets)])
    scatter.scatter(offsets[:, 0], offsets[:, 1], c=shades, s=7, cmap="viridis", alpha=0.7, linewidths=0)
    scatter.axhline(0.0, color="0.6", linewidth=0.8)
    scatter.axvline(0.0, color="0.6", linewidth=0.8)
    scatter.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal", xlabel="u, pixels", ylabel="v, pixels")
    scatter.set_title(f"{len(offsets)} corners, {result.error:.2f} px root mean square")
    bars.bar(range(len(result.views)), result.errors, color="#4878a8")
    bars.axhline(result.error, color="#c0504d", linewidth=1.2)
    bars.set_xticks(range(len(result.views)), result.views, rotation=90, fontsize=7)
    bars.set(ylabel="pixels", title=f"{result.camera}, {result.kind.replace('_', '-')}: each view")
    bars.margins(x=0.01)
    figure.savefig(path, dpi=110, metadata={"Software": ""})


def solve_intrinsics(dataset: Dataset, method: IntrinsicsCalibration, progress: Progress) -> CalibrationResult:
    """Return focal lengths, principal point and distortion. Raises CalibrationError."""
    views, size = dataset.read(progress)
    found = method.calibrate([view.sighting for view in views], size)
    k = found.intrinsics
    used = tuple(views[index] for index in found.used)
    sightings = tuple(view.sighting for view in used if view.sighting is not None)
    seen = BoardViews(used, sightings, k, len(views))
    settings: dict[str, Any] = {
        "width": k.width,
        "height": k.height,
        "focal_length": [k.fx, k.fy],
        "principal_point": [k.cx, k.cy],
        "distortion": list(k.distortion),
    }
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    figures: dict[str, Any] = {
        "standard_deviations": dict(zip(names, found.standard_deviations.tolist(), strict=True)),
        "coverage": float(found.coverage.mean()),
    }
    offsets = [
        project(sighting.points, board_pose(sighting, k).eye_from_board, k) - sighting.pixels for sighting in sightings
    ]
    return result_of("intrinsics", dataset, seen, offsets, {dataset.config.camera: {"set": settings}}, figures, [])


def solve_head(dataset: Dataset, progress: Progress) -> CalibrationResult:
    """Calibrate a camera on a pan-tilt head, in front of a fixed board or of a board on the arm.

    Raises CalibrationError or ConfigurationError.
    """
    if not dataset.board.shows_orientation:
        raise CalibrationError("a checkerboard looks the same after half a turn; poses need a ChArUco board")
    chain = chain_of(dataset)
    head = chain.head if chain is not None else None
    if chain is None or head is None:
        message = "this camera is not on a pan-tilt head; use bestman-bt calibrate hand-eye instead"
        raise ConfigurationError([dataset.document.problem(("camera",), message)])
    seen = seen_views(dataset, chain, progress)
    root = chain.head_root(head)
    joints = [dataset.config.views[view.index].joints for view in seen.views]
    _, holders = chain_ends(dataset, chain, seen)
    views = [
        BoardView(sighting, chain.kinematics.pose(chain.carrier, positions, root), holder)
        for sighting, positions, holder in zip(seen.sightings, joints, holders, strict=True)
    ]
    measured = dataset.config.board_pose
    with seen.named():
        found = calibrate_head_camera(
            views,
            seen.intrinsics,
            chain.kinematics.pose(root, {}),
            chain.carrier_from_camera(),
            pose_of(measured) if measured is not None else None,
            chain.head_axes(head),
        )
    seen = seen.without(found.chain.rejected)
    poses = found.chain.poses
    parts: dict[str, dict[str, Any]] = {}
    if "mount" in found.free:
        parts[head] = dict(chain.head_mount(head, poses.mount))
    parts[chain.camera] = dict(chain.camera_mount(poses.camera))
    settings: dict[str, Any] = {}
    figures: dict[str, Any] = {
        "estimated": list(found.free),
        "offsets_deg": {
            "pan": None if found.pan_offset is None else math.degrees(found.pan_offset),
            "tilt": math.degrees(found.tilt_offset),
        },
        "standard_deviations": {name: deviations(block) for name, block in found.chain.covariance.items()},
        "covariance": {name: block for name, block in found.chain.covariance.items() if name != "board"},
    }
    used = [view for index, view in enumerate(views) if index not in found.chain.rejected]
    notes = add_depth(seen, [poses.board_in_camera(view) for view in used], settings, figures)
    if settings:
        parts[chain.camera]["set"] = settings
    if "mount" not in found.free:
        notes.append(
            "the mount of the head was not estimated: that needs a board on the arm, or one at a measured pose"
        )
    return result_of("head", dataset, seen, found.chain.offsets, parts, figures, notes)


def solve_hand_eye(dataset: Dataset, method: str, progress: Progress) -> CalibrationResult:
    """Calibrate a camera on an arm in front of a fixed board, or a fixed camera in front of a board on the arm.

    Raises CalibrationError.
    """
    if not dataset.board.shows_orientation:
        raise CalibrationError("a checkerboard looks the same after half a turn; poses need a ChArUco board")
    chain = chain_of(dataset)
    seen = seen_views(dataset, chain, progress)
    carriers, holders = chain_ends(dataset, chain, seen)
    in_camera = [board_pose(sighting, seen.intrinsics).eye_from_board for sighting in seen.sightings]
    world_from_carrier = [holder.inverse() @ carrier for holder, carrier in zip(holders, carriers, strict=True)]
    kind, preset = class_and_preset(ALGORITHMS.resolve(f"calibration/{method}"))
    algorithm = kind(**preset)
    views = [BoardView(*view) for view in zip(seen.sightings, carriers, holders, strict=True)]
    with seen.named():
        first = algorithm.calibrate(world_from_carrier, in_camera)
        start = ChainPoses(Pose(), first.carrier_from_eye, first.world_from_target)
        refined = ChainCalibration().calibrate(views, seen.intrinsics, start, ("camera", "board"))
    seen = seen.without(refined.rejected)
    camera = refined.poses.camera
    settings: dict[str, Any] = {}
    figures: dict[str, Any] = {
        "method": method,
        "carrier": chain.carrier if chain is not None else "hand",
        "carrier_from_camera": {**written(camera), "quaternion_xyzw": camera.quaternion},
        "standard_deviations": deviations(refined.covariance["camera"]),
        "covariance": refined.covariance["camera"],
        "closed_form": {
            "apart_mm": 1e3 * float(np.linalg.norm(first.carrier_from_eye.position - camera.position)),
            "apart_deg": _degrees(first.carrier_from_eye, camera),
        },
    }
    used = [view for index, view in enumerate(views) if index not in refined.rejected]
    seen_poses = [refined.poses.board_in_camera(view) for view in used]
    notes = add_depth(seen, seen_poses, settings, figures)
    part: dict[str, Any] = chain.camera_mount(camera) if chain is not None else written(camera)
    if settings:
        part["set"] = settings
    return result_of("hand_eye", dataset, seen, refined.offsets, {dataset.config.camera: part}, figures, notes)


def _degrees(a: Pose, b: Pose) -> float:
    return math.degrees(2.0 * math.asin(min(1.0, float(np.linalg.norm((a.inverse() @ b).quaternion[:3])))))


@dataclass(frozen=True, eq=False)
class BoardViews:
    """The views that show the board, and their camera; ``rejected``: names of contradicting views."""

    views: tuple[RecordedView, ...]
    sightings: tuple[BoardSighting, ...]
    intrinsics: CameraIntrinsics
    recorded: int
    rejected: tuple[str, ...] = ()

    def without(self, indices: Sequence[int]) -> BoardViews:
        """Return the remaining views; those at ``indices`` are moved to ``rejected``."""
        kept = [index for index in range(len(self.views)) if index not in indices]
        return replace(
            self,
            views=tuple(self.views[index] for index in kept),
            sightings=tuple(self.sightings[index] for index in kept),
            rejected=tuple(self.views[index].name for index in indices),
        )

    @contextmanager
    def named(self) -> Iterator[None]:
        """Name the views, instead of their indices, in ContradictingViewsError raised within the context."""
        try:
            yield
        except ContradictingViewsError as error:
            raise ContradictingViewsError(error.views, [view.name for view in self.views]) from None


def chain_of(dataset: Dataset) -> RobotChain | None:
    """Return the robot's chain to the camera, or None for a dataset without a robot."""
    if dataset.config.robot is None:
        return None
    return RobotChain(load_robot_model(dataset.config.robot), dataset.config.camera)


def seen_views(dataset: Dataset, chain: RobotChain | None, progress: Progress) -> BoardViews:
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
    return BoardViews(tuple(v for v, _ in with_board), tuple(s for _, s in with_board), intrinsics, len(views))


def chain_ends(dataset: Dataset, chain: RobotChain | None, seen: BoardViews) -> tuple[list[Pose], list[Pose]]:
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


def add_depth(seen: BoardViews, poses: Sequence[Pose], settings: dict[str, Any], figures: dict[str, Any]) -> list[str]:
    """Calibrate the depth if the views have depth images; returns notes on failures."""
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
    seen: BoardViews,
    offsets: Sequence[np.ndarray],
    parts: dict[str, dict[str, Any]],
    figures: dict[str, Any],
    notes: list[str],
) -> CalibrationResult:
    """Return the result, with a note on the unused views."""
    errors = np.array([np.sqrt(np.mean(np.sum(offset**2, axis=1))) for offset in offsets])
    without = seen.recorded - len(seen.views) - len(seen.rejected)
    if seen.rejected:
        which = ", ".join(seen.rejected)
        notes = [*notes, f"left out because they contradict the other views: {which}; check pose and image"]
    if without:
        notes = [*notes, f"{without} of {seen.recorded} views do not show enough of the board"]
    return CalibrationResult(
        kind, dataset.config.robot, dataset.config.camera, seen.recorded, tuple(view.name for view in seen.views),
        errors, tuple(offsets), parts, figures, tuple(notes),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """``parts``: settings that override a robot's parts. ``figures``: standard deviations, covariance and offsets, for
    information.

    ``views``: names of the used views; ``errors``: root mean square reprojection error of each, pixels; ``offsets``:
    (N, 2) pixels, of each view's corners. ``notes``: omitted data and failed steps, as text.
    """

    kind: str
    robot: str | None
    camera: str
    recorded: int
    views: tuple[str, ...]
    errors: NDArray[np.float64]
    offsets: tuple[NDArray[np.float64], ...]
    parts: Mapping[str, Mapping[str, Any]]
    figures: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """Root mean square reprojection error of all corners, pixels."""
        squares = np.concatenate([np.sum(offset**2, axis=1) for offset in self.offsets])
        return float(np.sqrt(np.mean(squares)))

    def to_document(self) -> dict[str, Any]:
        """Return the result as plain values; equal results give equal text."""
        worst = int(np.argmax(self.errors))
        document: dict[str, Any] = {
            "kind": self.kind,
            "robot": self.robot,
            "camera": self.camera,
            "parts": self.parts,
            "views": {"recorded": self.recorded, "used": len(self.views)},
            "reprojection_px": {
                "rms": self.error,
                "worst": {self.views[worst]: float(self.errors[worst])},
                "per_view": dict(zip(self.views, self.errors.tolist(), strict=True)),
            },
            **self.figures,
        }
        if self.notes:
            document["notes"] = list(self.notes)
        return {key: _plain(value) for key, value in document.items() if value is not None}

    def write(self, path: Path) -> None:
        """Write the document as YAML."""
        text = yaml.safe_dump(
            self.to_document(), sort_keys=False, allow_unicode=True, default_flow_style=None, width=118
        )
        path.write_text(text, encoding="utf-8")


def deviations(covariance: NDArray[np.float64]) -> dict[str, list[float]]:
    """Return the standard deviations of a pose from its covariance (6, 6), m and rad: millimetres and degrees."""
    roots = np.sqrt(np.diag(covariance))
    return {"position_mm": (1e3 * roots[:3]).tolist(), "rotation_deg": np.degrees(roots[3:]).tolist()}


def _plain(value: Any) -> Any:
    """Return numbers rounded to seven digits, so that equal calibrations give equal files on all machines."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{float(value):.7g}")
    return value
