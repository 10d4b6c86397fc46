"""Registries of exchangeable classes, each stored as text ``"module:Class"`` until first use.

Decorators add your own, in a plug-in or before the robot is prepared:

    @algorithm("global_planning/mine")
    class Mine(GlobalPlanner): ...
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, ClassVar, TypeVar

from bestman_bt.errors import InputError

T = TypeVar("T")


class UnknownNameError(InputError, LookupError):
    """Raised if the registry has no entry of this name."""


class Registry:
    """Names → ``"module:Class"``, imported on first use; other packages add names by entry points.

    ``group``: the entry-point group, for example ``bestman_bt.drivers``. ``what``: the noun used in error messages.
    ``found_by``: ``"module:function"`` that returns further shipped entries, name → target.
    """

    additions: ClassVar[int] = 0
    """Number of ``add`` calls on all registries; a plug-in that registers something raises it."""

    def __init__(self, group: str, what: str, entries: dict[str, str], found_by: str = "") -> None:
        self.group = group
        self.what = what
        self.shipped = tuple(entries)
        self._entries: dict[str, Any] = dict(entries)
        self._discovered = False
        self._found_by = found_by

    def add(self, name: str, target: Any) -> None:
        """Register ``target``, a class or ``"module:Class"``, under ``name``; a later name replaces an earlier one."""
        self._entries[name] = target
        Registry.additions += 1

    def adding(self, name: str) -> Callable[[T], T]:
        """Return a decorator that registers a class under ``name``."""

        def add(target: T) -> T:
            self.add(name, target)
            return target

        return add

    def names(self) -> list[str]:
        """Return all names, sorted."""
        self._discover()
        return sorted(self._entries)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def resolve(self, name: str) -> type:
        """Import and return the class of ``name``. Raises UnknownNameError suggesting the closest name."""
        self._discover()
        if name not in self._entries:
            raise UnknownNameError(f"unknown {self.what} {name!r}; {suggestion(name, self._entries)}")
        target = self._entries[name]
        resolved: type = _imported(target) if isinstance(target, str) else target
        return resolved

    def of_kind(self, kind: str) -> dict[str, tuple[type, dict[str, Any]]]:
        """Return class and preset of the entries whose names begin with ``kind/``, by the rest of the name."""
        names = [name for name in self if name.startswith(f"{kind}/")]
        return {name.removeprefix(f"{kind}/"): class_and_preset(self.resolve(name)) for name in names}

    def _discover(self) -> None:
        if not self._discovered:
            self._discovered = True
            if self._found_by:
                self._entries = {**_imported(self._found_by)(), **self._entries}
            for point in entry_points(group=self.group):
                self._entries.setdefault(point.name, point.value)


@contextmanager
def undone(*registries: Registry) -> Iterator[None]:
    """Remove everything that the block added to the registries at its end; for tests of plug-ins."""
    before = [{name: registry._entries[name] for name in registry.names()} for registry in registries]
    try:
        yield
    finally:
        for registry, entries in zip(registries, before, strict=True):
            registry._entries = entries


def _imported(name: str) -> Any:
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def suggestion(name: str, known: Iterator[str] | list[str] | dict[str, Any]) -> str:
    """Return the end of an error message: the closest of the ``known`` names, else all of them."""
    names = sorted(known)
    close = difflib.get_close_matches(name, names)
    close.sort(key=lambda other: name not in other)  # astar: grid_astar before theta_star
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names) or 'none'}"


def _by_name(modules: dict[str, str]) -> dict[str, str]:
    """Name → target, of classes that are registered under their own names: module → those in it."""
    return {name: f"{module}:{name}" for module, names in modules.items() for name in names.split()}


DRIVERS = Registry(
    "bestman_bt.drivers",
    "robot driver",
    {
        "hardware": "hal.hardware.isolated_robot:IsolatedRobot",
        "mujoco": "hal.mujoco.robot:MujocoRobot",
        "pybullet": "hal.pybullet.robot:PyBulletRobot",
        "replay": "hal.replay.robot:ReplayRobot",
    },
)
"""Implementations of the Robotics API."""

CONNECTIONS = Registry(
    "bestman_bt.connections",
    "connection driver",
    {
        "realsense": "hal.realsense.connection:RealSenseConnection",
        "robotiq": "hal.robotiq.connection:RobotiqConnection",
        "rosbridge": "hal.rosbridge.connection:RosbridgeConnection",
        "ur": "hal.ur.connection:URConnection",
        "xarm": "hal.xarm.connection:XArmConnection",
    },
)
"""Drivers of vendors' controllers, by the ``driver`` of a connection in a robot's YAML."""

PARTS = Registry(
    "bestman_bt.parts",
    "kind",
    {
        "arm": "bestman_bt.robot_model.part_config:ArmPart",
        "base": "bestman_bt.robot_model.part_config:BasePart",
        "battery": "bestman_bt.robot_model.sensor_parts:BatteryPart",
        "bumper": "bestman_bt.robot_model.sensor_parts:BumperPart",
        "camera": "bestman_bt.robot_model.sensor_parts:CameraPart",
        "force_torque": "bestman_bt.robot_model.sensor_parts:ForceTorquePart",
        "gripper": "bestman_bt.robot_model.part_config:GripperPart",
        "imu": "bestman_bt.robot_model.sensor_parts:ImuPart",
        "joint_group": "bestman_bt.robot_model.part_config:JointGroupPart",
        "legged_base": "bestman_bt.robot_model.part_config:LeggedBasePart",
        "lidar": "bestman_bt.robot_model.sensor_parts:LidarPart",
        "structure": "bestman_bt.robot_model.part_config:StructurePart",
        "suction": "bestman_bt.robot_model.part_config:SuctionPart",
        "tactile": "bestman_bt.robot_model.sensor_parts:TactilePart",
    },
)
"""Kinds of parts of robots: ``kind`` in a part's YAML → the dataclass of its fields, a subclass of ``PartConfig``."""

