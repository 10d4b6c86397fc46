"""Calibration without hardware: a simulated robot moves camera and board, and saves the views as a dataset.

The simulated robot differs from its file: mounts, lens and depth have random errors. The calibration only gets the
file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.control.joint_state import JointStateSensor
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle
from bestman_bt.manipulation.collision.scene_from_world_model import hand_links
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D, RGBDImage
from bestman_bt.perception.calibration.boards import CalibrationError, CharucoBoard, project
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, GripperModel, JointGroupModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.runtime.calibration.board_link import PLATE, TILE, with_board
from bestman_bt.runtime.calibration.dataset import FILE, Progress
from bestman_bt.runtime.calibration.robot_chain import RobotChain
from bestman_bt.scene.scene import World
from hal.api import Arm, Camera, JointGroup, Motion, MotionStatus
from hal.pybullet.body_urdf import Color
from hal.simulation.robot import SimulatedRobot

ON_BASE = Pose.from_xyz_rpy((0.62, 0.0, 0.62), (0.0, math.radians(-25.0), 0.0)) @ Pose.from_xyz_rpy(
    (0.0, 0.0, 0.0), (math.pi, 0.0, math.pi / 2)
)
"""Middle of a board on the base, in the base frame: in front of the arm, leaning towards it, x to the right.

It is bolted to the base, not to the floor: while the arm swings, the base creeps by millimetres on its tyres.
"""
POST = PlacedShape(Box((0.04, 0.04, 0.5)), Pose.from_xyz_rpy((0.44, 0.0, 0.44), (0.0, math.radians(52.0), 0.0)))
"""The arm of the base that carries the board."""
GREY: Color = (0.4, 0.42, 0.45, 1.0)
IN_HAND = Pose.from_xyz_rpy((0.0, 0.0, 0.3), (0.0, 0.0, 0.0)) @ Pose.from_xyz_rpy((0, 0, 0), (0.0, math.pi / 2, 0.0))
"""Middle of a board bolted to the hand, in the hand's frame: beyond the fingers, along them."""
SPEED = SpeedScale(0.6, 0.4)
SETTLE = 0.4
TRIES = 60


def _plate_box(board: CharucoBoard, margin: float = 0.02) -> PlacedShape:
    """Return a box around the board, for collision checks."""
    width, height = board.size
    size = Box((width + 2 * margin, height + 2 * margin, PLATE + 2 * TILE))
    return PlacedShape(size, Pose(np.array([width / 2, height / 2, PLATE / 2])))


@dataclass(frozen=True)
class BoardPlacement:
    """A board on a link, the base or the hand; ``in_hand``: on the hand."""

    board: CharucoBoard
    holder: str
    holder_from_board: Pose
    in_hand: bool


@dataclass(frozen=True)
class Span:
    """Ranges of the board's pose in the camera: distances in metres, angles in radians.

    ``offset``: distance of the board's centre from the image's centre, as a fraction of half the image size.
    """

    nearest: float
    farthest: float
    lean: float
    roll: float
    offset: float


@dataclass(frozen=True)
class Views:
    """``count`` views of a board, drawn from ``seed``."""

    placement: BoardPlacement
    span: Span
    count: int
    seed: int


