"""The skills' environment: controllers, sensors, algorithms and beliefs of one robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from behaviours.computation import Computation, TimeSource
from behaviours.contacts import Contact
from behaviours.failure import NodeFailure
from behaviours.parameters import SkillParameters
from behaviours.parts import WORDS
from bestman_bt.errors import RobotError
from bestman_bt.messages import Failure, MotionErrorCode, MotionObstacle, MotionStage, Pose
from bestman_bt.world_model.world_model import HeldObject, WorldModel

if TYPE_CHECKING:
    from bestman_bt.control.arm.arm_controller import ArmController
    from bestman_bt.control.gripper import GripperController
    from bestman_bt.control.head import HeadController
    from bestman_bt.control.joint_state import JointStateSensor
    from bestman_bt.control.rgbd import RGBDSensor
    from bestman_bt.control.robot_stop import RobotStop
    from bestman_bt.control.touch import TactileSensor, WristWrench
    from bestman_bt.control.wheeled.base_controller import BaseController
    from bestman_bt.manipulation.base_placement import BasePlacementPlanner, PathPlacementPlanner, ReachingArm
    from bestman_bt.manipulation.collision.base import CollisionModel, CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import PlanningScene
    from bestman_bt.manipulation.kinematics.base import InverseKinematics
    from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies, LinkBodies
    from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap
    from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
    from bestman_bt.manipulation.policy.base import Policy
    from bestman_bt.navigation.global_planning.base import GlobalPlanner
    from bestman_bt.navigation.global_planning.costmap import Costmap, CostmapBuilder
    from bestman_bt.navigation.global_planning.footprint import Footprint
    from bestman_bt.navigation.local_planning.base import PathFollower
    from bestman_bt.navigation.localization.base import GlobalLocalizer, Localizer
    from bestman_bt.navigation.localization.ekf import OdometryFilter
    from bestman_bt.navigation.slam.base import Slam
    from bestman_bt.navigation.slam.frontiers import ExplorationPlanner
    from bestman_bt.perception.affordance.front_handles import HandleDetector
    from bestman_bt.perception.detection.base import Detector
    from bestman_bt.perception.grasp_pose.base import GraspPlanner
    from bestman_bt.perception.occupancy import OccupancyMapper
    from bestman_bt.perception.pose_estimation.multi_view import MultiViewEstimator, ViewObservation
    from bestman_bt.perception.segmentation.support_surfaces import SurfaceDetector
    from bestman_bt.perception.tracking import Tracker
    from bestman_bt.perception.view_planning import ViewPlanner
    from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel

SWAY = 0.01
"""Metres by which an arm and its load may deviate from the encoder positions while the base drives."""
PLACED = 0.01
"""Allowance for the position error after localising the base, metres."""
STRUCK = frozenset(
    (
        MotionErrorCode.TRACKING,
        MotionErrorCode.BLOCKED,
        MotionErrorCode.GUARDED,
        MotionErrorCode.TIMEOUT,
        MotionErrorCode.COLLISION,
        MotionErrorCode.FAULT,
    )
)
"""Error codes of motions that an obstacle may have blocked."""
DRIVEN = "carry"
"""The posture of the arm while driving to a base placement, for choosing it in advance."""


@dataclass(eq=False, repr=False)
class SkillContext:
    """Everything that a skill may use; controllers, sensors and algorithms are created on first use.

    ``kinds``: kind → names of the robot's parts. ``base``, ``arm``, ``gripper``, ``head`` and ``camera`` raise
    MissingPartError if the robot has none: skills declare the ones that they need in ``REQUIRES``. ``stop``: the stop
    of the whole robot, for leaves that recover from it. ``camera``: the first one not mounted on an arm, else the one
    on the hand. ``wrist_camera``: on the hand, if any; ``tactile``: pads of the fingers, may be empty.
    ``wrist_wrench``: contact forces on the hand, if there is a sensor. ``detection`` and the following attributes are
    the configured algorithms, by their slots. ``make_accessor``: maps an attribute name and an arm to the object; the
    same object each time. ``arm_name``: the arm of ``arm``, ``gripper``, hand sensors, kinematics and held object;
    empty without an arm. ``for_arm`` returns the context of another arm. ``sensors``: all sensors of the robot by name,
    for your own kinds. ``observations``: recent observations of objects, by identity, in the map frame. ``contacts``:
    the currently declared contacts. ``handled``: the object that the fingers touched last. ``costs``: computation times
    on the robot's computer, seconds by name. ``failures``: failures reported by leaves, oldest first. ``parameters``:
    the configured parameters of the skills. ``policies``: name or file → learned policy. ``planners``, ``followers``:
    name → global and local planner, None for a name of Nav2 that means the configured one; they raise LookupError. All
    three also take the folders that paths are relative to: ``Node.folders``.
    """

    clock: TimeSource
    robot: RobotModel
    kinds: Mapping[str, tuple[str, ...]]
    make_accessor: Callable[[str, str], Any]
    world: WorldModel
    stop: RobotStop
    computation: Computation
    costs: Mapping[str, float]
    rng: np.random.Generator
    planners: Callable[[str, tuple[Path, ...]], GlobalPlanner | None]
    followers: Callable[[str, tuple[Path, ...]], PathFollower | None]
    policies: Callable[[str, tuple[Path, ...]], Policy]
    arm_name: str = ""
    parameters: SkillParameters = field(default_factory=SkillParameters)
    sensors: Mapping[str, Any] = field(default_factory=dict)
    failures: list[NodeFailure] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    handled: str | None = None
    observations: dict[str, list[ViewObservation]] = field(default_factory=dict)
    _for_arms: dict[str, SkillContext] = field(default_factory=dict)

    base: BaseController = field(init=False)
    arm: ArmController = field(init=False)
    gripper: GripperController = field(init=False)
    head: HeadController = field(init=False)
    camera: RGBDSensor = field(init=False)
    wrist_camera: RGBDSensor | None = field(init=False)
    tactile: Sequence[TactileSensor] = field(init=False)
    joints: JointStateSensor = field(init=False)
    wrist_wrench: WristWrench | None = field(init=False)

    detection: Detector = field(init=False)
    multi_view: MultiViewEstimator = field(init=False)
    tracking: Tracker = field(init=False)
    view_planning: ViewPlanner = field(init=False)
    surfaces: SurfaceDetector = field(init=False)
    affordance: HandleDetector = field(init=False)
    occupancy: OccupancyMapper = field(init=False)
    grasp_pose: GraspPlanner = field(init=False)
    unknown_grasp_pose: GraspPlanner = field(init=False)
    handle_grasp_pose: GraspPlanner = field(init=False)
    kinematics: InverseKinematics = field(init=False)
    base_placement: BasePlacementPlanner = field(init=False)
    path_placement: PathPlacementPlanner = field(init=False)
    collision: CollisionModel = field(init=False)
    motion_planning: TimedMotionPlanner = field(init=False)
    costmap: CostmapBuilder = field(init=False)
    global_planning: GlobalPlanner = field(init=False)
    local_planning: PathFollower = field(init=False)
    localization: Localizer = field(init=False)
    odometry: OdometryFilter = field(init=False)
    slam: Slam = field(init=False)
    exploration: ExplorationPlanner = field(init=False)
    global_localization: GlobalLocalizer = field(init=False)

    def __post_init__(self) -> None:
        self._for_arms[self.arm_name] = self

    def for_arm(self, name: str = "") -> SkillContext:
        """Return the context of an arm; an empty name means the only arm or the robot's default one.

        Base, head, cameras, beliefs and algorithms are shared. Raises KeyError listing the arms.
        """
        if self.arm_name and name in ("", self.arm_name):
            return self
        if not name and len(self.robot.arm_names) < 2:
            return self
        arm = self.robot.arm_named(name)
        if arm not in self._for_arms:
            replace(self, arm_name=arm, handled=None)
        return self._for_arms[arm]

    def has(self, kind: str) -> bool:
        """Return whether the robot has a part of a kind; for a gripper, whether the arm carries one."""
        if kind == "gripper" and self.arm_name:
            return self.robot.gripper_of(self.arm_name) in self.kinds.get("gripper", ())
        return kind in self.kinds

    def make(self, kinds: Iterable[str]) -> None:
        """Create the existing controllers and sensors of these kinds now instead of during a tick."""
        accessors = {"lidar": "base", "force_torque": "wrist_wrench"}
        for kind in kinds:
            if kind in WORDS and self.has(kind):
                getattr(self, accessors.get(kind, kind))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if not any(one.name == name and not one.init for one in fields(self)):
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            made = self.make_accessor(name, self.arm_name)
            setattr(self, name, made)
            return made

    @property
    def held(self) -> HeldObject | None:
        """The object held by the arm's hand according to the belief, or None."""
        return self.world.hands.get(self.arm_name)

    @held.setter
    def held(self, held: HeldObject | None) -> None:
        self.world.hands.pop(self.arm_name, None)
        if held is not None:
            self.world.hands[self.arm_name] = held
            self.arm.carry(held.model.mass, held.tool_from_object.position)
        elif self.has("arm"):
            self.arm.carry(0.0, (0.0, 0.0, 0.0))

    @property
    def cameras(self) -> tuple[RGBDSensor, ...]:
        """The default ``camera`` and the cameras on the hands, if any."""
        named = {self.camera.name: self.camera} if self.has("camera") else {}
        for arm in self.robot.arm_names:
            on_hand = self.for_arm(arm).wrist_camera
            if on_hand is not None:
                named.setdefault(on_hand.name, on_hand)
        return tuple(named.values())

    @property
    def arm_model(self) -> ArmModel:
        """The model of the arm."""
        from bestman_bt.robot_model.model import ArmModel

        return self.robot.of(ArmModel)[self.arm.name]

    @property
    def gripper_model(self) -> GripperModel:
        """The model of the gripper."""
        from bestman_bt.robot_model.model import GripperModel

        return self.robot.of(GripperModel)[self.gripper.name]

    @property
    def map_from_base(self) -> Pose:
        """The believed pose of the base in the map frame."""
        return self.world.base.pose.to_pose()

    def arm_positions(self) -> NDArray[np.float64]:
        """Return the measured joint positions of the arm, (n,) radians."""
        positions = self.joints.positions()
        return np.array([positions[name] for name in self.arm_model.joint_names])

    def reaching_arm(self, reachability: ReachabilityMap | None = None) -> ReachingArm:
        """Return the current arm, for a search of base placements."""
        from bestman_bt.manipulation.base_placement import ReachingArm

        return ReachingArm(self.kinematics, self.arm_model, self.arm_positions(), self.rng, reachability)

    def base_from_tool(self) -> Pose:
        """Return the pose of the tool in the base frame, from encoders."""
        return self.kinematics.tool_pose(self.arm_positions())

    def planning_scene(
        self, ignore: Iterable[str] = (), allowed_pairs: Iterable[tuple[str, str]] = ()
    ) -> PlanningScene:
        """Return the planning scene around the arm, from beliefs and encoders; moving arms are placed at their
        targets.
        """
        from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model

        return planning_scene_from_world_model(
            self.world, self.robot, self.arm.for_planning(self.joints.positions()), self.arm.name, ignore
        ).allowing(*allowed_pairs)

    def met(self, failure: Failure) -> MotionObstacle | None:
        """Return the obstacle of a failed motion; if an arm or a hand reports none, the nearest bodies."""
        arm = next((a for a in self.robot.arm_names if failure.part in (a, self.robot.gripper_of(a))), None)
        known = failure.obstacle
        if arm is None or failure.code not in STRUCK or (known is not None and known.pairs):
            return known
        skills = self.for_arm(arm)
        try:
            at = skills.arm_positions()
            pair = skills.arm_world(skills.planning_scene()).nearest_pair(at)
        except RobotError:  # its joints cannot be read
            return known
        positions = dict(zip(skills.arm_model.joint_names, at.tolist(), strict=True))
        met = known or MotionObstacle(MotionStage.EXECUTION, positions=positions)
        return met if pair is None else replace(met, pairs=(pair,))

    def footprint(self, posture: str | None = None) -> Footprint:
        """Return the outline of the base, including arm and held object where they extend beyond it.

        ``posture``: planned posture of the arm; only the base counts if the robot has no posture of this name. The
        default is the current arm.
        """
        from bestman_bt.navigation.global_planning.footprint import Footprint

        base, positions = Footprint.of(self.base.model), self.joints.positions()
        if posture is not None:
            if not self.has("arm") or posture not in self.robot.postures:
                return base
            tucked = self.robot.postures[posture]
            moved = self.arm_model.joint_names
            positions = {**positions, **{joint: tucked[joint] for joint in moved if joint in tucked}}
        arms = [
            body for arm, of_arm in self._arm_bodies.items() for body in of_arm.at(positions, self.world.hands.get(arm))
        ]
        base = base.carrying(arms, SWAY)
        if not self.has("lidar"):
            return base
        return base.reaching_above(self.base.lidar.height, [*self._bodies.at(positions), *arms], SWAY + PLACED)

    def known_costmap(self, posture: str | None = None) -> Costmap:
        """Return the costmap of walls, furniture, and open doors and drawers.

        ``posture``: as for ``footprint``.
        """
        return self.costmap.of_world(self.world, self.footprint(posture))

    def seen_costmap(self, posture: str | None = None) -> Costmap:
        """Return ``known_costmap`` with the obstacles that the lidar sees but the map lacks."""
        costmap = self.known_costmap(posture)
        return self.base.layer.on(costmap) if self.costmap.obstacle else costmap

    @cached_property
    def _bodies(self) -> LinkBodies:
        from bestman_bt.manipulation.kinematics.link_hulls import LinkBodies

        return LinkBodies(self.robot)

    @cached_property
    def _arm_bodies(self) -> dict[str, ArmBodies]:
        from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies

        return {arm: ArmBodies(self.robot, arm) for arm in self.robot.arm_names}

    def arm_world(self, scene: PlanningScene) -> CollisionWorld:
        """Return the collision world of the arm in ``scene``."""
        return self.collision.world(scene, self.arm.name)
