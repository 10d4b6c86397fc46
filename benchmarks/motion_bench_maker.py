"""Arm planning on problems of MotionBenchMaker: ours beside OMPL's RRTConnect and AORRTC, judged by PyBullet.

``--archive``: ``tar.bz2`` of ``FAMILY_ROBOT/scene0001.yaml`` and ``request0001.yaml``, as MoveIt writes them
(Chamzas et al., "MotionBenchMaker", RA-L 2022; archives of two robots lie in ``resources/`` of KavrakiLab/vamp).
``--robot``: ``panda`` (mesh of pybullet_data), ``ur5`` (``--urdf`` says where its URDF is, an SRDF of that name beside
it), or a YAML of a robot whose ``base_frame`` is the root of the request's robot. Joints are matched by name; those of
the request that the robot lacks have to stand still, those of the arm that a goal does not name stay where they are.

A problem counts if start and goal are within the joint limits and free for the judge; the others are listed. Strictly
free: no contact deeper than 0.1 mm at steps of 0.01 rad, along the path and along the timed motion, of what the arm
moves with the obstacles or with itself. All planners ask the same collision world and pass the same time
parametrisation; OMPL's paths are simplified by OMPL for 60 ms. Times are processor time of this thread.
``cost_ratio``: sum of path lengths over that of OMPL's RRTConnect, on the problems that both solved.
"""

from __future__ import annotations

import argparse
import gc
import json
import math
import os
import platform
import sys
import tarfile
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
import pybullet
import yaml
from numpy.typing import NDArray
from ompl import geometric

from benchmarks.ompl_simplified import ompl_simplified
from bestman_bt.errors import Error
from bestman_bt.manipulation.collision.base import CollisionWorld
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlan, MotionPlanner
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner, TimedPlan
from bestman_bt.manipulation.trajectory.base import dense_samples
from bestman_bt.messages import Box, Cylinder, JointTrajectory, PlacedShape, Pose, Sphere
from bestman_bt.registry import ALGORITHMS, class_and_preset
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.urdf_source import read_srdf
from bestman_bt.robot_model.urdf_tree import UrdfTree
from bestman_bt.runtime.part_import import PartRequest, import_part

PADDINGS = (0.002, 0.001, 0.0003)
"""Metres. The first at which start and goal are free: problems may stand closer to things than one would like."""
STEP = 0.01
DEEPEST = 1e-4
PEERS = {"ompl_rrt_connect": "RRTConnect", "ompl_aorrtc": "AORRTC"}


@dataclass(frozen=True, eq=False)
class Problem:
    """``start``, ``goal``: (n,) of the arm's joints; ``positions``: of all others. ``fault``: why it is none."""

    name: str
    family: str
    fault: str = ""
    start: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    goal: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    positions: Mapping[str, float] = field(default_factory=dict)
    obstacles: tuple[SceneObstacle, ...] = ()


def read_archive(path: Path, every: int, arm: ArmModel, joints: set[str]) -> Iterator[Problem]:
    """Each ``every``-th problem of each family; ValueError where the file is no archive of problems."""
    try:
        with tarfile.open(path) as archive:
            texts = {m.name: archive.extractfile(m).read() for m in archive if m.isfile() and m.name.endswith(".yaml")}
    except (OSError, tarfile.TarError) as error:
        raise ValueError(f"{path} cannot be read as an archive: {error}") from error
    requests = sorted(name for name in texts if Path(name).name.startswith("request"))
    if not requests:
        raise ValueError(f"{path} holds no request*.yaml: it should hold FAMILY/request0001.yaml and scene0001.yaml")
    counts: dict[str, int] = {}
    for name in requests:
        family = Path(name).parent.name
        counts[family] = counts.get(family, -1) + 1
        if counts[family] % every:
            continue
        title = f"{family}/{Path(name).stem.removeprefix('request')}"
        try:
            scene = texts[str(Path(name).with_name(Path(name).name.replace("request", "scene")))]
            yield _problem(title, family, _yaml(texts[name]), _yaml(scene), arm, joints)
        except (KeyError, TypeError, ValueError, yaml.YAMLError) as error:
            yield Problem(title, family, f"it cannot be read: {type(error).__name__}: {error}")


def _yaml(text: bytes) -> dict[str, Any]:
    return yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: S506 - both are safe


