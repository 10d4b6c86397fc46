"""What skills work with: controllers, sensors, algorithms and beliefs of one robot, each made on first use."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from behaviours.computation import Computation, TimeSource
from behaviours.contacts import Contact
from behaviours.failure import NodeFailure
from behaviours.parts import PartKind
from bestman_bt.messages import Pose
from bestman_bt.world_model import WorldModel

if TYPE_CHECKING:
    from bestman_bt.control.arm import ArmController
    from bestman_bt.control.force_torque import WristWrench
    from bestman_bt.control.gripper import GripperController
    from bestman_bt.control.head import HeadController
    from bestman_bt.control.joint_state import JointStateSensor
    from bestman_bt.control.rgbd import RGBDSensor
    from bestman_bt.control.robot_stop import RobotStop
    from bestman_bt.control.tactile import TactileSensor
    from bestman_bt.control.wheeled import BaseController
    from bestman_bt.manipulation.collision import CollisionModel, CollisionWorld, PlanningScene
    from bestman_bt.manipulation.kinematics import ArmBodies, InverseKinematics
    from bestman_bt.manipulation.motion_planning import TimedMotionPlanner
    from bestman_bt.manipulation.policy import Policy
    from bestman_bt.navigation.global_planning import Costmap, Footprint, GlobalPlanner, LayeredCostmap
    from bestman_bt.navigation.local_planning import PathFollower
    from bestman_bt.navigation.localization import GlobalLocalizer, Localizer, OdometryFilter
    from bestman_bt.navigation.slam import FrontierExplorer, Slam
    from bestman_bt.perception.affordance import HandleDetector
    from bestman_bt.perception.detection import Detector
    from bestman_bt.perception.grasp_pose import GraspPlanner
    from bestman_bt.perception.occupancy import OccupancyMapper
    from bestman_bt.perception.pose_estimation import MultiView, Observation
    from bestman_bt.perception.segmentation import SupportSurfaces
    from bestman_bt.perception.tracking import Tracker
    from bestman_bt.perception.view_planning import ViewPlanner
    from bestman_bt.robot_model import ArmModel, GripperModel, RobotModel

SWAY = 0.01
"""Metres that an arm and what it holds may be beside where its encoders say while the base drives."""
DRIVEN = "carry"
"""The posture in which trees have the arm driven to a stand, for whoever chooses one before."""
MADE_ON_FIRST_USE = frozenset(
    ("base", "arm", "gripper", "head", "camera", "wrist_camera", "tactile", "joints", "wrist_wrench")
)
"""Attributes of a context that are controllers and sensors."""


class Algorithms:
    """The algorithms that the configuration chose, one per slot; each is made when it is first asked for.

    ``make``: slot → the algorithm, as ``bestman_bt.runtime.algorithms`` makes it.
    """

    detection: Detector
    multi_view: MultiView
    tracking: Tracker
    view_planning: ViewPlanner
    surfaces: SupportSurfaces
    affordance: HandleDetector
    occupancy: OccupancyMapper
    grasp_pose: GraspPlanner
    unknown_grasp_pose: GraspPlanner
    handle_grasp_pose: GraspPlanner
    kinematics: InverseKinematics
    collision: CollisionModel
    motion_planning: TimedMotionPlanner
    costmap: LayeredCostmap
    global_planning: GlobalPlanner
    local_planning: PathFollower
    localization: Localizer
    odometry: OdometryFilter
    slam: Slam
    exploration: FrontierExplorer
    global_localization: GlobalLocalizer

    def __init__(self, make: Callable[[str], Any]) -> None:
        self._make = make

    if not TYPE_CHECKING:

        def __getattr__(self, slot: str) -> Any:
            if slot not in Algorithms.__annotations__:
                raise AttributeError(f"there is no slot {slot!r}; there are {', '.join(Algorithms.__annotations__)}")
            made = self._make(slot)
            setattr(self, slot, made)
            return made


@dataclass(eq=False, repr=False)
class SkillContext:
    """Everything that a skill may use; controllers and sensors are made when they are first asked for.

    ``kinds``: what the robot has, kind → names of its parts. ``base``, ``arm``, ``gripper``, ``head`` and ``camera``
    raise MissingPartError where it has none: skills declare in ``REQUIRES`` which of them they use.
    ``stop``: the one over all parts, for leaves that go on after it.
    ``camera``: the first that no arm carries, else the one on the hand. ``wrist_camera``: on the hand, where there is
    one; ``tactile``: pads of the fingers, which may be none. ``wrist_wrench``: what touches the hand, where there is a
    sensor. ``make_part``: from the name of one of these attributes to what it is.
    ``observations``: what was seen of objects lately, by identity, in the map frame.
    ``contacts``: those that skills declare now. ``handled``: the object that the fingers have touched last.
    ``costs``: what a computation takes on the robot's computer, seconds by name. ``failures``: what leaves told,
    oldest first. ``policies``: from the name or file of a learned policy to it. ``planners``, ``followers``: from the
    name of a global and of a local planner to it; they raise LookupError. All three take the folders from which paths
    are counted, too: ``Node.folders``.
    """

    clock: TimeSource
    robot: RobotModel
    kinds: Mapping[PartKind, tuple[str, ...]]
    make_part: Callable[[str], Any]
    world: WorldModel
    stop: RobotStop
    algorithms: Algorithms
    computation: Computation
    costs: Mapping[str, float]
    rng: np.random.Generator
    planners: Callable[[str, tuple[Path, ...]], GlobalPlanner]
    followers: Callable[[str, tuple[Path, ...]], PathFollower]
    policies: Callable[[str, tuple[Path, ...]], Policy]
    failures: list[NodeFailure] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    handled: str | None = None
    observations: dict[str, list[Observation]] = field(default_factory=dict)

    base: BaseController = field(init=False)
    arm: ArmController = field(init=False)
    gripper: GripperController = field(init=False)
    head: HeadController = field(init=False)
    camera: RGBDSensor = field(init=False)
    wrist_camera: RGBDSensor | None = field(init=False)
    tactile: Sequence[TactileSensor] = field(init=False)
    joints: JointStateSensor = field(init=False)
    wrist_wrench: WristWrench | None = field(init=False)

    def has(self, kind: PartKind) -> bool:
        """Whether the robot has a part of a kind."""
        return kind in self.kinds

    def make(self, kinds: Iterable[PartKind]) -> None:
        """Make the controllers and sensors of these kinds now, as far as the robot has them, rather than in a tick."""
        accessors = {"lidar": "base", "force_torque": "wrist_wrench"}
        for kind in kinds:
            if self.has(kind):
                getattr(self, accessors.get(kind, kind))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name not in MADE_ON_FIRST_USE:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            made = self.make_part(name)
            setattr(self, name, made)
            return made

    @property
    def cameras(self) -> tuple[RGBDSensor, ...]:
        """``camera`` and ``wrist_camera``, as far as the robot has them."""
        first = (self.camera,) if self.has("camera") else ()
        on_hand = self.wrist_camera
        return first if on_hand is None or on_hand.name in [one.name for one in first] else (*first, on_hand)

    @property
    def arm_model(self) -> ArmModel:
        """The arm that skills move."""
        from bestman_bt.robot_model import ArmModel

        return self.robot.of(ArmModel)[self.arm.name]

    @property
    def gripper_model(self) -> GripperModel:
        """The gripper that skills use."""
        from bestman_bt.robot_model import GripperModel

        return self.robot.of(GripperModel)[self.gripper.name]

    @property
    def map_from_base(self) -> Pose:
        """The believed pose of the base."""
        return self.world.base.pose.to_pose()

    def arm_positions(self) -> NDArray[np.float64]:
        """Measured joint positions of the arm, (n,) radians."""
        positions = self.joints.positions()
        return np.array([positions[name] for name in self.arm_model.joint_names])

    def base_from_tool(self) -> Pose:
        """Where the tool is, by encoders."""
        return self.algorithms.kinematics.tool_pose(self.arm_positions())

    def planning_scene(
        self, ignore: Iterable[str] = (), allowed_pairs: Iterable[tuple[str, str]] = ()
    ) -> PlanningScene:
        """The scene around the arm, from beliefs and encoders."""
        from bestman_bt.manipulation.collision import planning_scene_from_world_model

        return planning_scene_from_world_model(
            self.world, self.robot, self.joints.positions(), self.arm.name, ignore, allowed_pairs
        )

    def footprint(self, posture: str | None = None) -> Footprint:
        """The outline of the base, with arm and held object where they stand out above it.

        ``posture``: of the robot, in which the arm will be; the base alone where the robot has none of this name. By
        default the arm is where it is now.
        """
        from bestman_bt.control.wheeled import footprint_of

        base, positions = footprint_of(self.base.description), self.joints.positions()
        if not self.has("arm"):
            return base
        if posture is None:
            return base.carrying(self._arm_bodies.at(positions, self.world.held), SWAY)
        if posture not in self.robot.postures:
            return base
        tucked = zip(self.arm_model.joint_names, self.robot.posture(posture, self.arm_model.joint_names), strict=True)
        return base.carrying(self._arm_bodies.at({**positions, **dict(tucked)}, self.world.held), SWAY)

    def costmap(self, posture: str | None = None) -> Costmap:
        """What the base must keep clear of: walls, furniture, and doors and drawers that are believed to stand open.

        ``posture``: as of ``footprint``.
        """
        return self.algorithms.costmap.of_world(self.world, self.footprint(posture))

    def seen_costmap(self, posture: str | None = None) -> Costmap:
        """``costmap`` and what the lidar sees that the map does not know."""
        costmap = self.costmap(posture)
        return self.base.layer.on(costmap) if self.algorithms.costmap.parameters.obstacle else costmap

    @cached_property
    def _arm_bodies(self) -> ArmBodies:
        from bestman_bt.manipulation.kinematics import ArmBodies

        return ArmBodies(self.robot, self.arm.name)

    def arm_world(self, scene: PlanningScene) -> CollisionWorld:
        """The collision world of the arm in ``scene``."""
        return self.algorithms.collision.world(scene, self.arm.name)