def record(
    file_robot: RobotModel,
    file: str,
    built_robot: RobotModel,
    camera: str,
    views: Views,
    folder: Path,
    progress: Progress,
) -> None:
    """Write a dataset of ``views`` into ``folder``. Raises CalibrationError if the arm reaches too few of them.

    ``file_robot``, read from ``file``, plans the motions; ``built_robot`` executes and records them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([views.seed, 7])
    world = World("calibration", 0, (), (), (), Pose2D(), {})
    placement = views.placement
    post = PlacedShape(POST.shape, placement.holder_from_board.inverse() @ POST.pose)
    carrier = () if placement.in_hand else ((post, GREY),)
    drawn = with_board(built_robot, placement.board, placement.holder, placement.holder_from_board, carrier)
    simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
    # Not folded, as it drives: a board in the hand would touch the arm.
    upright = simulated.parameters_class(initial_postures=("home", "carry"))
    robot = simulated(drawn, world, seed=views.seed, parameters=upright)
    entries: list[dict[str, Any]] = []
    with robot:
        recorder = _Recorder(robot, file_robot, camera, views.placement, views.span, rng)
        joints = JointStateSensor(robot.parts, file_robot)
        for index, _ in zip(range(views.count), recorder.visit(), strict=False):
            progress("recording views", index, views.count)
            image = robot.part(camera, Camera).capture()
            entries.append(_save(image, f"view_{index:03d}", folder))
            entries[-1]["joints"] = {name: round(float(value), 7) for name, value in joints.positions().items()}
    progress("recording views", views.count, views.count)
    if len(entries) < views.count:
        raise CalibrationError(f"the arm reached {len(entries)} of {views.count} views of the board")
    document = {
        "robot": str(Path(file).resolve()) if Path(file).suffix else file,
        "camera": camera,
        "board": _written_board(views.placement.board),
        "board_on": views.placement.holder,
        "views": entries,
    }
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=118)
    (folder / FILE).write_text(text, encoding="utf-8")


class _Recorder:
    """Moves the robot from view to view."""

    def __init__(
        self,
        robot: SimulatedRobot,
        model: RobotModel,
        camera: str,
        placement: BoardPlacement,
        span: Span,
        rng: np.random.Generator,
    ) -> None:
        self._robot, self._model, self._placement, self._span, self._rng = robot, model, placement, span, rng
        self._chain = RobotChain(model, camera)
        self._arm_name = next(iter(model.of(ArmModel)))
        self._arm = robot.part(self._arm_name, Arm)
        self._kinematics = DampedLeastSquares(model, self._arm_name)
        self._collision = CoalCollisionModel(model)
        self._planner = TimedMotionPlanner(RRTConnect(), Toppra())
        self._forward = ForwardKinematics(model)
        self._joints = JointStateSensor(robot.parts, model)
        self._head = robot.part(self._chain.head, JointGroup) if self._chain.head is not None else None

    def visit(self) -> Iterator[None]:
        """Move from view to view and come to rest at each; ends when no further view is reachable."""
        while True:
            for _ in range(TRIES):
                if self._go():
                    break
            else:
                return
            self._robot.clock.sleep(SETTLE)
            yield

    def _go(self) -> bool:
        """Try one random view; return whether the robot has reached it."""
        if self._head is not None:
            limits, rng = self._head.model, self._rng
            wanted = np.array([rng.uniform(-0.5, 0.5), rng.uniform(0.4, 1.05)])
            wanted = np.clip(wanted, limits.lower, limits.upper)
            self._finish(self._head.move_to(wanted, 0.8))
        target = self._tool_target()
        world = self._collision.world(self._scene(), self._arm_name)
        start = self._arm.positions()
        solutions = self._kinematics.solve(target, start, self._rng, 1, world.is_free, attempts=12).solutions
        if not solutions:
            return False
        limits_of_arm = self._model.of(ArmModel)[self._arm_name]
        try:
            timed = self._planner.plan(start, solutions, world, limits_of_arm, self._rng, SPEED)
        except MotionPlanningError:
            return False
        return self._finish(self._arm.follow(timed.trajectory))

    def _finish(self, motion: Motion[None]) -> bool:
        while not motion.done:
            self._robot.clock.sleep(0.05)
        return motion.status is MotionStatus.SUCCEEDED

    def _tool_target(self) -> Pose:
        """Return base_from_tool from which the camera sees the board in a randomly drawn pose."""
        placement, positions = self._placement, self._joints.positions()
        tool = self._model.of(ArmModel)[self._arm_name].tool_frame
        middle = Pose(np.array([*(np.array(placement.board.size) / 2), 0.0]))
        eye_from_board = self._drawn() @ middle.inverse()
        if not placement.in_hand:
            base_from_holder = self._forward.pose(placement.holder, positions)
            base_from_eye = base_from_holder @ placement.holder_from_board @ eye_from_board.inverse()
            return base_from_eye @ self._forward.pose(tool, positions, self._chain.optical_frame)
        base_from_eye = self._forward.pose(self._chain.optical_frame, positions)
        base_from_holder = base_from_eye @ eye_from_board @ placement.holder_from_board.inverse()
        return base_from_holder @ self._forward.pose(tool, positions, placement.holder)

    def _drawn(self) -> Pose:
        """Return the middle of the board in the camera."""
        span, rng, k = self._span, self._rng, self._chain.intrinsics
        distance = rng.uniform(span.nearest, span.farthest)
        half = np.array([k.width / 2 / k.fx, k.height / 2 / k.fy])
        across = rng.uniform(-span.offset, span.offset, 2) * half * distance
        lean = span.lean * math.sqrt(rng.uniform())
        about = rng.uniform(0.0, 2.0 * math.pi)
        # A turn by ``lean`` about an axis in the board's plane, then about the line of sight.
        axis = np.array([math.cos(about), math.sin(about), 0.0]) * math.sin(lean / 2)
        leaning = Pose(np.zeros(3), np.append(axis, math.cos(lean / 2)))
        rolled = Pose.from_xyz_rpy((*across, distance), (0.0, 0.0, rng.uniform(-span.roll, span.roll)))
        return rolled @ leaning

    def _scene(self) -> PlanningScene:
        placement = self._placement
        floor = SceneObstacle("floor", (PlacedShape(Box((6.0, 6.0, 0.1)), Pose(np.array([0.0, 0.0, -0.05]))),))
        scene = PlanningScene(self._joints.positions(), (floor,), padding=0.005)
        box = _plate_box(placement.board)
        if not placement.in_hand:
            shapes = (POST, PlacedShape(box.shape, placement.holder_from_board @ box.pose))
            return scene.adding(SceneObstacle("board", shapes, padding=0.03))
        arm = self._model.of(ArmModel)[self._arm_name]
        tool_from_holder = self._forward.pose(placement.holder, self._joints.positions(), arm.tool_frame)
        attached = AttachedObject(
            "board",
            (box,),
            arm.tool_frame,
            tool_from_holder @ placement.holder_from_board,
            frozenset(hand_links(self._model, self._arm_name)),
            padding=0.01,
        )
        return scene.holding(attached)


def on_base(board: CharucoBoard, robot: RobotModel) -> BoardPlacement:
    """Return a board that is mounted on the base in front of the arm."""
    return BoardPlacement(board, robot.base_frame, ON_BASE @ _from_middle(board), in_hand=False)


def in_hand(board: CharucoBoard, robot: RobotModel) -> BoardPlacement:
    """Return a board bolted to the hand."""
    hand = next(iter(robot.of(GripperModel).values())).hand_link
    return BoardPlacement(board, hand, IN_HAND @ _from_middle(board), in_hand=True)


def _from_middle(board: CharucoBoard) -> Pose:
    return Pose(np.array([*(-np.array(board.size) / 2), 0.0]))


def _save(image: RGBDImage, name: str, folder: Path) -> dict[str, Any]:
    bgr: NDArray[np.uint8] = np.ascontiguousarray(image.rgb[..., ::-1])
    cv2.imwrite(str(folder / f"{name}.png"), bgr)
    steps = np.clip(np.rint(image.depth * 1000.0), 0, 65535).astype(np.uint16)
    cv2.imwrite(str(folder / f"{name}_depth.png"), steps)
    return {"image": f"{name}.png", "depth": f"{name}_depth.png"}


def _written_board(board: CharucoBoard) -> dict[str, Any]:
    fields = {"columns": board.columns, "rows": board.rows, "square": board.square, "marker": board.marker}
    return {"kind": "charuco", **fields, "dictionary": board.dictionary}


Kind = Literal["intrinsics", "hand-eye", "head"]
SMALL_BOARD = CharucoBoard(7, 5, 0.04, 0.03)
LARGE_BOARD = CharucoBoard(7, 5, 0.05, 0.0375)
POSITION_ERROR, ROTATION_ERROR = 0.006, math.radians(1.5)
"""Standard deviations, per axis, of how parts are mounted: metres, radians."""


@dataclass(frozen=True)
class Simulated:
    """A simulated recording. ``robot``: its name; ``camera``: the calibrated one; ``built``: the simulated robot."""

    robot: str
    settings: Mapping[str, Any]
    camera: str
    built: RobotModel


def simulate(
    kind: Kind,
    robot: str,
    settings: Mapping[str, Any],
    camera: str | None,
    views: int,
    seed: int,
    folder: Path,
    progress: Progress,
) -> Simulated:
    """Record a dataset into ``folder``. Raises ConfigurationError or CalibrationError."""
    model = load_robot_model(robot, settings)
    chain = RobotChain(model, camera or _first_camera(kind, model))
    if not model.of(ArmModel):
        raise ConfigurationError([Problem("--simulate", None, "", f"robot {model.name!r} has no arm to record with")])
    if chain.head is None and (kind == "head" or chain.arm is None):
        message = f"no joint of robot {model.name!r} moves camera {chain.camera!r}"
        raise ConfigurationError([Problem("--simulate", None, "", message)])
    built = load_robot_model(robot, {**settings, **_as_built(kind, chain, np.random.default_rng([seed, 3]))})
    carried = chain.arm is not None
    placement = on_base(SMALL_BOARD, model) if carried else in_hand(LARGE_BOARD, model)
    asked = Views(placement, _span(kind, carried), views, seed)
    record(model, robot, built, chain.camera, asked, folder, progress)
    return Simulated(robot, settings, chain.camera, built)


def compare(kind: Kind, simulated: Simulated, calibration: Path) -> dict[str, float]:
    """Return the errors of this calibration, and of the robot's own file, with respect to the simulated robot."""
    settings = simulated.settings
    found = load_robot_model(simulated.robot, {**settings, "calibration": [str(calibration)]})
    before = load_robot_model(simulated.robot, settings)
    built = simulated.built
    if kind == "intrinsics":
        return {
            **{f"{key}_before": value for key, value in _lens_error(before, built, simulated.camera).items()},
            **_lens_error(found, built, simulated.camera),
        }
    return {
        **{f"{key}_before": value for key, value in _pose_error(before, built, simulated.camera).items()},
        **_pose_error(found, built, simulated.camera),
        **_depth_error(found, built, simulated.camera),
    }


