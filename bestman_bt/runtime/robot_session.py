"""Sessions: a robot in a world, with everything that skills need, ready to run trees."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from behaviours.computation import InlineComputation
from behaviours.context import Algorithms, SkillContext
from bestman_bt.configuration import ConfigurationError, Problem, RunConfig, find_data, load_run
from bestman_bt.control.arm import ArmController
from bestman_bt.control.gripper import GripperController
from bestman_bt.control.head import HeadController
from bestman_bt.control.wheeled import BaseController
from bestman_bt.engine import Node, NodeRegistry, Tree, build_tree, load_tree
from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.manipulation.motion_planning import TimedMotionPlanner
from bestman_bt.messages import Pose2D
from bestman_bt.perception.detection import ModelRegistration
from bestman_bt.registry import DRIVERS, UnknownNameError
from bestman_bt.robot_model import RobotModel, load_robot_model
from bestman_bt.runtime.algorithms import make_algorithm
from bestman_bt.runtime.executor import Execution, Executor
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.scene import World, draw_world, load_scene, semantic_map
from bestman_bt.sensing.joint_state import JointStateSensor
from bestman_bt.sensing.lidar import LidarSensor
from bestman_bt.sensing.rgbd import RGBDSensor
from bestman_bt.world_model import BasePose, WorldModel
from hal.api import Arm, Camera, Gripper, JointGroup, Lidar, MobileBase, Robot

START_POSITION_ERROR = 0.03
START_HEADING_ERROR = math.radians(1.2)
"""How far the pose that the robot is told at the start may be off: metres each way, radians."""

COMPUTATION_COSTS = {
    "detection": 0.25,
    "pose_estimation": 0.15,
    "grasp_planning": 0.2,
    "stand_planning": 0.2,
    "motion_planning": 0.15,
    "trajectory": 0.05,
    "global_planning": 0.05,
}
"""Seconds that each computation takes on the robot's computer, in simulated time."""


@dataclass(frozen=True)
class Setup:
    """What a configuration amounts to, all of it checked before anything is started."""

    config: RunConfig
    registry: NodeRegistry
    robot_model: RobotModel
    world: World
    world_model: WorldModel


@dataclass
class Session:
    """A connected robot and its skills. ``entries``: root blackboard entries that every tree gets."""

    setup: Setup
    robot: Robot
    skills: SkillContext
    entries: dict[str, Any]

    def load(self, tree: str | Path | Node | None = None) -> Tree:
        """Load a tree for this robot: a shipped name, a file, XML text or a node; the configured one by default.

        Raises TreeLoadError with everything that is wrong.
        """
        loaded = load_for(self.setup, tree, context=self.skills, clock=self.robot.clock)
        for key, value in self.entries.items():
            loaded.blackboard.set(key, value)
        return loaded

    def executor(self, tree: Tree, after_tick: Callable[[], None] | None = None) -> Executor:
        """An executor with the configured tick rate and time limit."""
        task = self.setup.config.task
        return Executor(
            tree, self.robot.clock, period=1.0 / task.tick_rate, time_limit=task.time_limit, after_tick=after_tick
        )

    def run(self, tree: str | Path | Node | None = None, after_tick: Callable[[], None] | None = None) -> Execution:
        """Load a tree and tick it to its end; the robot rests afterwards."""
        return self.executor(self.load(tree), after_tick).run()


def prepare(config: RunConfig) -> Setup:
    """Load and check everything that a run needs; nothing is started.

    Raises ConfigurationError, TreeLoadError or SceneError.
    """
    registry = node_registry(config.task.plugins)
    robot_model = load_robot_model(config.task.robot, config.robot_settings)
    scene = load_scene(config.task.scene, config.scene_settings)
    world = draw_world(scene, config.seed)
    world_model = WorldModel(
        map=semantic_map(world), models=dict(scene.models), base=_told_start(world.robot_start, config.seed)
    )
    setup = Setup(config, registry, robot_model, world, world_model)
    _check_goal(setup)
    load_for(setup)
    _algorithms(setup)
    return setup


def load_for(setup: Setup, tree: str | Path | Node | None = None, **options: Any) -> Tree:
    """Load a tree with the nodes of a setup; raises TreeLoadError or ConfigurationError."""
    source = setup.config.task.tree if tree is None else tree
    if isinstance(source, Node):
        return build_tree(source, registry=setup.registry, **options)
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return load_tree(source, setup.registry, **options)
    return load_tree(find_data("tree", source), setup.registry, **options)