def _problem(title: str, family: str, request: dict, scene: dict, arm: ArmModel, joints: set[str]) -> Problem:
    state = request["start_state"]
    start = dict(zip(state["joint_state"]["name"], map(float, state["joint_state"]["position"]), strict=True))
    goal = {g["joint_name"]: float(g["position"]) for g in request["goal_constraints"][0]["joint_constraints"]}
    strange = [name for name in goal if name not in arm.joint_names and abs(goal[name] - start[name]) > 1e-6]
    if strange:
        raise ValueError(f"the goal moves {', '.join(strange)}, which the arm does not")
    if missing := [name for name in arm.joint_names if name not in start]:
        raise ValueError(f"the start has no value for {', '.join(missing)}")
    base_from_world = _robot_pose(state.get("multi_dof_joint_state") or {}).inverse()
    bodies = (scene.get("world") or {}).get("collision_objects") or []
    return Problem(
        title,
        family,
        start=np.array([start[name] for name in arm.joint_names]),
        goal=np.array([goal.get(name, start[name]) for name in arm.joint_names]),
        positions={name: start[name] for name in start if name in joints and name not in arm.joint_names},
        obstacles=tuple(_obstacle(f"{body['id']} {i}", body, base_from_world) for i, body in enumerate(bodies)),
    )


def _robot_pose(state: dict) -> Pose:
    poses = [_pose(t["translation"], t["rotation"]) for t in state.get("transforms") or ()]
    if len(poses) > 1:
        raise ValueError(f"the robot hangs on {len(poses)} joints of several degrees of freedom, one is supported")
    return poses[0] if poses else Pose()


def _pose(position: list[float], orientation: list[float]) -> Pose:
    return Pose(np.array(position, dtype=float), np.array(orientation, dtype=float))


def _obstacle(name: str, body: dict, base_from_world: Pose) -> SceneObstacle:
    if body.get("meshes") or body.get("planes"):
        raise ValueError(f"{name} is no box, cylinder or sphere")
    own = body.get("pose")
    frame = base_from_world if own is None else base_from_world @ _pose(own["position"], own["orientation"])
    shapes = []
    for shape, pose in zip(body["primitives"], body["primitive_poses"], strict=True):
        sizes = [float(size) for size in shape["dimensions"]]
        match shape["type"]:
            case "box":
                solid = Box((sizes[0], sizes[1], sizes[2]))
            case "cylinder":  # of MoveIt: height, radius
                solid = Cylinder(radius=sizes[1], length=sizes[0])
            case "sphere":
                solid = Sphere(sizes[0])
            case other:
                raise ValueError(f"{name} is a {other}, no box, cylinder or sphere")
        shapes.append(PlacedShape(solid, frame @ _pose(pose["position"], pose["orientation"])))
    return SceneObstacle(name, tuple(shapes))


def robot_named(name: str, urdf: Path | None) -> RobotModel:
    """``panda``, ``ur5`` (of ``urdf``), or a YAML; Error says what is wrong with it, ValueError what is missing."""
    if name == "panda":
        # The shipped hand has flat pads in the place of its fingers: these are the meshes of the problems.
        hand = {"part": "panda_hand", "mount": "arm", "rpy": [0, 0, "-45 deg"], "set": {"collision": {}}}
        return _composed({"arm": {"part": "panda_arm"}, "gripper": hand})
    if name != "ur5":
        return load_robot_model(name)
    if urdf is None:
        raise ValueError("--robot ur5 needs --urdf, the path of its URDF (resources/ur5/ur5.urdf of KavrakiLab/vamp)")
    semantics = read_srdf(urdf.with_suffix(".srdf"))
    part = yaml.safe_load(import_part(urdf, PartRequest("arm", "arm", "manipulator"), semantics).description)
    part["root"] = UrdfTree(urdf.resolve()).root  # where the requests have their scene, below the base of the arm
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ur5.yaml"
        file.write_text(yaml.safe_dump(part))
        return _composed({"arm": {"part": str(file)}})


def _composed(parts: dict[str, Any]) -> RobotModel:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.yaml"
        file.write_text(yaml.safe_dump({"parts": parts}))
        return load_robot_model(file)


