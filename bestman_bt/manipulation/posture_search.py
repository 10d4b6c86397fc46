"""Search for the postures of a new robot: ``home``, ``carry`` and ``carry_beside``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene
from bestman_bt.manipulation.collision.scene_from_world_model import hand_links
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics, link_hulls
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.messages import Cylinder, PlacedShape, Pose
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.robot_model.urdf_tree import joints_above

Array = NDArray[np.float64]


@dataclass(eq=False)
class PostureSearch:
    """Searches arm postures by inverse kinematics from random tool poses with the hand down; the caller passes the
    random generator.

    The cost of a posture is the radius around the base's axis that arm and hand need, their overhang beyond the base,
    the fraction of a table in front that they hide from the first camera, and, for ``home``, the distance from
    singularities and joint limits.

    Metres and radians.

    ``samples``: tool poses tried per posture, ``branches``: arm configurations requested at each. ``clearance``:
    distance kept between the links. ``home_reach``, ``home_height``: position of the tool relative to the shoulder, as
    fractions of the arm's reach. ``carry_box``, ``beside_box``: (x, y, z) half extents around their middle, as
    fractions of the reach, of the boxes for the tool; ``hidden_weight``: metres of radius that a completely hidden
    table counts for; ``table``: its corners in the base frame; ``held``: radius and length of the upright object that
    the hand holds by its upper third in carrying postures; ``tries``: number of the best postures for which a motion
    from home is planned, and ``motion_weight``: metres of radius per radian of its length; ``overhang_weight``: metres
    of radius per metre beyond the base's outline; ``travel_weight``: metres of radius per radian that the farthest
    joint is away from home.
    """

    robot: RobotModel
    arm: str = "arm"
    samples: int = 150
    branches: int = 4
    clearance: float = 0.012
    home_reach: float = 0.35
    home_height: float = 0.1
    carry_box: tuple[float, float, float] = (0.3, 0.3, 0.2)
    beside_box: tuple[float, float, float] = (0.15, 0.1, 0.15)
    hidden_weight: float = 1.0
    held: tuple[float, float] = (0.04, 0.15)
    tries: int = 20
    motion_weight: float = 0.05
    overhang_weight: float = 2.0
    travel_weight: float = 0.03
    table: tuple[tuple[float, float, float], ...] = (
        (0.45, -0.5, 0.75),
        (0.45, 0.5, 0.75),
        (1.3, 0.5, 0.75),
        (1.3, -0.5, 0.75),
    )
    picture_width: int = 160

    def __post_init__(self) -> None:
        robot, arm = self.robot, self.arm
        self._arm = robot.of(ArmModel)[arm]
        self._kinematics = DampedLeastSquares(robot, arm)
        self._forward = ForwardKinematics(robot)
        self._hands = {
            joint: position
            for gripper in robot.of(GripperModel).values()
            for joint, position in gripper.joint_positions(gripper.max_width).items()
        }
        moved = set(self._arm.joint_names)
        self._hulls = {link: hulls for link, hulls in link_hulls(robot).items() if moved & joints_above(robot, link)}
        scene = PlanningScene(positions=self._hands, self_padding=self.clearance)
        collision = CoalCollisionModel(robot)
        self._empty, self._holding = (collision.world(s, arm) for s in (scene, scene.holding(self._held(arm))))
        self._planner = RRTConnect(max_checks=5000, attempts=2)
        self._shoulder, self._reach = self._kinematics.reach

    def home(self, rng: np.random.Generator) -> Array:
        """Return a posture with the hand in front, pointing down, far from singularities and limits: (n,) joint
        positions.
        """
        x, y, z = self._shoulder
        tool = _looking_down(np.array([x + self.home_reach * self._reach, y, z + self.home_height * self._reach]), 0.0)

        def cost(q: Array) -> float:
            span = self._arm.upper - self._arm.lower
            to_limit = float(np.min(np.minimum(q - self._arm.lower, self._arm.upper - q) / span))
            turned = float(np.abs(q).sum()) / len(q)
            return 0.1 * turned - 3.0 * min(to_limit, 0.15) - 5.0 * self._kinematics.manipulability(q)

        return self._best(iter([tool] * 8), cost, rng, "home", self._empty)

    def carry(self, rng: np.random.Generator, home: Array, head: dict[str, float]) -> Array:
        """Return a posture (n,) with the hand above the base, pointing down with an object, within the smallest radius
        and outside the first camera's view.
        """
        middle = np.array([0.0, 0.0, self._shoulder[2] + 0.35 * self._reach])
        tools = self._around(middle, self.carry_box, rng)
        return self._best(tools, lambda q: self._cost(q, home, head), rng, "carry", self._holding, home)

    def carry_beside(self, rng: np.random.Generator, home: Array, head: dict[str, float]) -> Array:
        """Return a posture (n,) with the hand beside the base, pointing down, for large objects."""
        middle = self._shoulder + np.array([0.0, -0.38, 0.05]) * self._reach
        tools = self._around(middle, self.beside_box, rng)
        return self._best(tools, lambda q: self._cost(q, home, head), rng, "carry_beside", self._holding, home)

    def radius(self, positions: Array) -> float:
        """Return the radius of arm and hand around the base's axis, metres."""
        return max(float(np.hypot(points[:, 0], points[:, 1]).max()) for points in self._points(positions, {}))

    def stands_out(self, positions: Array) -> float:
        """Return the distance by which arm and hand extend beyond the outline of the robot's first base, metres; 0
        without a base.
        """
        base = next(iter(self.robot.of(BaseModel).values()), None)
        if base is None:
            return 0.0
        corners = np.array(base.footprint)
        sides = np.roll(corners, -1, axis=0) - corners
        normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
        limits = (normals * corners).sum(axis=1)
        beyond = (float((points[:, :2] @ normals.T - limits).max()) for points in self._points(positions, {}))
        return max(0.0, *beyond)

    def hidden(self, positions: Array, head: dict[str, float]) -> float:
        """Return the fraction of the table that arm and hand hide from the first camera; ``head``: positions of the
        joints that carry it.
        """
        camera = next(iter(self.robot.of(CameraPart).values()), None)
        if camera is None or set(self._arm.joint_names) & joints_above(self.robot, camera.optical_frame):
            return 0.0
        base_from_camera = self._forward.pose(camera.optical_frame, {**self._named(positions), **head})
        return self._covered(camera, base_from_camera, self._points(positions, head))

    def _cost(self, positions: Array, home: Array, head: dict[str, float]) -> float:
        travel = float(np.abs(positions - home).max())
        room = self.radius(positions) + self.overhang_weight * self.stands_out(positions)
        return room + self.hidden_weight * self.hidden(positions, head) + self.travel_weight * travel

    def _held(self, arm: str) -> AttachedObject:
        """Return a thing of usual size in the hand; what hangs below it is what a posture for an empty hand forgets."""
        radius, length = self.held
        along = Pose(np.array([0.0, 0.0, length / 6.0]))
        touched = frozenset(hand_links(self.robot, arm))
        return AttachedObject(
            "held", (PlacedShape(Cylinder(radius, length), Pose()),), self._arm.tool_frame, along, touched
        )

    def _best(
        self,
        tools: Iterator[Pose],
        cost: Callable[[Array], float],
        rng: np.random.Generator,
        name: str,
        world: CollisionWorld,
        home: Array | None = None,
    ) -> Array:
        """Return the free configuration of least ``cost``; with ``home``, one that a motion leads to from there."""
        middle = np.clip(0.0, self._arm.lower + 0.1, self._arm.upper - 0.1)
        free: list[tuple[float, Array]] = []
        for tool in tools:
            found = self._kinematics.solve(tool, middle, rng, count=self.branches, is_valid=world.is_free, attempts=20)
            for solution in found.solutions:
                positions = self._unwound(solution)
                if world.is_free(positions):
                    free.append((cost(positions), positions))
        free.sort(key=lambda found: found[0])
        if home is not None and free:
            free = self._reached(free[: self.tries], home, world, rng)
        if not free:
            why = "no free configuration" + (" that a motion from home leads to" if home is not None else "")
            raise ManipulationError(f"robot {self.robot.name!r}: {why} found for the posture {name!r}")
        return min(free, key=lambda found: found[0])[1]

    def _reached(
        self, postures: list[tuple[float, Array]], home: Array, world: CollisionWorld, rng: np.random.Generator
    ) -> list[tuple[float, Array]]:
        """Return the postures that can be reached from ``home``, with the length of the motion added to their cost."""
        reached = []
        for value, positions in postures:
            try:
                motion = self._planner.plan(home, [positions], world, self._arm, rng)
            except MotionPlanningError:
                continue
            reached.append((value + self.motion_weight * motion.length, positions))
        return reached

    def _unwound(self, positions: Array) -> Array:
        """Return positions with joints of more than one turn brought within half a turn of zero, if their limits allow
        it.
        """
        turned = (positions + np.pi) % (2 * np.pi) - np.pi
        return np.where((turned >= self._arm.lower) & (turned <= self._arm.upper), turned, positions)

    def _around(self, middle: Array, box: tuple[float, float, float], rng: np.random.Generator) -> Iterator[Pose]:
        for _ in range(self.samples):
            place = middle + rng.uniform(-1.0, 1.0, 3) * np.array(box) * self._reach
            yield _looking_down(place, rng.uniform(-np.pi, np.pi))

    def _named(self, positions: Array) -> dict[str, float]:
        return {**self._hands, **dict(zip(self._arm.joint_names, positions.tolist(), strict=True))}

    def _points(self, positions: Array, head: dict[str, float]) -> list[Array]:
        named = {**self._named(positions), **head}
        return [
            pose.apply(corners)
            for link, hulls in self._hulls.items()
            for pose in [self._forward.pose(link, named)]
            for corners in hulls
        ]

    def _covered(self, camera: CameraPart, base_from_camera: Pose, bodies: list[Array]) -> float:
        lens = camera.intrinsics
        scale = self.picture_width / lens.width
        shape = (round(lens.height * scale), round(lens.width * scale))
        table, robot = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
        for mask, bodies_in_it in ((table, [np.array(self.table)]), (robot, bodies)):
            for points in bodies_in_it:
                seen = base_from_camera.inverse().apply(points)
                seen = seen[seen[:, 2] > camera.near]
                if len(seen) >= 3:
                    x, y, z = seen.T
                    pixels = np.column_stack([lens.fx * x / z + lens.cx, lens.fy * y / z + lens.cy]) * scale
                    cv2.fillConvexPoly(mask, cv2.convexHull(pixels.clip(-1e4, 1e4).astype(np.int32)), 1)
        return float(robot[table > 0].mean()) if table.any() else 0.0


def _looking_down(position: Array, yaw: float) -> Pose:
    return Pose.from_xyz_rpy(position, (np.pi, 0.0, yaw))
