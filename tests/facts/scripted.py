"""Ends of runs without physics: a task as it is prepared, and a truth that a test writes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from bestman_bt.configuration.run import load_run
from bestman_bt.facts.evidence import Evidence, Verdict
from bestman_bt.facts.goals.goal import judged
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare


class ScriptedTruth:
    """Objects stand where the seed has put them, at rest and let go; what a test says is otherwise.

    ``poses``: object → map_from_object. ``on``: object → what it touches beside the robot. ``touched``: what the robot
    presses on. ``opened``: door or drawer → radians or metres. ``frames``: frame of the robot → map_from_frame.
    ``speeds``: object → m/s and rad/s.
    """

    def __init__(self, setup: ResolvedConfig) -> None:
        self.poses = {thing.name: thing.pose for thing in setup.world.objects}
        self.on: dict[str, tuple[str, ...]] = {}
        self.touched: set[str] = set()
        self.opened: dict[str, float] = {}
        self.frames: dict[str, Pose] = {}
        self.speeds: dict[str, tuple[float, float]] = {}
        self.base = setup.world.robot_start

    @property
    def object_names(self) -> tuple[str, ...]:
        return tuple(self.poses)

    def object_pose(self, name: str) -> Pose:
        return self.poses[name]

    def object_speed(self, name: str) -> tuple[float, float]:
        return self.speeds.get(name, (0.0, 0.0))

    def articulation_position(self, name: str) -> float:
        return self.opened.get(name, 0.0)

    def base_pose(self) -> Pose:
        return self.base.to_pose()

    def frame_pose(self, frame: str) -> Pose:
        return self.frames[frame]

    def touches_robot(self, name: str) -> bool:
        return name in self.touched

    def supports(self, name: str) -> tuple[str, ...]:
        return self.on.get(name, ())


@cache
def _prepared(task: str, seed: int, settings: tuple[str, ...]) -> ResolvedConfig:
    """What tests leave as it is."""
    return prepare(load_run(task, seed=seed, settings=settings))


class ScriptedEnd:
    """A prepared task, ``truth`` to be written, and what a predicate says of it.

    ``setup``, ``session``: as a judge gets them. ``told``: settings that change nothing of the world and the robot.
    """

    def __init__(self, task: str, *settings: str, seed: int = 3, told: tuple[str, ...] = ()) -> None:
        config = load_run(task, seed=seed, settings=[*settings, *told])
        self.setup = replace(_prepared(task, seed, settings), config=config)
        self.truth = ScriptedTruth(self.setup)
        arm = next(iter(self.setup.robot_model.of(ArmModel).values()))
        self.tool_frame = arm.tool_frame
        skills = SimpleNamespace(world=self.setup.world_model.initial_beliefs(), arm_model=arm)
        self.session = SimpleNamespace(setup=self.setup, skills=skills)

    def evidence(self, driven: float = 0.0, **before: Pose) -> Evidence:
        """``before``: objects that were elsewhere when the rest began."""
        stood = {**self.truth.poses, **before}
        positions = {name: tuple(float(x) for x in pose.position) for name, pose in stood.items()}
        before_rest = {name: (x, y, z) for name, (x, y, z) in positions.items()}
        return Evidence(self.setup, self.truth, before_rest, driven, self.tool_frame)

    def verdict(self, predicate: str, evidence: Evidence | None = None, **told: Any) -> Verdict:
        """What one of the task's predicates says; ``told``: as of ``evidence``."""
        return judged(self.setup.asked, predicate, evidence or self.evidence(**told))

    def surface(self, name: str) -> Pose:
        """map_from_surface of ``furniture/name``, with doors and drawers shut, as it really is."""
        wanted, _, part = name.partition("/")
        piece = next(piece for piece in self.setup.world.furniture if piece.name == wanted)
        return piece.pose @ next(one for one in piece.model.all_surfaces if one.name == part).pose

    def put(self, name: str, pose: Pose, *on: str) -> None:
        """The object is there, and touches ``on``."""
        self.truth.poses[name] = pose
        self.truth.on[name] = on


def turned(pose: Pose, yaw: float) -> Pose:
    """Turned about its own vertical axis by ``yaw``, radians."""
    return pose @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))


def shifted(pose: Pose, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    """Moved along the axes of the map, metres."""
    return Pose(pose.position + np.array([x, y, z]), pose.quaternion)


def ahead(pose: Pose2D, metres: float, turn: float = 0.0) -> Pose2D:
    """So far ahead of ``pose``, and turned by ``turn``, radians."""
    return pose @ Pose2D(metres, 0.0, turn)