class Judge:
    """PyBullet's contacts of one robot, as convex meshes, with the obstacles of a problem."""

    def __init__(self, robot: RobotModel, arm: ArmModel) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        self._arm = arm
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(robot.urdf)
            file.flush()
            flags = pybullet.URDF_USE_SELF_COLLISION
            self.robot = pybullet.loadURDF(file.name, useFixedBase=True, flags=flags, physicsClientId=self.client)
        base = pybullet.getBodyInfo(self.robot, physicsClientId=self.client)[0].decode()
        count = pybullet.getNumJoints(self.robot, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(self.robot, i, physicsClientId=self.client) for i in range(count)]
        self.joints = {info[1].decode(): info[0] for info in infos}
        names = {-1: base} | {info[0]: info[12].decode() for info in infos}
        turns = {self.joints[name] for name in arm.joint_names}
        above: dict[int, frozenset[int]] = {-1: frozenset()}
        for info in infos:
            above[info[0]] = above[info[16]] | ({info[0]} & turns)
        self._moving = {link for link, joints in above.items() if joints}
        solid = [i for i in names if pybullet.getCollisionShapeData(self.robot, i, physicsClientId=self.client)]
        self._pairs = [
            (a, b)
            for k, a in enumerate(solid)
            for b in solid[k + 1 :]
            if above[a] != above[b] and frozenset((names[a], names[b])) not in robot.allowed_self_pairs
        ]
        self._place_root(robot.base_frame, base, names)
        self._obstacles: list[int] = []

    def _place_root(self, base_frame: str, base: str, names: dict[int, str]) -> None:
        """Put the robot so that its base frame lies at the origin."""
        if base_frame == base:
            return
        link = next(i for i, name in names.items() if name == base_frame)
        state = pybullet.getLinkState(self.robot, link, computeForwardKinematics=True, physicsClientId=self.client)
        inverse = _pose(list(state[4]), list(state[5])).inverse()
        pybullet.resetBasePositionAndOrientation(
            self.robot, inverse.position, inverse.quaternion, physicsClientId=self.client
        )

    def enter(self, problem: Problem) -> None:
        """Take the obstacles of a problem in the place of those before, and its other joints."""
        for body in self._obstacles:
            pybullet.removeBody(body, physicsClientId=self.client)
        placed = [shape for obstacle in problem.obstacles for shape in obstacle.shapes]
        self._obstacles = [self._body(shape) for shape in placed]
        for name, value in problem.positions.items():
            pybullet.resetJointState(self.robot, self.joints[name], value, physicsClientId=self.client)

    def _body(self, placed: PlacedShape) -> int:
        match placed.shape:
            case Box(size):
                given = {"shapeType": pybullet.GEOM_BOX, "halfExtents": [s / 2 for s in size]}
            case Cylinder(radius, length):
                given = {"shapeType": pybullet.GEOM_CYLINDER, "radius": radius, "height": length}
            case Sphere(radius):
                given = {"shapeType": pybullet.GEOM_SPHERE, "radius": radius}
        shape = pybullet.createCollisionShape(**given, physicsClientId=self.client)
        position, orientation = placed.pose.position, placed.pose.quaternion
        return pybullet.createMultiBody(0, shape, -1, position, orientation, physicsClientId=self.client)

    def is_free(self, positions: NDArray[np.float64]) -> bool:
        """Whether nothing overlaps by more than 0.1 mm at ``positions`` (n,)."""
        for name, value in zip(self._arm.joint_names, positions, strict=True):
            pybullet.resetJointState(self.robot, self.joints[name], float(value), physicsClientId=self.client)
        near = (
            point
            for body in self._obstacles
            for point in pybullet.getClosestPoints(self.robot, body, 0.0, physicsClientId=self.client)
            if point[3] in self._moving
        )
        own = (
            point
            for a, b in self._pairs
            for point in pybullet.getClosestPoints(self.robot, self.robot, 0.0, a, b, physicsClientId=self.client)
        )
        return all(point[8] >= -DEEPEST for points in (near, own) for point in points)

    def passes(self, answer: Answer) -> bool:
        """Whether path and timed motion are free at steps of 0.01 rad."""
        if answer.path is None or answer.trajectory is None:
            return False
        along = (q for _, q in dense_samples(answer.trajectory, math.inf, STEP))
        return all(self.is_free(q) for points in (dense_points(answer.path, STEP), along) for q in points)


