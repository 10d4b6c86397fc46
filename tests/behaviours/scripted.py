"""Skills on controllers that a test ends: real beliefs, map, models and kinematics, and no physics."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from behaviours.computation import InlineComputation
from behaviours.contacts import Contact
from behaviours.context import SkillContext
from behaviours.parts import parts_by_kind
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import RUNNING, ManualClock, Node, Tree, load_tree
from bestman_bt.messages import MotionErrorCode, Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel, GripperModel
from bestman_bt.runtime.algorithms import Algorithms
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.world_model.world_model import BasePose
from hal.api import Motion
from tests.behaviours.at_the_table import PERIOD, tree_of
from tests.robot_models import with_part

UNDER_WAY = object()
"""How a command comes out that a test ends itself, or that a halt cancels."""
ASKEW = Pose2D(0.7, -1.1, 2.1)
"""Where the base of these tests stands: no axis of it is one of the map's."""


class DeclaredContacts(list[Contact]):
    """The current contacts of a context that also keeps all that were ever ``declared``."""

    def __init__(self) -> None:
        super().__init__()
        self.declared: list[Contact] = []

    def __iadd__(self, contacts: Iterable[Contact]) -> DeclaredContacts:
        self.declared += contacts
        return super().__iadd__(contacts)


class ScriptedController:
    """Each of ``commands`` gives back a handle that succeeds at once with nothing, or comes out as ``ends`` says.

    ``ends``: command → how its next handles come out: a result, ``UNDER_WAY``, or the code of a failure. ``asked``: the
    commands and their arguments, in their order; ``handles``: what they gave back. Other names are ``values``.
    """

    def __init__(self, *commands: str, **values: Any) -> None:
        self._commands = commands
        self.ends: dict[str, list[Any]] = defaultdict(list)
        self.asked: list[tuple[Any, ...]] = []
        self.handles: list[Motion[Any]] = []
        self.__dict__.update(values)

    def __getattr__(self, name: str) -> Callable[..., Motion[Any]]:
        if name.startswith("_") or name not in self._commands:
            raise AttributeError(name)
        return lambda *arguments, **options: self._begin(name, *arguments, *options.values())

    def carry(self, mass: float, centre: Any) -> None:
        """An arm is told what its hand holds; nothing comes of it here."""

    def for_planning(self, positions: Any) -> Any:
        """No other arm moves here."""
        return positions

    def _begin(self, name: str, *arguments: Any) -> Motion[Any]:
        handle: Motion[Any] = Motion()
        self.asked.append((name, *arguments))
        self.handles.append(handle)
        end = self.ends[name].pop(0) if self.ends[name] else None
        if isinstance(end, MotionErrorCode):
            handle.fail(end, f"{name} came to an end as {end.value}")
        elif end is not UNDER_WAY:
            handle.succeed(end)
        return handle

    @property
    def under_way(self) -> list[Motion[Any]]:
        """What has not ended."""
        return [handle for handle in self.handles if not handle.done]


@cache
def _prepared(task: str, seed: int, settings: tuple[str, ...]) -> tuple[ResolvedConfig, Algorithms]:
    """What tests leave as it is."""
    setup = prepare(load_run(task, seed=seed, settings=settings))
    return setup, Algorithms(setup.config, setup.robot_model, setup.world_model.map)


def scripted_skills(task: str = "fetch_cup", base: Pose2D = ASKEW, *settings: str, seed: int = 3) -> Any:
    """A context whose robot believes to stand at ``base``, as a SkillContext and with ``setup`` beside it."""
    setup, algorithms = _prepared(task, seed, settings)
    skills: Any = SkillContext.__new__(SkillContext)
    skills.kinds = parts_by_kind(setup.robot_model, setup.robot_model.parts)
    skills.setup, skills.robot, skills.make_accessor = setup, setup.robot_model, algorithms.of_arm
    skills.clock, skills.world = ManualClock(50.0), setup.world_model.initial_beliefs()
    skills.world.base = BasePose(base, 0.01, 0.01, 50.0)
    skills.failures, skills.observations, skills.costs = [], {}, defaultdict(float)
    skills.parameters = setup.skill_parameters
    skills.contacts, skills.handled = [], None
    skills.computation, skills.rng = InlineComputation(skills.clock), np.random.default_rng(seed)
    arm, gripper = next(iter(setup.robot_model.of(ArmModel))), next(iter(setup.robot_model.of(GripperModel)))
    skills.arm_name = arm
    skills.arm = ScriptedController("follow", "move_until", "follow_constraint", name=arm)
    hand = with_part(setup.robot_model.of(GripperModel)[gripper], max_force=70.0)
    skills.gripper = ScriptedController("open", "close", "release", name=gripper, model=hand)
    skills.gripper.width, skills.gripper.pressing = lambda: 0.08, lambda: True
    skills.base = ScriptedController("follow", "drive", "turn", "rotate_to", "park", stuck=False)
    skills.base.lidar = SimpleNamespace(height=0.2)
    skills.base.localisation = SimpleNamespace(lost=False)
    skills.head = ScriptedController("move_to", "look_at")
    posture = setup.robot_model.posture("carry", setup.robot_model.of(ArmModel)[arm].joint_names)
    joints = dict(zip(setup.robot_model.of(ArmModel)[arm].joint_names, posture.tolist(), strict=True))
    skills.joints = SimpleNamespace(positions=lambda: joints)
    skills.wrist_wrench = skills.wrist_camera = skills.camera = None
    skills.tactile = ()
    return skills


def register(skills: Any, leaf: type[Node]) -> None:
    """Let trees use a leaf of a test."""
    if leaf.__name__ not in skills.setup.registry:
        skills.setup.registry.register(leaf)


def load(skills: Any, body: str, **entries: Any) -> Tree:
    """A tree of leaves on these skills, with ``entries`` on its blackboard."""
    tree = load_tree(tree_of(body), skills.setup.registry, context=skills, clock=skills.clock)
    for name, value in entries.items():
        tree.blackboard.set(name, value)
    return tree


def run(skills: Any, tree: Tree, ticks: int = 400) -> int:
    """Tick with time passing in between; stops where the root does not run any more. Returns the last status."""
    for _ in range(ticks):
        status = tree.tick_once()
        if status != RUNNING:
            break
        skills.clock.advance(PERIOD)
    return status


def codes(skills: Any) -> list[str]:
    """What was told, in its order."""
    return [failure.error_code for failure in skills.failures]


def map_from(base: Pose2D, x: float, y: float, z: float) -> np.ndarray:
    """A point of the base frame in the map, by hand: (3,) metres."""
    c, s = np.cos(base.theta), np.sin(base.theta)
    return np.array([base.x + c * x - s * y, base.y + s * x + c * y, z])


def in_base(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """base_from_tool of a hand that points down."""
    return Pose.from_xyz_rpy((x, y, z), (np.pi, 0.0, yaw))