SIMULATED_SENSORS = Registry(
    "bestman_bt.simulated_sensors",
    "simulated sensor",
    {
        "battery": "hal.simulation.battery:SimulatedBattery",
        "bumper": "hal.simulation.bumper:SimulatedBumper",
        "camera": "hal.simulation.camera:SimulatedCamera",
        "force_torque": "hal.simulation.force_torque:SimulatedForceTorque",
        "imu": "hal.simulation.imu:SimulatedImu",
        "lidar": "hal.simulation.lidar:SimulatedLidar",
        "tactile": "hal.simulation.tactile:SimulatedTactile",
    },
)
"""Kind of part → its simulated sensor, constructed from name, part and a random generator for its noise."""

ALGORITHMS = Registry(
    "bestman_bt.algorithms",
    "algorithm",
    {
        "affordance/front_handles": "bestman_bt.perception.affordance.front_handles:FrontHandles",
        "calibration/daniilidis": "bestman_bt.perception.calibration.hand_eye:Daniilidis",
        "calibration/park_martin": "bestman_bt.perception.calibration.hand_eye:ParkMartin",
        "collision/coal_world": "bestman_bt.manipulation.collision.coal_world:CoalCollisionModel",
        "detection/aruco": "bestman_bt.perception.detection.by_marker:ByMarker",
        "detection/color_shape": "bestman_bt.perception.detection.color_shape:ColorShape",
        "detection/model_registration": "bestman_bt.perception.detection.from_image:ModelRegistration",
        "detection/onnx": "bestman_bt.perception.detection.onnx_detector:OnnxDetector",
        "detection/remote": "bestman_bt.perception.detection.remote_detector:RemoteDetector",
        "global_planning/grid_astar": "bestman_bt.navigation.global_planning.polyline_planner:GridAStar",
        "global_planning/hybrid_astar": "bestman_bt.navigation.global_planning.hybrid_astar:HybridAStar",
        "global_planning/layered": "bestman_bt.navigation.global_planning.costmap:LayeredCostmap",
        "global_planning/theta_star": "bestman_bt.navigation.global_planning.theta_star:ThetaStar",
        "grasp_pose/antipodal_cloud": "bestman_bt.perception.grasp_pose.antipodal_cloud:AntipodalCloud",
        "grasp_pose/anygrasp": "bestman_bt.perception.grasp_pose.anygrasp:AnyGraspAdapter",
        "grasp_pose/handle_grasp": "bestman_bt.perception.grasp_pose.handle_grasp:HandleGrasp",
        "grasp_pose/model_based": "bestman_bt.perception.grasp_pose.model_based:ModelBased",
        "base_placement/along_path": "bestman_bt.manipulation.base_placement:PathPlacements",
        "base_placement/at_furniture": "bestman_bt.manipulation.base_placement:BasePlacements",
        "kinematics/damped_least_squares": "bestman_bt.manipulation.kinematics.damped_least_squares:DampedLeastSquares",
        "local_planning/dwa": "bestman_bt.navigation.local_planning.dwa:DWA",
        "local_planning/mppi": "bestman_bt.navigation.local_planning.mppi:MPPI",
        "local_planning/pure_pursuit": "bestman_bt.navigation.local_planning.pure_pursuit:PurePursuit",
        "localization/correlative_search": "bestman_bt.navigation.localization.correlative_search:CorrelativeSearch",
        "localization/ekf": "bestman_bt.navigation.localization.ekf:OdometryEkf",
        "localization/scan_to_map": "bestman_bt.navigation.localization.scan_to_map:ScanToMap",
        "localization/wheel_odometry": "bestman_bt.navigation.localization.ekf:WheelOdometry",
        "motion_planning/aorrtc": "bestman_bt.manipulation.motion_planning.ompl_planners:AORRTC",
        "motion_planning/bit_star": "bestman_bt.manipulation.motion_planning.ompl_planners:BIT_STAR",
        "motion_planning/kpiece": "bestman_bt.manipulation.motion_planning.ompl_planners:KPIECE",
        "motion_planning/portfolio": "bestman_bt.manipulation.motion_planning.portfolio:Portfolio",
        "motion_planning/rrt_connect": "bestman_bt.manipulation.motion_planning.rrt_connect:RRTConnect",
        "motion_planning/rrt_star": "bestman_bt.manipulation.motion_planning.ompl_planners:RRT_STAR",
        "occupancy/log_odds": "bestman_bt.perception.occupancy:LogOdds",
        "policy/onnx": "bestman_bt.manipulation.policy.onnx_policy:OnnxPolicy",
        "policy/openpi": "bestman_bt.manipulation.policy.openpi_client:OpenpiPolicy",
        "pose_estimation/multi_start": "bestman_bt.perception.pose_estimation.multi_start:MultiStart",
        "pose_estimation/multi_view": "bestman_bt.perception.pose_estimation.multi_view:MultiView",
        "segmentation/open3d": "bestman_bt.perception.segmentation.plane_dbscan:Open3DDbscan",
        "segmentation/plane_dbscan": "bestman_bt.perception.segmentation.plane_dbscan:PlaneDbscan",
        "segmentation/region_growing": "bestman_bt.perception.segmentation.region_growing:RegionGrowing",
        "segmentation/support_surfaces": "bestman_bt.perception.segmentation.support_surfaces:SupportSurfaces",
        "tracking/global_nearest_neighbour": "bestman_bt.perception.tracking:GlobalNearestNeighbour",
        "slam/frontiers": "bestman_bt.navigation.slam.frontiers:FrontierExplorer",
        "slam/pose_graph": "bestman_bt.navigation.slam.pose_graph_slam:PoseGraphSlam",
        "trajectory/toppra": "bestman_bt.manipulation.trajectory.toppra:Toppra",
        "view_planning/expected_yaw": "bestman_bt.perception.view_planning:ExpectedYaw",
    },
)
"""``slot/name`` → dataclass whose fields are the parameters, or an instance of one, a preset of them."""