def _first_camera(kind: Kind, model: RobotModel) -> str:
    chains = {name: RobotChain(model, name) for name in model.of(CameraPart)}
    if kind != "head":
        on_arm = next((name for name, chain in chains.items() if chain.arm is not None), None)
        if on_arm is not None or kind == "hand-eye":
            return _there(on_arm, kind, model)
    return _there(next((name for name, chain in chains.items() if chain.head is not None), None), kind, model)


def _there(camera: str | None, kind: Kind, model: RobotModel) -> str:
    if camera is not None:
        return camera
    what = {"intrinsics": " that moves", "head": " on a pan-tilt", "hand-eye": " on an arm"}[kind]
    raise ConfigurationError([Problem("--simulate", None, "", f"robot {model.name!r} has no camera{what}")])


def _span(kind: Kind, carried: bool) -> Span:
    if carried and kind == "intrinsics":
        return Span(0.25, 0.6, math.radians(50.0), math.radians(90.0), 0.85)
    if carried:
        return Span(0.28, 0.62, math.radians(40.0), math.radians(70.0), 0.35)
    if kind == "intrinsics":
        return Span(0.55, 0.9, math.radians(45.0), math.radians(60.0), 0.8)
    return Span(0.55, 0.9, math.radians(35.0), math.radians(40.0), 0.5)