@dataclass(frozen=True, eq=False)
class Answer:
    """``path`` (N, n), None without one; ``trajectory``: timed, None where that failed; ``plan_ms``: of the path."""

    plan_ms: float
    path: NDArray[np.float64] | None = None
    trajectory: JointTrajectory | None = None
    error: str = ""

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


@dataclass
class Timed(MotionPlanner):
    """Sums the processor time of a planner."""

    planner: MotionPlanner
    seconds: float = 0.0

    def plan(self, *arguments: Any) -> MotionPlan:
        begin = time.process_time()
        try:
            return self.planner.plan(*arguments)
        finally:
            self.seconds += time.process_time() - begin


Solver = Callable[[Problem, CollisionWorld, ArmModel, int], Answer]


def ours(planner: MotionPlanner, timing: Any) -> Solver:
    def solve(problem: Problem, world: CollisionWorld, arm: ArmModel, seed: int) -> Answer:
        timed = Timed(planner)
        rng = np.random.default_rng(seed)
        try:
            found: TimedPlan = TimedMotionPlanner(timed, timing).plan(problem.start, [problem.goal], world, arm, rng)
        except ManipulationError as error:
            return Answer(1e3 * timed.seconds, error=str(error))
        return Answer(1e3 * timed.seconds, found.plan.path, found.trajectory)

    return solve


def peer(kind: str, timing: Any) -> Solver:
    def solve(problem: Problem, world: CollisionWorld, arm: ArmModel, seed: int) -> Answer:
        if not (world.is_free(problem.start) and world.is_free(problem.goal)):  # OMPL would wait for a valid goal
            return Answer(0.0, error="start or goal is in collision")
        found = ompl_simplified(problem.start, problem.goal, world, arm, seed + 1, kind=kind)
        if found.path is None:
            return Answer(found.plan_ms, error="no path")
        try:
            return Answer(found.plan_ms, found.path, timing.parametrize(found.path, arm))
        except ManipulationError as error:
            return Answer(found.plan_ms, found.path, error=str(error))

    return solve