@contextmanager
def open_session(
    config: RunConfig | Setup, prepare_robot: Callable[[Robot], None] | None = None, gui: bool = False
) -> Iterator[Session]:
    """Connect the configured robot; it is stopped and disconnected at the end, whatever happens.

    ``prepare_robot``: called right after connecting, before time runs (for evaluation and recording). ``gui``: show the
    driver's own window, if it has one.
    """
    setup = prepare(config) if isinstance(config, RunConfig) else config
    try:
        driver = DRIVERS.resolve(setup.config.driver)
    except UnknownNameError as error:
        raise ConfigurationError([Problem("--driver", None, "", str(error))]) from error
    robot: Robot = driver(setup.robot_model, setup.world, seed=setup.config.seed, gui=gui)
    with robot:
        if prepare_robot is not None:
            prepare_robot(robot)
        skills = _skills(setup, robot)
        skills.base.start()
        try:
            yield Session(setup, robot, skills, _entries(setup))
        finally:
            skills.base.close()
            robot.stop()


@contextmanager
def session(
    robot: str | Path = "diff_panda",
    scene: str | Path = "kitchen",
    seed: int = 0,
    task: str | Path | None = None,
    settings: Iterable[str] = (),
    plugins: Iterable[str] = (),
    driver: str = "pybullet",
    gui: bool = False,
) -> Iterator[Session]:
    """A session in one line: ``with session(scene="kitchen", seed=1) as s: s.run("fetch_cup")``.

    Without a task, that of ``fetch_cup`` gives goal and limits. Raises as ``prepare``.
    """
    config = load_run(
        task or "fetch_cup", scene=scene, robot=robot, seed=seed, settings=settings, plugins=plugins, driver=driver
    )
    with open_session(config, gui=gui) as opened:
        yield opened


def _told_start(start: Pose2D, seed: int) -> BasePose:
    """Where the robot is told to be at the start: roughly, as an operator would."""
    dx, dy, turn = np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, 3)
    told = Pose2D(
        start.x + START_POSITION_ERROR * float(dx),
        start.y + START_POSITION_ERROR * float(dy),
        start.theta + START_HEADING_ERROR * float(turn),
    )
    return BasePose(told, START_POSITION_ERROR, START_HEADING_ERROR, 0.0)


def _check_goal(setup: Setup) -> None:
    goal = setup.config.task.goal
    if goal is None:
        return
    source = f"task {setup.config.name}"
    problems = []
    if goal.name not in setup.world.goals:
        known = ", ".join(setup.world.goals) or "none"
        problems.append(Problem(source, None, "goal.name", f"the scene has no goal {goal.name!r}; it has {known}"))
    try:
        setup.world_model.map.surface(goal.surface)
    except KeyError as error:
        problems.append(Problem(source, None, "goal.surface", str(error.args[0])))
    if problems:
        raise ConfigurationError(problems)


def _entries(setup: Setup) -> dict[str, Any]:
    goal = setup.config.task.goal
    if goal is None:
        return {}
    return {
        "object": goal.object,
        "source": goal.source,
        "target": goal.surface,
        "goal": setup.world.goals[goal.name],
    }


def _algorithms(setup: Setup) -> Algorithms:
    task, model = setup.config.task, setup.robot_model
    detection = ModelRegistration(
        segmentation=make_algorithm(task, "segmentation"), pose_estimator=make_algorithm(task, "pose_estimation")
    )
    return Algorithms(
        detection=detection,
        grasp_pose=make_algorithm(task, "grasp_pose"),
        kinematics=make_algorithm(task, "kinematics", model),
        collision=make_algorithm(task, "collision", model),
        motion_planning=TimedMotionPlanner(make_algorithm(task, "motion_planning"), make_algorithm(task, "trajectory")),
        global_planning=make_algorithm(task, "global_planning"),
    )


def _skills(setup: Setup, robot: Robot) -> SkillContext:
    task, model, world = setup.config.task, setup.robot_model, replace(setup.world_model)
    world.objects, world.obstacles = {}, {}
    clock = robot.clock
    forward = ForwardKinematics(model)
    joints = JointStateSensor(robot.parts, model)
    camera = _only(robot, Camera)
    base = BaseController(
        _only(robot, MobileBase),
        clock,
        LidarSensor(_only(robot, Lidar), forward),
        make_algorithm(task, "localization", world.map),
        make_algorithm(task, "local_planning"),
        world,
    )
    return SkillContext(
        clock=clock,
        robot=model,
        world=world,
        base=base,
        arm=ArmController(_only(robot, Arm), clock),
        gripper=GripperController(_only(robot, Gripper)),
        head=HeadController(_only(robot, JointGroup, Arm), forward, joints, camera.optical_frame),
        camera=RGBDSensor(camera, forward, joints, world),
        joints=joints,
        algorithms=_algorithms(setup),
        computation=InlineComputation(clock),
        costs=COMPUTATION_COSTS,
        rng=np.random.default_rng([setup.config.seed, 2]),
    )


def _only(robot: Robot, kind: type[Any], but: type[Any] | None = None) -> Any:
    """The first part of a kind."""
    for part in robot.parts.values():
        if isinstance(part, kind) and (but is None or not isinstance(part, but)):
            return part
    kinds = ", ".join(sorted({part.kind for part in robot.parts.values()}))
    raise ConfigurationError(
        [Problem("robot", None, "parts", f"the skills need a {kind.kind}; this robot has only {kinds}")]
    )