def _as_built(kind: Kind, chain: RobotChain, rng: np.random.Generator) -> dict[str, Any]:
    """Return settings with random errors of mounts, lens and depth: the robot as built."""
    camera = f"parts.{chain.camera}"
    settings: dict[str, Any] = {
        f"{camera}.set.depth_scale": float(1.0 + 0.01 * rng.uniform(-1, 1)),
        f"{camera}.set.depth_offset": float(0.004 * rng.uniform(-1, 1)),
    }
    if kind == "intrinsics":
        k = chain.intrinsics
        settings[f"{camera}.set.focal_length"] = (np.array([k.fx, k.fy]) + rng.uniform(-8, 8, 2)).tolist()
        settings[f"{camera}.set.principal_point"] = (np.array([k.cx, k.cy]) + rng.uniform(-6, 6, 2)).tolist()
        lens = rng.uniform([-0.2, 0.02, -0.001, -0.001], [-0.1, 0.05, 0.001, 0.001])
        settings[f"{camera}.set.distortion"] = [*lens.tolist(), 0.0]
        return settings
    mounts = {chain.camera: chain.camera_mount(_shaken(chain.carrier_from_camera(), rng))}
    if chain.head is not None:
        base_from_head = chain.kinematics.pose(chain.head_root(chain.head), {})
        mounts[chain.head] = chain.head_mount(chain.head, _shaken(base_from_head, rng))
    for part, mount in mounts.items():
        settings |= {f"parts.{part}.{field}": value for field, value in mount.items()}
    return settings