def class_and_preset(algorithm: Any) -> tuple[type, dict[str, Any]]:
    """Return the class of a registered algorithm and the fields that it sets: those of an instance; for a class, none.

    Raises InputError for an instance of a class that is not a dataclass, because its fields cannot be read.
    """
    if isinstance(algorithm, type):
        return algorithm, {}
    if not is_dataclass(algorithm):
        raise InputError(f"a registered preset should be an instance of a dataclass, but is {algorithm!r:.80}")
    return type(algorithm), {field.name: getattr(algorithm, field.name) for field in fields(algorithm) if field.init}


PLUGIN_EXAMPLES = {
    "global_planning/prm": "examples/plugins/sampled_roads.py:PRM",
    "global_planning/rrt_star": "examples/plugins/sampled_roads.py:RRTStar",
    "grasp_pose/bounding_box": "examples/plugins/bounding_box_grasps.py:BoundingBox",
    "localization/particle_filter": "examples/plugins/particle_filter.py:ParticleFilter",
    "motion_planning/prm": "examples/plugins/lazy_prm.py:PRM",
}
"""Formerly registered algorithms that are now example plug-ins → their place in the sources."""

ALGORITHM_SLOTS = frozenset(name.partition("/")[0] for name in ALGORITHMS.shipped)
"""The slots that an algorithm can fill."""

