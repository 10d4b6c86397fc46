"""What skills work with: controllers, sensors, algorithms and beliefs of one robot."""

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
from behaviours.parts import PartKind
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
    from bestman_bt.manipulation.collision.base import CollisionModel, CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import PlanningScene
    from bestman_bt.manipulation.kinematics.base import InverseKinematics
    from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies
    from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap
    from bestman_bt.manipulation.kinematics.stand_pose import ReachingArm
    from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
    from bestman_bt.manipulation.policy.base import Policy
    from bestman_bt.navigation.global_planning.base import GlobalPlanner
    from bestman_bt.navigation.global_planning.costmap import Costmap
    from bestman_bt.navigation.global_planning.footprint import Footprint
    from bestman_bt.navigation.global_planning.layered_costmap import LayeredCostmap
    from bestman_bt.navigation.local_planning.base import PathFollower
    from bestman_bt.navigation.localization.base import GlobalLocalizer, Localizer
    from bestman_bt.navigation.localization.ekf import OdometryFilter
    from bestman_bt.navigation.slam.base import Slam
    from bestman_bt.navigation.slam.frontiers import FrontierExplorer
    from bestman_bt.perception.affordance.front_handles import HandleDetector
    from bestman_bt.perception.detection.base import Detector
    from bestman_bt.perception.grasp_pose.base import GraspPlanner
    from bestman_bt.perception.occupancy import OccupancyMapper
    from bestman_bt.perception.pose_estimation.multi_view import MultiView, ViewObservation
    from bestman_bt.perception.segmentation.support_surfaces import SupportSurfaces
    from bestman_bt.perception.tracking import Tracker
    from bestman_bt.perception.view_planning import ViewPlanner
    from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel

SWAY = 0.01
"""Metres that an arm and what it holds may be beside where its encoders say while the base drives."""
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
"""Codes of motions that something may have held up."""
DRIVEN = "carry"
"""The posture in which trees have the arm driven to a stand, for whoever chooses one before."""