def spread(values: list[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {"median": round(float(np.median(values)), 2), "p95": round(float(np.percentile(values, 95)), 2)}


def figures(names: list[str], answers: dict[str, Answer], free: dict[str, bool], base: dict[str, Answer]) -> dict:
    mine = [answers[name] for name in names]
    both = [name for name in names if answers[name].path is not None and base[name].path is not None]
    lengths = sum(answers[name].length for name in both), sum(base[name].length for name in both)
    return {
        "problems": len(names),
        "solved": sum(answer.path is not None for answer in mine),
        "strictly_free": sum(free[name] for name in names),
        "plan_ms": spread([answer.plan_ms for answer in mine]),
        "cost_ratio": round(lengths[0] / lengths[1], 3) if both else None,
    }


def world_of(problem: Problem, model: CoalCollisionModel) -> CollisionWorld:
    """The collision world with the widest padding at which start and goal are free."""
    for padding in PADDINGS:
        world = model.world(PlanningScene(problem.positions, problem.obstacles, padding=padding))
        if world.is_free(problem.start) and world.is_free(problem.goal):
            break
    return world


def fault(problem: Problem, arm: ArmModel, judge: Judge) -> str:
    """Why a problem does not count; empty where it does."""
    if problem.fault:
        return problem.fault
    judge.enter(problem)
    for what, positions in (("start", problem.start), ("goal", problem.goal)):
        outside = (positions < arm.lower - 1e-6) | (positions > arm.upper + 1e-6)
        if outside.any():
            return f"{what} outside the limits of {', '.join(np.array(arm.joint_names)[outside])}"
        if not judge.is_free(positions):
            return f"{what} in collision"
    return ""


def measure(problems: list[Problem], robot: RobotModel, arm: ArmModel, solvers: dict[str, Solver], seed: int) -> dict:
    model, judge = CoalCollisionModel(robot), Judge(robot, arm)
    left_out: dict[str, str] = {}
    counted: list[Problem] = []
    answers: dict[str, dict[str, Answer]] = {name: {} for name in solvers}
    free: dict[str, dict[str, bool]] = {name: {} for name in solvers}
    for problem in problems:
        if why := fault(problem, arm, judge):
            left_out[problem.name] = why
            continue
        counted.append(problem)
        world = world_of(problem, model)
        for name, solve in solvers.items():
            gc.collect()
            answers[name][problem.name] = answer = solve(problem, world, arm, seed + len(counted))
            free[name][problem.name] = judge.passes(answer)
    families: dict[str, list[str]] = {}
    for problem in counted:
        families.setdefault(problem.family, []).append(problem.name)
    everything = [problem.name for problem in counted]
    base = answers.get("ompl_rrt_connect", dict.fromkeys(everything, Answer(0.0)))
    return {
        "problems": len(counted),
        "left_out": left_out,
        "planners": {
            name: figures(everything, answers[name], free[name], base)
            | {
                "families": {f: figures(names, answers[name], free[name], base) for f, names in families.items()},
                "unsolved": {n: answers[name][n].error for n in everything if answers[name][n].path is None},
                "touching": [n for n in everything if answers[name][n].path is not None and not free[name][n]],
            }
            for name in solvers
        },
    }


def in_words(document: dict) -> Iterator[str]:
    yield f"{document['robot']}: {document['problems']} problems, {len(document['left_out'])} left out"
    for name, why in document["left_out"].items():
        yield f"  {name}: {why}"
    head = ("", "problems", "solved", "strictly free", "median ms", "p95 ms", "cost ratio")
    yield ("{:28}" + "{:>15}" * 6).format(*head)
    for planner, found in document["planners"].items():
        for name, row in {planner: found, **{f"  {f}": row for f, row in found["families"].items()}}.items():
            times = row["plan_ms"] or {"median": "", "p95": ""}
            cells = (row["problems"], row["solved"], row["strictly_free"], *times.values(), row["cost_ratio"] or "")
            yield ("{:28}" + "{:>15}" * 6).format(name, *cells)
        yield from (f"  not solved: {name}: {why}" for name, why in found["unsolved"].items())
        yield from (f"  not strictly free: {name}" for name in found["touching"])
    yield from (f"without {name}: {why}" for name, why in document["without"].items())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--archive", type=Path, required=True)
    parser.add_argument("--robot", required=True, metavar="panda|ur5|FILE.yaml")
    parser.add_argument("--urdf", type=Path, help="of the ur5, an SRDF of that name beside it")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only each N-th problem of a family")
    parser.add_argument("--only", default="", metavar="TEXT", help="only problems with this in their name")
    parser.add_argument("--ours-only", action="store_true", help="without OMPL's planners: no cost ratio")
    parser.add_argument("--planner", default="rrt_connect", help="a name registered under motion_planning/")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    arguments = parser.parse_args()
    if arguments.every < 1:
        parser.error(f"--every should be at least 1 but is {arguments.every}")
    try:
        robot = robot_named(arguments.robot, arguments.urdf)
        arm = robot.of(ArmModel)[robot.arm_named()]
        joints = {
            joint.get("name", "") for joint in ET.fromstring(robot.urdf).iter("joint") if joint.get("type") != "fixed"
        }
        problems = [
            p for p in read_archive(arguments.archive, arguments.every, arm, joints) if arguments.only in p.name
        ]
    except (Error, ValueError, KeyError, OSError) as error:
        parser.error(str(error))
    timing = ALGORITHMS.resolve("trajectory/toppra")()
    planner, preset = class_and_preset(ALGORITHMS.resolve(f"motion_planning/{arguments.planner}"))
    solvers = {"ours": ours(planner(**preset), timing)}
    missing = {}
    for name, kind in {} if arguments.ours_only else PEERS.items():
        if hasattr(geometric, kind):
            solvers[name] = peer(kind, timing)
        else:
            missing[name] = f"OMPL {version('ompl')} has no {kind}"
    document = {
        "robot": robot.name if arguments.robot not in ("panda", "ur5") else arguments.robot,
        "archive": arguments.archive.name,
        "every": arguments.every,
        "planner": arguments.planner,
        "seed": arguments.seed,
        **measure(problems, robot, arm, solvers, arguments.seed),
        "without": missing,
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count(), "load": round(os.getloadavg()[0], 2)},
        "versions": {name: version(name) for name in ("numpy", "pin", "coal", "ompl", "pybullet")},
    }
    if arguments.json:
        print(json.dumps(document, indent=2))
    else:
        print(*in_words(document), sep="\n")


if __name__ == "__main__":
    main()