BEHAVIOURS = Registry(
    "bestman_bt.behaviours",
    "behaviour",
    _by_name(
        {
            "behaviours.clear_stop": "ClearStop",
            "behaviours.furniture.base_placement": "FindCloseStand FindLookStand FindOpenStand",
            "behaviours.furniture.close": "Close",
            "behaviours.furniture.conditions": "BelieveLocked BelieveStuck IsOpen TakeContainer",
            "behaviours.furniture.handles": "DetectHandle",
            "behaviours.furniture.open": "Open",
            "behaviours.log": "Log Say",
            "behaviours.manipulation.grasp": "CheckHeld Grasp Holding PlanGrasp Reachable",
            "behaviours.manipulation.move_arm": "MoveArm Retreat",
            "behaviours.manipulation.place": "FindPlacePose PlaceOn Release",
            "behaviours.manipulation.place_in": "FindRoomIn GoalOnSurface PlaceIn",
            "behaviours.manipulation.policy": "RunPolicy",
            "behaviours.manipulation.push": "FindPushStand Push",
            "behaviours.manipulation.next_best_view": "SecondLook",
            "behaviours.nav2.dock_at": "DockAt DockRobot UndockRobot",
            "behaviours.nav2.lacking": (
                "AssistedTeleop ComputeAndTrackRoute ComputeRoute ExtractRouteNodesAsGoals FollowObject "
                "IsBatteryCharging IsBatteryLow ToggleCollisionMonitor TransformAvailable"
            ),
            "behaviours.nav2.motions": (
                "BackUp CancelAssistedTeleop CancelBackUp CancelComputeAndTrackRoute CancelControl "
                "CancelDriveOnHeading CancelFollowObject CancelSpin CancelWait DriveOnHeading Spin Wait"
            ),
            "behaviours.nav2.navigate": (
                "ComputePathThroughPoses ComputePathToPose ControllerSelector FollowPath GoalCheckerSelector "
                "NavigateThroughPoses NavigateToPose PathHandlerSelector PlannerSelector ProgressCheckerSelector "
                "SmootherSelector"
            ),
            "behaviours.nav2.pacing": (
                "AppendGoalPoseToGoals ArePosesNear CheckPoseOccupancy CheckStopStatus DistanceController "
                "DistanceTraveled GetCurrentPose GetNextFewGoals GlobalUpdatedGoal GoalReached GoalUpdated "
                "GoalUpdater PathLongerOnApproach RemoveInCollisionGoals RemovePassedGoals SpeedController "
                "TimeExpired"
            ),
            "behaviours.nav2.paths": (
                "ConcatenatePaths GetPoseFromPath IsGoalNearby IsPathValid IsWithinPathTrackingBounds "
                "PathExpiringTimer SmoothPath TruncatePath TruncatePathLocal ValidatePath"
            ),
            "behaviours.nav2.recovery": (
                "AreErrorCodesPresent ClearCostmap ClearCostmapAroundPose ClearCostmapAroundRobot "
                "ClearCostmapExceptRegion ClearEntireCostmap IsStuck ReinitializeGlobalLocalization "
                "WouldAControllerRecoveryHelp WouldAPlannerRecoveryHelp WouldARouteRecoveryHelp "
                "WouldASmootherRecoveryHelp"
            ),
            "behaviours.nav2.sequences": (
                "GoalUpdatedController NonblockingSequence PauseResumeController PersistentSequence SingleTrigger"
            ),
            "behaviours.manipulation.base_placement": "FindStandPose",
            "behaviours.navigation.explore": "ExploreAndMap",
            "behaviours.navigation.localise": "InitialPoseReceived Relocalise",
            "behaviours.navigation.navigate": "At BelieveBlocked ForgetBlocked NavigateTo ReturnToStart",
            "behaviours.perception.beliefs": "BelieveObject",
            "behaviours.perception.look": "LookAt LookInto",
            "behaviours.perception.perceive": (
                "BelievedSurface DetectObject DetectObjects EstimatePose ObjectAt ObjectVisible"
            ),
            "behaviours.perception.scan": "ScanScene",
            "behaviours.perception.search": "FoundOn FoundOrSeenAll",
            "behaviours.perception.tidying": "FindFreePlace FindUntidy IsTidy RememberSeen",
            "behaviours.task_goals": "TakeGoal",
            "bestman_bt.task_planning.nodes": "ExecutePlan Holds Plan",
        }
    ),
)
"""Skill leaves by the name that trees use."""