def _shaken(pose: Pose, rng: np.random.Generator) -> Pose:
    turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), rng.normal(0.0, ROTATION_ERROR, 3))
    return Pose(pose.position + rng.normal(0.0, POSITION_ERROR, 3), (pose @ turn).quaternion)


def _pose_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the pose error of the camera in the base, over nine postures of its head; for an arm, of the camera on its
    carrier.
    """
    chains = RobotChain(found, camera), RobotChain(built, camera)
    head = chains[0].head
    if head is None:
        pairs = [(chains[0].carrier_from_camera(), chains[1].carrier_from_camera())]
    else:
        joints = found.of(JointGroupModel)[head].joint_names
        postures = [dict(zip(joints, (pan, tilt), strict=True)) for pan in (-0.4, 0, 0.4) for tilt in (0.4, 0.7, 1)]
        pairs = [
            (
                chains[0].kinematics.pose(chains[0].optical_frame, p),
                chains[1].kinematics.pose(chains[1].optical_frame, p),
            )
            for p in postures
        ]
    return {
        "position_mm": max(1e3 * float(np.linalg.norm(a.position - b.position)) for a, b in pairs),
        "rotation_deg": max(
            math.degrees(2 * math.asin(min(1.0, float(np.linalg.norm((a.inverse() @ b).quaternion[:3])))))
            for a, b in pairs
        ),
    }


def _lens_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the root mean square and largest pixel error over the image of the built camera, up to a camera
    rotation.
    """
    true, k = built.of(CameraPart)[camera].intrinsics, found.of(CameraPart)[camera].intrinsics
    x, y = np.meshgrid(np.linspace(-0.62, 0.62, 15), np.linspace(-0.46, 0.46, 11))
    wall = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    seen = project(wall, Pose(), true)
    inside = ((seen >= 0) & (seen <= (true.width - 1, true.height - 1))).all(axis=1)
    difference = (project(wall, Pose(), k) - seen)[inside]
    lengths = np.linalg.norm(difference - difference.mean(axis=0), axis=1)
    return {
        "pixels_rms": float(np.sqrt(np.mean(lengths**2))),
        "pixels_max": float(lengths.max()),
        "focal_length_px": max(abs(k.fx - true.fx), abs(k.fy - true.fy)),
        "principal_point_px": max(abs(k.cx - true.cx), abs(k.cy - true.cy)),
    }


def _depth_error(found: RobotModel, built: RobotModel, camera: str) -> dict[str, float]:
    """Return the error of the corrected depth between 0.3 and 1 m, millimetres."""
    z = np.linspace(0.3, 1.0, 8)
    a, b = found.of(CameraPart)[camera], built.of(CameraPart)[camera]
    corrected = (b.depth_scale * z + b.depth_offset - a.depth_offset) / a.depth_scale
    return {"depth_mm": 1e3 * float(np.abs(corrected - z).max())}