@dataclass(eq=False, repr=False)
class SkillContext:
    """Everything that a skill may use; controllers, sensors and algorithms are made when they are first asked for.

    ``kinds``: what the robot has, kind → names of its parts. ``base``, ``arm``, ``gripper``, ``head`` and ``camera``
    raise MissingPartError where it has none: skills declare in ``REQUIRES`` which of them they use.
    ``stop``: the one over all parts, for leaves that go on after it.
    ``camera``: the first that no arm carries, else the one on the hand. ``wrist_camera``: on the hand, where there is
    one; ``tactile``: pads of the fingers, which may be none. ``wrist_wrench``: what touches the hand, where there is a
    sensor. ``detection`` and what follows it are the algorithms that the configuration chose, by their slots.
    ``make_accessor``: from the name of one of these attributes, and of an arm, to what it is; the same each time.
    ``arm_name``: the arm whose ``arm``, ``gripper``, sensors of the hand, kinematics and held object these are; empty
    without an arm. ``for_arm`` gives the context of another one.
    ``sensors``: all of the robot by name, as its driver gives them; for kinds of your own.
    ``observations``: what was seen of objects lately, by identity, in the map frame.
    ``contacts``: those that skills declare now. ``handled``: the object that the fingers have touched last.
    ``costs``: what a computation takes on the robot's computer, seconds by name. ``failures``: what leaves told,
    oldest first. ``policies``: from the name or file of a learned policy to it. ``planners``, ``followers``: from the
    name of a global and of a local planner to it, None for a name of Nav2's that means the configured one; they raise
    LookupError. All three take the folders from which paths
    are counted, too: ``Node.folders``.
    """

    clock: TimeSource
    robot: RobotModel
    kinds: Mapping[PartKind, tuple[str, ...]]
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
    multi_view: MultiView = field(init=False)
    tracking: Tracker = field(init=False)
    view_planning: ViewPlanner = field(init=False)
    surfaces: SupportSurfaces = field(init=False)
    affordance: HandleDetector = field(init=False)
    occupancy: OccupancyMapper = field(init=False)
    grasp_pose: GraspPlanner = field(init=False)
    unknown_grasp_pose: GraspPlanner = field(init=False)
    handle_grasp_pose: GraspPlanner = field(init=False)
    kinematics: InverseKinematics = field(init=False)
    collision: CollisionModel = field(init=False)
    motion_planning: TimedMotionPlanner = field(init=False)
    costmap: LayeredCostmap = field(init=False)
    global_planning: GlobalPlanner = field(init=False)
    local_planning: PathFollower = field(init=False)
    localization: Localizer = field(init=False)
    odometry: OdometryFilter = field(init=False)
    slam: Slam = field(init=False)
    exploration: FrontierExplorer = field(init=False)
    global_localization: GlobalLocalizer = field(init=False)

    def __post_init__(self) -> None:
        self._for_arms[self.arm_name] = self

    def for_arm(self, name: str = "") -> SkillContext:
        """What skills work with who use this arm; of an empty name the only arm or the robot's default one.

        Base, head, cameras, beliefs and algorithms are the same for all. KeyError names the arms that there are.
        """
        if self.arm_name and name in ("", self.arm_name):
            return self
        if not name and len(self.robot.arm_names) < 2:
            return self
        arm = self.robot.arm_named(name)
        if arm not in self._for_arms:
            replace(self, arm_name=arm, handled=None)
        return self._for_arms[arm]

    def has(self, kind: PartKind) -> bool:
        """Whether the robot has a part of a kind; whether the arm carries a gripper."""
        if kind == "gripper" and self.arm_name:
            return self.robot.gripper_of(self.arm_name) in self.kinds.get("gripper", ())
        return kind in self.kinds

    def make(self, kinds: Iterable[PartKind]) -> None:
        """Make the controllers and sensors of these kinds now, as far as the robot has them, rather than in a tick."""
        accessors = {"lidar": "base", "force_torque": "wrist_wrench"}
        for kind in kinds:
            if self.has(kind):
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
        """What the hand of the arm holds, as far as is believed."""
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
        """``camera`` and those on the hands, as far as the robot has them."""
        named = {self.camera.name: self.camera} if self.has("camera") else {}
        for arm in self.robot.arm_names:
            on_hand = self.for_arm(arm).wrist_camera
            if on_hand is not None:
                named.setdefault(on_hand.name, on_hand)
        return tuple(named.values())

    @property
    def arm_model(self) -> ArmModel:
        """The arm that skills move."""
        from bestman_bt.robot_model.model import ArmModel

        return self.robot.of(ArmModel)[self.arm.name]

    @property
    def gripper_model(self) -> GripperModel:
        """The gripper that skills use."""
        from bestman_bt.robot_model.model import GripperModel

        return self.robot.of(GripperModel)[self.gripper.name]

    @property
    def map_from_base(self) -> Pose:
        """The believed pose of the base."""
        return self.world.base.pose.to_pose()

    def arm_positions(self) -> NDArray[np.float64]:
        """Measured joint positions of the arm, (n,) radians."""
        positions = self.joints.positions()
        return np.array([positions[name] for name in self.arm_model.joint_names])

    def reaching_arm(self, reachability: ReachabilityMap | None = None) -> ReachingArm:
        """The arm as it is now, for a search of stands."""
        from bestman_bt.manipulation.kinematics.stand_pose import ReachingArm

        return ReachingArm(self.kinematics, self.arm_model, self.arm_positions(), self.rng, reachability)

    def base_from_tool(self) -> Pose:
        """Where the tool is, by encoders."""
        return self.kinematics.tool_pose(self.arm_positions())

    def planning_scene(
        self, ignore: Iterable[str] = (), allowed_pairs: Iterable[tuple[str, str]] = ()
    ) -> PlanningScene:
        """The scene around the arm, from beliefs and encoders; other arms that move are where they will rest."""
        from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model

        return planning_scene_from_world_model(
            self.world, self.robot, self.arm.for_planning(self.joints.positions()), self.arm.name, ignore
        ).allowing(*allowed_pairs)

    def met(self, failure: Failure) -> MotionObstacle | None:
        """What a motion failed at: what its failure says, and of an arm or its hand the bodies that are nearest."""
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
        """The outline of the base, with arm and held object where they stand out above it.

        ``posture``: of the robot, in which the arm will be; the base alone where the robot has none of this name. By
        default the arm is where it is now.
        """
        from bestman_bt.navigation.global_planning.footprint import Footprint

        base, positions = Footprint.of(self.base.model), self.joints.positions()
        if not self.has("arm"):
            return base
        if posture is not None:
            if posture not in self.robot.postures:
                return base
            tucked = self.robot.postures[posture]
            moved = self.arm_model.joint_names
            positions = {**positions, **{joint: tucked[joint] for joint in moved if joint in tucked}}
        bodies = [
            body for arm, of_arm in self._arm_bodies.items() for body in of_arm.at(positions, self.world.hands.get(arm))
        ]
        return base.carrying(bodies, SWAY)

    def known_costmap(self, posture: str | None = None) -> Costmap:
        """What the base must keep clear of: walls, furniture, and doors and drawers that are believed to stand open.

        ``posture``: as of ``footprint``.
        """
        return self.costmap.of_world(self.world, self.footprint(posture))

    def seen_costmap(self, posture: str | None = None) -> Costmap:
        """``known_costmap`` and what the lidar sees that the map does not know."""
        costmap = self.known_costmap(posture)
        return self.base.layer.on(costmap) if self.costmap.obstacle else costmap

    @cached_property
    def _arm_bodies(self) -> dict[str, ArmBodies]:
        from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies

        return {arm: ArmBodies(self.robot, arm) for arm in self.robot.arm_names}

    def arm_world(self, scene: PlanningScene) -> CollisionWorld:
        """The collision world of the arm in ``scene``."""
        return self.collision.world(scene, self.arm.name)