PREDICATES = Registry(
    "bestman_bt.predicates",
    "predicate",
    {},
    "bestman_bt.facts.predicate:shipped_predicates",
)
"""Predicates that goals and declarations may use: instances of ``Predicate`` by name."""

GOALS = Registry(
    "bestman_bt.goals",
    "goal",
    {"facts": "bestman_bt.runtime.task_goals:Facts"},
    "bestman_bt.facts.goals.goal:shipped_goals",
)
"""Kinds of ``goals`` of a task: subclasses of ``Goal``."""

PLANNERS = Registry(
    "bestman_bt.planners",
    "task planner",
    {
        "fast_downward": "bestman_bt.task_planning.symbolic.fast_downward:FastDownwardPlanner",
        "language": "bestman_bt.task_planning.language.from_text:LanguagePlanner",
        "symbolic": "bestman_bt.task_planning.symbolic.search:SymbolicPlanner",
    },
)
"""Task planners, subclasses of ``TaskPlanner``."""

BUILDERS = Registry(
    "bestman_bt.builders",
    "tree builder",
    {
        "backchain": "bestman_bt.task_planning.builders.backchain:BackchainBuilder",
        "reactive": "bestman_bt.task_planning.builders.reactive:ReactiveBuilder",
        "sequence": "bestman_bt.task_planning.builders.sequence:SequenceBuilder",
    },
)
"""Tree builders, which turn plans into trees: subclasses of ``TreeBuilder``."""

LAUNCHERS = Registry(
    "bestman_bt.launchers",
    "launcher",
    {
        "local": "bestman_bt.evaluation.launchers.local:LocalProcesses",
        "ray": "bestman_bt.evaluation.launchers.ray_tasks:RayTasks",
        "slurm": "bestman_bt.evaluation.launchers.slurm_array:SlurmArray",
    },
)
"""Launchers that run the episodes of an evaluation: subclasses of ``Launcher``."""


def algorithm(name: str) -> Callable[[T], T]:
    """Register the decorated class as an algorithm that configurations may choose: ``@algorithm("slot/name")``.

    Raises UnknownNameError for an unknown slot.
    """
    fault = slot_fault(name)
    if fault:
        raise UnknownNameError(f"@algorithm({name!r}): {fault}")
    return ALGORITHMS.adding(name)


def slot_fault(name: str) -> str:
    """Return why the slot in an algorithm's name is invalid; empty if it is valid."""
    slot, _, own = name.partition("/")
    if not own:
        return "should be a slot and a name, such as 'global_planning/mine'"
    return "" if slot in ALGORITHM_SLOTS else f"unknown slot {slot!r}; {suggestion(slot, list(ALGORITHM_SLOTS))}"


def part(kind: str) -> Callable[[T], T]:
    """Register the decorated frozen dataclass, a ``PartConfig``, as a kind of part for robot files:
    ``@part("kind")``.
    """
    return PARTS.adding(kind)


def simulated_sensor(kind: str) -> Callable[[T], T]:
    """Register the decorated ``hal.simulation.sensor_pipeline.SimulatedSensor`` for a kind of part:
    ``@simulated_sensor("kind")``.
    """
    return SIMULATED_SENSORS.adding(kind)


def connection(driver: str) -> Callable[[T], T]:
    """Register the decorated ``hal.hardware.connection.Connection`` as a driver: ``@connection("driver")``."""
    return CONNECTIONS.adding(driver)


def goal(name: str) -> Callable[[T], T]:
    """Register the decorated ``Goal`` as a kind of goal for tasks: ``@goal("name")``."""
    return GOALS.adding(name)


def task_planner(name: str) -> Callable[[T], T]:
    """Register the decorated ``TaskPlanner``: ``@task_planner("name")``."""
    return PLANNERS.adding(name)


def tree_builder(name: str) -> Callable[[T], T]:
    """Register the decorated ``TreeBuilder``: ``@tree_builder("name")``."""
    return BUILDERS.adding(name)
