"""Pushing: the fingertips, side by side, slide an object over its surface to a goal.

Two adjacent contacts make the push stable: the object rotates until it rests against both, and then moves with them
(Lynch and Mason, "Stable pushing: mechanics, controllability, and planning", IJRR 1996).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, approach_object, follow_path, move_free, unreached
from behaviours.contacts import push, stopping_at, support, surface_below
from behaviours.context import SkillContext
from behaviours.manipulation.base_placement import FindStandAtFurniture, StandTarget
from behaviours.parameters import PushParameters
from behaviours.perception.surfaces import UNKNOWN_SURFACE, find_surface
from behaviours.skill import ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Failure, MotionErrorCode, MotionObstacle, MotionStage, ObjectModel, Pose
from bestman_bt.messages.pose import squared_distance_to_segment
from bestman_bt.messages.shapes import Positive
from bestman_bt.world_model.semantic_map import MapFurniture
from bestman_bt.world_model.world_model import ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.control.arm.guarded_move import GuardedOutcome
    from bestman_bt.manipulation.base_placement import BasePlacement
    from bestman_bt.manipulation.collision.base import CollisionWorld
    from bestman_bt.manipulation.collision.planning_scene import PlanningScene


TILTS = tuple(math.radians(tilt) for tilt in (45.0, 35.0, 55.0, 65.0))
"""Angles by which the hand leans back from the object, so that the fingertips touch it before the palm does."""
FINE = 0.002
"""Distance between two waypoints of the approach, metres; it ends before the first one in contact."""
ALONG = 0.05
"""Largest distance between two poses of the hand along a push at which a base placement is checked, metres."""
DETOURS = (0.12, 0.2)
"""Metres by which an object is pushed aside if it cannot be pushed straight to its goal, the shortest possible."""
BESIDE = tuple(math.radians(bearing) for bearing in (45.0, -45.0, 90.0, -90.0, 135.0, -135.0, 180.0))
"""Directions to push it aside, relative to the direction of its goal."""


@dataclass(frozen=True, eq=False)
class PushPlan:
    """A planned push. ``pre``: (n,) radians, the end of the free motion. ``into``: (N, n), the straight approach to
    just before the object.

    ``direction``: (3,) unit, base frame. ``gap``: metres from the end of ``into`` to the object. ``distance``: metres
    to push the object.
    """

    pre: NDArray[np.float64]
    into: NDArray[np.float64]
    direction: NDArray[np.float64]
    gap: float
    distance: float
    cost: float


class Push(ArmNode, Skill):
    """Push a located object straight to a goal on its surface; the wrist sensor detects obstacles.

    The next observation of the object determines the real displacement. Remedies: ``no_approach``: another base
    placement; ``blocked``: look again, an unseen obstacle is in the path; ``not_found``: detect the object first.
    """

    REQUIRES = ("arm", "gripper")
    object = In[str](ObjectName, "a located object")
    goal = In(Pose, "target of its middle, in the map frame; height and rotation are free")
    speed = In[float](Positive, "m/s", default=0.05)
    max_force = In[float](Positive, "limit of the force on the hand, newtons", default=15.0)
    pushed = Out(float, "metres that the hand moved with the object")
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **ARM_PLANNING_FAILS,
        "hand_not_empty": "put the held object down: FindPlacePose, PlaceOn, Release",
        "not_found": "DetectObject first",
        "collision": "it touched something on the way in: DetectObject; if the robot is stopped: ClearStop",
        "no_approach": "stand elsewhere: FindPushStand, NavigateTo",
        "blocked": "an unseen obstacle is in the path: DetectObjects",
        "off_surface": "a goal farther from the edge",
        "not_withdrawn": "Retreat",
    }
    DECLARATION = Declaration(
        pre=("located({object})", "not holding(any)", "free({goal})"), effects=("at({object}, {goal})",)
    )

    def execute(self) -> SkillCoroutine[None]:
        """Plan, set the fingers, approach, push with force monitoring, retreat."""
        skills, parameters = self.skills, self.skills.parameters.push
        name: str = self.object
        goal: Pose = self.goal
        if skills.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.held.name}")
        belief = skills.world.objects.get(name)
        if belief is None:
            raise SkillFailure("not_found", f"the {name} has not been seen; detect it first")
        way = goal.position[:2] - belief.pose.position[:2]
        if float(np.linalg.norm(way)) < parameters.goal_tolerance:
            self.feedback_message = f"the {name} is already there"
            return
        self._check_goal(belief, goal)
        yield skills.gripper.open(spread(belief.model, skills.gripper_model.max_width, parameters))
        plan: PushPlan | None = yield self.compute("grasp_planning", self._plan, belief, goal)
        if plan is None:
            base_from_map = skills.map_from_base.inverse()
            base_from_object = base_from_map @ belief.pose
            direction, _ = _way(base_from_object, base_from_map @ goal)
            raise unreached(
                skills,
                SkillFailure("no_approach", f"the arm has no free path to push the {name} there from this base pose"),
                push_tool_poses(belief.model, base_from_object, direction, parameters),
                skills.arm_world(self._untouched(belief)),
            )
        yield from move_free(self, [plan.pre])
        stands_on = belief.surface or surface_below(skills.world, belief.pose)
        most = stopping_at(self.max_force)
        with self.touching(push(name, most), support(name, stands_on, most)):
            yield from self._push(belief, plan)

    def _push(self, belief: ObjectBelief, plan: PushPlan) -> SkillCoroutine[None]:
        skills, name = self.skills, belief.name
        yield from approach_object(self, plan.into, skills.arm_world(self._untouched(belief)))
        start = skills.base_from_tool()
        unreachable: SkillFailure | None = None
        try:
            outcome: GuardedOutcome = yield skills.arm.move_until(
                plan.direction, self.speed, plan.gap + plan.distance, self.max_force
            )
            distance = outcome.distance
        except SkillFailure as failure:
            if failure.code != MotionErrorCode.UNREACHABLE:
                raise
            unreachable = failure  # the object has moved, and the hand still touches it
            distance = float((skills.base_from_tool().position - start.position) @ plan.direction)
        pushed = max(0.0, distance - plan.gap)
        self._believe(belief, pushed * plan.direction)
        self.pushed = pushed
        yield from self._withdraw(name, plan)
        if unreachable is not None:
            raise unreachable
        way_words = f"{100 * pushed:.0f} of {100 * plan.distance:.0f} cm"
        if outcome.touched:
            force = float(np.linalg.norm(outcome.force))
            raise SkillFailure("blocked", f"the {name} resists with {force:.0f} N after {way_words}")
        self.feedback_message = f"{name} pushed by {way_words}"

    def _check_goal(self, belief: ObjectBelief, goal: Pose) -> None:
        """Check that the object will stand on its surface with clearance."""
        room = edge_room(self.skills, belief, goal.position)
        if room < self.skills.parameters.push.edge_margin:
            raise SkillFailure("off_surface", f"the goal is {100 * room:.0f} cm from the edge of {belief.surface}")

    def _plan(self, belief: ObjectBelief, goal: Pose) -> PushPlan | None:
        from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path

        skills, parameters = self.skills, self.skills.parameters.push
        kinematics, reference = skills.kinematics, skills.arm_positions()
        base_from_map = skills.map_from_base.inverse()
        base_from_object = base_from_map @ belief.pose
        scene = self._untouched(belief)
        free = skills.arm_world(replace(scene, padding=scene.padding + parameters.approach_gap))
        direction, distance = _way(base_from_object, base_from_map @ goal)
        plans = []
        for behind in push_tool_poses(belief.model, base_from_object, direction, parameters):
            beyond = Pose(behind.position + (parameters.standoff + 0.05) * direction, behind.quaternion)
            for pre in kinematics.solve(behind, reference, skills.rng, 2, is_valid=free.is_free).solutions:
                into = cartesian_path(kinematics, pre, beyond, free.is_free, max_translation=FINE)
                if into.complete or len(into.path) < 2:
                    continue  # it does not reach the object, or an obstacle is in the way immediately
                here = kinematics.tool_pose(into.path[-1])
                touching = self._is_touched(free, into.path[-1], here, direction, belief.name)
                pushed = Pose(here.position + distance * direction, here.quaternion)
                world = self._pushing_world(scene, belief, here.inverse() @ base_from_object)
                if touching and cartesian_path(kinematics, into.path[-1], pushed, world.is_free).complete:
                    cost = float(np.abs(pre - reference).max())
                    gap = scene.padding + parameters.approach_gap + FINE / 2
                    plans.append(PushPlan(pre, into.path, direction, gap, distance, cost))
        return min(plans, key=lambda plan: plan.cost) if plans else None

    def _is_touched(
        self,
        world: CollisionWorld,
        positions: NDArray[np.float64],
        base_from_tool: Pose,
        direction: NDArray[np.float64],
        name: str,
    ) -> bool:
        """Return whether the fingers, and nothing else, touch the object next: a little further on, to be sure."""
        onward = Pose(
            base_from_tool.position + self.skills.parameters.push.palm_clearance * direction, base_from_tool.quaternion
        )
        following = self.skills.kinematics.track(onward, positions)
        if following is None:
            return False
        fingers = self.skills.gripper_model.part.finger_links
        pairs = world.colliding_pairs(following)
        return bool(pairs) and all(name in pair and any(finger in pair for finger in fingers) for pair in pairs)

    def _untouched(self, belief: ObjectBelief) -> PlanningScene:
        """Return the scene with the object exactly where it is believed to be."""
        scene = self.skills.planning_scene()
        exact = [replace(o, padding=0.0) for o in scene.obstacles if o.name == belief.name]
        return scene.adding(*exact)

    def _pushing_world(self, scene: PlanningScene, belief: ObjectBelief, tool_from_object: Pose) -> CollisionWorld:
        """Return the scene in which the object moves with the hand, slides on its surface, and touches neither the palm
        nor anything else.
        """
        from bestman_bt.manipulation.collision.planning_scene import AttachedObject
        from bestman_bt.manipulation.collision.scene_from_world_model import finger_contacts

        skills = self.skills
        moving = AttachedObject(
            belief.name, belief.model.collision, skills.arm_model.tool_frame, tool_from_object, frozenset()
        )
        supports = [o.name for o in scene.obstacles if o.name.endswith("/surface")]
        if belief.surface is not None:
            supports.append(belief.surface.partition("/")[0])
        pairs = [*finger_contacts(skills.robot, belief.name, skills.arm.name), *((belief.name, s) for s in supports)]
        return skills.arm_world(scene.holding(moving).allowing(*pairs))

    def _believe(self, belief: ObjectBelief, went: NDArray[np.float64]) -> None:
        """Believe that the object moved with the hand by ``went`` (3,), metres, base frame, as far as this was felt."""
        from bestman_bt.perception.occupancy import freed

        skills = self.skills
        if skills.world.occupancy is not None:
            left = [replace(part, pose=belief.pose @ part.pose) for part in belief.model.collision]
            skills.world.occupancy = freed(skills.world.occupancy, left)
        moved = Pose(belief.pose.position + skills.map_from_base.rotation @ went, belief.pose.quaternion)
        skills.world.objects[belief.name] = replace(
            belief, pose=moved, position_std=max(belief.position_std, 0.01), stamp=skills.clock.now()
        )

    def _withdraw(self, name: str, plan: PushPlan) -> SkillCoroutine[None]:
        """Retreat straight as far as it is free; the object is ahead of the hand and not in the path."""
        from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path

        skills = self.skills
        here = skills.base_from_tool()
        world = skills.arm_world(skills.planning_scene(ignore=[name]))
        back = Pose(here.position - skills.parameters.push.standoff * plan.direction, here.quaternion)
        line = cartesian_path(skills.kinematics, skills.arm_positions(), back, world.is_free)
        if len(line.path) < 2:
            raise SkillFailure("not_withdrawn", f"the hand cannot go back from the {name}: {line.failure}")
        yield from follow_path(self, line.path, world, skills.parameters.arm_motion.retreat_speed)


def spread(model: ObjectModel, max_width: float, parameters: PushParameters) -> float:
    """Return the distance between the fingers for pushing, metres."""
    return min(parameters.finger_spread * float(min(model.size[:2])), max_width)


def push_tool_poses(
    model: ObjectModel, frame_from_object: Pose, direction: NDArray[np.float64], parameters: PushParameters
) -> Iterator[Pose]:
    """Yield tool poses behind an object to be pushed in ``direction`` (3,): the hand tilted back, either side up."""
    from scipy.spatial.transform import Rotation

    radius = float(np.linalg.norm(model.size[:2])) / 2
    bottom = float(frame_from_object.position[2] + model.bounds()[0, 2])
    behind = frame_from_object.position - (radius + parameters.standoff) * direction
    position = np.array([behind[0], behind[1], bottom + parameters.tip_height])
    for tilt in TILTS:
        along = math.sin(tilt) * direction - math.cos(tilt) * np.array([0.0, 0.0, 1.0])
        forward = math.cos(tilt) * direction + math.sin(tilt) * np.array([0.0, 0.0, 1.0])
        for side in (-1.0, 1.0):
            axes = np.column_stack([side * forward, np.cross(along, side * forward), along])
            yield Pose(position, Rotation.from_matrix(axes).as_quat())


def _way(base_from_object: Pose, base_from_goal: Pose) -> tuple[NDArray[np.float64], float]:
    """Return the horizontal unit direction (3,) and the distance, metres."""
    way = base_from_goal.position - base_from_object.position
    way[2] = 0.0
    distance = float(np.linalg.norm(way))
    return way / distance, distance


@dataclass(frozen=True, eq=False)
class _PushTarget(StandTarget):
    towards: NDArray[np.float64]
    onward: StandTarget | None = None


class FindPushStand(FindStandAtFurniture):
    """Choose a base placement to push a seen object to a goal: the arm reaches behind it and along the whole push.

    If an obstacle occupies the place of the hand or the path of the object, ``towards`` is an intermediate place beside
    the object from which it can then be pushed to the goal; of this second push, only the start and the end are checked
    for reach. Without such a place, or if ``towards`` is not mapped, the failure names the obstacle. If the object is
    already at its goal, ``stand`` is the current pose of the base. Each further call for the same object and goal gives
    another placement, until none is left.
    """

    REQUIRES = ("base", "lidar", "arm")
    towards = Out(Pose, "where to push it now, in the map frame: the goal, or a place on the way there")
    FAILS: ClassVar = {"not_found": "DetectObject first"}
    DECLARATION = Declaration(pre=("visible({object})",), effects=("stand_known({surface})",))

    def execute(self) -> SkillCoroutine[None]:
        """Return the best placement that has not been returned yet, and where to push the object from there."""
        belief, there = self._pushed()
        if float(np.linalg.norm(there - belief.pose.position)) < self.skills.parameters.push.goal_tolerance:
            self.stand, self.towards = self.skills.world.base.pose, Pose(there)
            self.feedback_message = f"the {belief.name} is already there"
            return
        yield from super().execute()
        assert isinstance(self._reached, _PushTarget)
        self.towards = Pose(self._reached.towards)

    def _pushed(self) -> tuple[ObjectBelief, NDArray[np.float64]]:
        """Return the object and its goal (3,) in the map frame, at the object's height."""
        name: str = self.object or ""
        goal: Pose | None = self.goal
        belief = self.skills.world.objects.get(name)
        if belief is None or goal is None:
            raise SkillFailure("not_found", f"the {name or 'object'} has not been seen, or no goal is given")
        return belief, np.array([*goal.position[:2], belief.pose.position[2]])

    def _targets(self) -> list[StandTarget]:
        belief, there = self._pushed()
        model, here = belief.model, belief.pose.position
        objects = self.skills.world.objects.values()
        others = [other for other in objects if other is not belief and _overlap_in_height(belief, other)]
        self._between = [other.name for other in others if not _passes(belief, other, here, there)]
        # The second leg only has to be likely: after the first, the next call plans from where the object is then.
        round_about = (
            replace(self._straight(model, here, via), onward=self._straight(model, via, there, ends_only=True))
            for via in (self._beside_the_object(belief, there) if self.attributes.get("towards") else ())
            if all(_passes(belief, other, *leg) for other in others for leg in ((here, via), (via, there)))
        )
        return [self._straight(model, here, there), *round_about]

    def _first_reached(
        self, furniture: MapFurniture, targets: Sequence[StandTarget]
    ) -> SkillCoroutine[tuple[BasePlacement, ...]]:
        return super()._first_reached(furniture, targets[1:] if self._between else targets)

    def _why_none(self, furniture: MapFurniture, target: StandTarget) -> SkillFailure:
        if not self._between:
            return super()._why_none(furniture, target)
        name: str = self.object or ""
        words = f"the {self._between[0]} stands between the {name} and its goal"
        at = MotionObstacle(MotionStage.STAND, ((name, self._between[0]),))
        return SkillFailure("no_stand", words, Failure("no_stand", words, obstacle=at))

    def _rank(self, furniture: MapFurniture, target: StandTarget) -> tuple[BasePlacement, ...]:
        stands = super()._rank(furniture, target)
        if stands and isinstance(target, _PushTarget) and target.onward is not None:
            return stands if super()._rank(furniture, target.onward) else ()
        return stands

    def _ignored(self) -> list[str]:
        return [self.object or ""]

    def _straight(
        self, model: ObjectModel, start: NDArray[np.float64], end: NDArray[np.float64], ends_only: bool = False
    ) -> _PushTarget:
        """Return the tool poses along a push from ``start`` to ``end``, (3,) each, map frame; or the first and last."""
        parameters = self.skills.parameters.push
        direction = (end - start) / max(float(np.linalg.norm(end - start)), 1e-6)
        further = end - start + parameters.standoff * direction
        steps = 1 if ends_only else math.ceil(float(np.linalg.norm(further)) / ALONG)
        shares = np.linspace(0.0, 1.0, 1 + steps)
        hands = push_tool_poses(model, Pose(start), direction, parameters)
        ways = [tuple(Pose(hand.position + share * further, hand.quaternion) for share in shares) for hand in hands]
        return _PushTarget(ways, start[:2], end)

    def _beside_the_object(self, belief: ObjectBelief, goal: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
        """Yield places (3,) on the surface from which the goal may be reached where straight on it is not."""
        here = belief.pose.position
        ahead = math.atan2(*(goal - here)[1::-1])
        for detour, bearing in product(DETOURS, BESIDE):
            via = here + detour * np.array([math.cos(ahead + bearing), math.sin(ahead + bearing), 0.0])
            if edge_room(self.skills, belief, via) >= self.skills.parameters.push.edge_margin:
                yield via


def edge_room(skills: SkillContext, belief: ObjectBelief, position: NDArray[np.float64]) -> float:
    """Return the distance, metres, of an object at ``position`` (3,), map frame, from the edge of its surface."""
    if belief.surface is None:
        return math.inf
    furniture, surface = find_surface(skills, belief.surface)
    local = (furniture.pose.to_pose() @ surface.pose).inverse().apply(position)
    room = np.array(surface.size) / 2 - np.abs(local[:2]) - belief.model.size[:2].max() / 2
    return float(room.min())


def _overlap_in_height(belief: ObjectBelief, other: ObjectBelief) -> bool:
    """Return whether two objects overlap in height."""
    (lower, upper), (bottom, top) = (one.pose.position[2] + one.model.bounds()[:, 2] for one in (belief, other))
    return bool(bottom < upper and lower < top)


def _passes(belief: ObjectBelief, other: ObjectBelief, start: NDArray[np.float64], end: NDArray[np.float64]) -> bool:
    """Return whether an object that is pushed from ``start`` to ``end``, (3,) each, stays clear of another one."""
    apart = squared_distance_to_segment(other.pose.position[:2, None], start[:2], end[:2])[0]
    sizes = belief.model.size[:2].max() + other.model.size[:2].max()
    return bool(math.sqrt(apart) > sizes / 2)
