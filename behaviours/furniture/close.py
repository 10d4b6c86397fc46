"""Closing doors and drawers: push the front with closed fingers up to the end stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import move_free, unreached
from behaviours.contacts import handle, stopping_at
from behaviours.context import SkillContext
from behaviours.furniture.articulation import FurnitureArticulation, find_articulation, free_along, world_at_opening
from behaviours.furniture.articulation_motion import (
    LEAF_FAILS,
    error_code,
    followed,
    retreat,
    retreat_after_failure,
    tare_wrist,
)
from behaviours.parameters import CloseParameters
from behaviours.skill import (
    ALGORITHM_ERRORS,
    ArmNode,
    ArticulationName,
    Declaration,
    PostureName,
    Skill,
    SkillCoroutine,
    SkillFailure,
)
from bestman_bt.engine import In, Out
from bestman_bt.messages import Box, PlacedShape, Pose
from bestman_bt.messages.shapes import NonNegative, Positive
from bestman_bt.world_model.openness import handle_shape

if TYPE_CHECKING:
    from bestman_bt.control.arm.constraint_following import FollowGuide
    from bestman_bt.control.arm.guarded_move import GuardedOutcome
    from bestman_bt.control.arm.joint_axis import JointAxis
    from bestman_bt.manipulation.kinematics.arc_path import ArcPath
    from bestman_bt.manipulation.motion_planning.approach import Approach
    from bestman_bt.robot_model.model import GripperModel


STEP = 0.04
"""Metres of the pushed point's path between two stations."""
PALM_STEP = 0.03
"""Maximum distance between the points that represent the palm, metres."""
ACROSS = (0.0, -0.12, 0.12, -0.25, 0.25, -0.38, 0.38)
"""Places on a front, as fractions of its width and of its height."""
UP = (0.0, 0.3, -0.3, 0.15, -0.15, 0.42, -0.42)
ROLLS = tuple(math.radians(degrees) for degrees in (0, 90, 180, 270))
"""Turns of the hand about its own axis."""
PITCHES = tuple(math.radians(degrees) for degrees in (0, 35, 65))
"""Pitch angles of the hand downwards, radians."""
TILTS = tuple(math.radians(degrees) for degrees in range(-50, 51, 10))
"""Rotations of the hand about a hinge, relative to the normal of the door."""
SHUT = 0.005
"""Smallest opening, metres or radians, from which a door is pushed: a door believed shut may be open by as much."""


@dataclass(frozen=True, eq=False)
class FrontPush:
    """A candidate push: ``point`` (3,) on the front, in the front board's frame (x inwards), and the hand's
    orientation.

    ``tip``: metres from the tool frame to the fingertips, along z of the tool. ``palm``: (N, 3) metres, points of the
    palm in the tool frame. ``handles``: protruding parts of the front, in the front board's frame.
    """

    door: FurnitureArticulation
    start: float
    point: NDArray[np.float64]
    roll: float
    pitch: float
    tip: float
    palm: NDArray[np.float64]
    handles: tuple[PlacedShape, ...] = ()
    parameters: CloseParameters = field(default_factory=CloseParameters)

    @property
    def lever(self) -> float:
        """Metres that the pushed point moves per unit of the joint."""
        return self.door.lever(self.at(0.0))

    @cached_property
    def tilts(self) -> tuple[float, ...]:
        """Extra rotations of the hand about the hinge with which only the fingers touch the door, radians.

        A drawer has only 0. Empty if the palm would touch the front or a handle in each of them.
        """
        return tuple(
            tilt
            for tilt in ((0.0,) if self.door.articulation.kind == "prismatic" else TILTS)
            if self._palm_is_free(tilt)
        )

    def at(self, position: float) -> NDArray[np.float64]:
        """Return the pushed point in the map, (3,) metres, when the door is open by ``position``."""
        point: NDArray[np.float64] = self.door.front(position).apply(self.point[None])[0]
        return point

    def positions(self) -> list[float]:
        """Return the door positions at the stations, from the believed one to closed."""
        count = 1 + max(1, math.ceil(self.start * self.lever / STEP))
        return [float(position) for position in np.linspace(self.start, 0.0, count)]

    def stations(self, back: float = 0.0) -> list[list[Pose]]:
        """Return the tool poses in the map frame, per station one for each tilt; ``back``: metres in front of the
        door.
        """
        return [[self._tool(position, tilt, back) for tilt in self.tilts] for position in self.positions()]

    def axis(self) -> JointAxis:
        """Return the joint's axis in the map frame; it closes in the positive sense."""
        from bestman_bt.control.arm.joint_axis import JointAxis

        point, direction = self.door.axis()
        if self.door.articulation.kind == "prismatic":
            return JointAxis("prismatic", self.at(self.start), -direction, 0.0, 0.0)
        return JointAxis("revolute", point, -direction, self.lever, 0.0)

    def opening(self, tip: NDArray[np.float64]) -> float:
        """Return the opening, radians or metres, at which the front touches the finger tips (3,), map frame."""
        axis = self.axis()
        if axis.kind == "prismatic":
            return axis.travelled(tip, self.at(0.0))
        return axis.angle(tip, self.at(0.0))

    def guide(self, arc: ArcPath) -> FollowGuide:
        """Return the guide of hand and arm along the path."""
        from bestman_bt.control.arm.constraint_following import FollowGuide

        closed_by = self.start - np.array(self.positions()[: len(arc.path)])
        tilts = np.array([self.tilts[option] for option in arc.options])
        door = np.zeros(len(tilts)) if self.door.articulation.kind == "prismatic" else closed_by
        return FollowGuide(self.lever * closed_by, door - (tilts - tilts[0]), arc.path, np.array([0.0, 0.0, self.tip]))

    def _palm_is_free(self, tilt: float) -> bool:
        """Return whether the palm is clear of the door while the finger tips are at the pushed point.

        The contact defines the position of the front; its orientation and the contact point on it have the error of the
        map.
        """
        board, piece = self.door.articulation.shapes[0].shape, self.door.furniture
        assert isinstance(board, Box)
        palm = self._front_from_tool(tilt).apply(self.palm)
        room = -palm[:, 0] - board.size[0] / 2 - self.parameters.palm_gap
        if self.door.articulation.kind == "revolute":
            from_hinge = np.cross(self._hinge, [1.0, 0.0, 0.0])
            turned = piece.position_error / self.lever + piece.heading_error
            room -= turned * np.abs((palm - self.point) @ from_hinge)
        before = (np.abs(palm[:, 1:]) < np.array(board.size[1:]) / 2 + piece.position_error).all(axis=1)
        if (before & (room < 0.0)).any():
            return False
        gap = self.parameters.palm_gap + piece.position_error
        return all((_distance(handle, palm) > gap).all() for handle in self.handles)

    def _tool(self, position: float, tilt: float, back: float) -> Pose:
        """Return the finger tips at the pushed point, or ``back`` metres before it, in the map frame."""
        return self.door.front(position) @ self._front_from_tool(tilt, back)

    def _front_from_tool(self, tilt: float, back: float = 0.0) -> Pose:
        """Return the hand beside the front board: z of the tool into it, turned by pitch, roll and tilt."""
        inwards = Pose.from_matrix(_INWARDS) @ _about([1.0, 0.0, 0.0], -self.pitch) @ _about([0.0, 0.0, 1.0], self.roll)
        hand = _about(self._hinge, tilt) @ inwards if tilt else inwards
        return Pose(self.point - (self.tip + back) * hand.rotation[:, 2], hand.quaternion)

    @cached_property
    def _hinge(self) -> NDArray[np.float64]:
        """Return the joint's axis, (3,) unit, in the front board's frame; it does not depend on the opening."""
        axis: NDArray[np.float64] = self.door.front(self.start).rotation.T @ self.door.axis()[1]
        return axis


_INWARDS = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""front_from_tool: z inwards, y down."""


def _about(axis: object, angle: float) -> Pose:
    direction = np.asarray(axis, dtype=float)
    return Pose(np.zeros(3), np.append(math.sin(angle / 2) * direction, math.cos(angle / 2)))


def pushes(skills: SkillContext, door: FurnitureArticulation) -> Iterator[FrontPush]:
    """Yield ways to push a door shut, best points first: far from its hinge, or in the middle of a drawer; away from
    handles.
    """
    parameters = skills.parameters.close
    start = max(SHUT, skills.world.articulations.get(door.name, 0.0))
    tip, palm = skills.gripper_model.part.pad_size[1] / 2, _palm(skills.gripper_model)
    map_from_front = door.front(start)
    seen = [handle_shape(belief.handle) for belief in skills.world.handles_of(door.furniture, door.articulation)]
    handles = tuple(PlacedShape(bar.shape, map_from_front.inverse() @ bar.pose) for bar in seen)
    points = _points(door, handles, parameters)
    for pitch in PITCHES:
        here = (
            [FrontPush(door, start, point, roll, pitch, tip, palm, handles, parameters) for roll in ROLLS]
            for point in points
        )
        free = ([push for push in held if push.tilts] for held in here)
        for held in islice(filter(None, free), parameters.places):
            yield from held


def _palm(gripper: GripperModel) -> NDArray[np.float64]:
    """Return points (N, 3) all over the palm of a hand with closed fingers, tool frame, ``PALM_STEP`` apart."""
    from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize

    centres, halves = HandShape(gripper, HandSize()).boxes(np.array([gripper.part.min_width]))
    centre, half = centres[0, 2], halves[0, 2]
    steps = [np.linspace(-extent, extent, 2 + int(2 * extent / PALM_STEP)) for extent in half]
    points: NDArray[np.float64] = centre + np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3)
    return points


def _distance(placed: PlacedShape, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance (N,), metres, from a box to points (N, 3) in the frame of its pose; 0 inside."""
    assert isinstance(placed.shape, Box)
    outside = np.abs(placed.pose.inverse().apply(points)) - np.array(placed.shape.size) / 2
    distance: NDArray[np.float64] = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
    return distance


def _points(
    door: FurnitureArticulation, handles: Sequence[PlacedShape], parameters: CloseParameters
) -> list[NDArray[np.float64]]:
    front = door.articulation.shapes[0]
    assert isinstance(front.shape, Box)
    thickness, width, height = front.shape.size
    grid = np.array([[-thickness / 2, y * width, z * height] for y in ACROSS for z in UP])
    free = np.ones(len(grid), dtype=bool)
    for bar in handles:
        free &= _distance(bar, grid) > parameters.handle_clearance
    aside = np.linalg.norm(grid[:, 1:] / (width, height), axis=1)
    if door.articulation.kind == "prismatic":
        order = np.argsort(aside, kind="stable")
    else:
        levers = np.array([door.lever(point) for point in door.front(0.0).apply(grid)])
        free &= levers > parameters.least_lever * levers.max()
        order = np.argsort(np.abs(levers / levers.max() - 0.8) + 0.5 * np.abs(grid[:, 2] / height), kind="stable")
    return [grid[index] for index in order if free[index]]


@dataclass(frozen=True, eq=False)
class _Plan:
    push: FrontPush
    approach: Approach
    guide: FollowGuide
    score: float


class Close(ArmNode, Skill):
    """Push a door or drawer shut with closed fingers on its front, without moving the base. The hand starts at the
    believed opening, moves until it touches the front, follows the mapped joint, and stops at a resistance. Near the
    closed position this is the end stop; earlier it is a jam, reported with the remaining opening.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("force_torque",)
    articulation = In[str](ArticulationName, "furniture/name of the map")
    opening = In[float](NonNegative, "how far it may stay open: metres or radians", default=0.02)
    max_push = In[float](Positive, "newtons", default=40.0)
    posture = In[str](PostureName, "final posture of the arm", default="carry")
    left = Out(float, "how far it may still be open, metres or radians")
    FAILS: ClassVar = {
        **LEAF_FAILS,
        "no_push": "stand elsewhere: FindCloseStand, NavigateTo",
        "not_found": "its opening differs from the belief: FindLookStand, DetectHandle",
        "jammed": "push from elsewhere: FindCloseStand, NavigateTo; or open it again to clear the jam: Open",
        "lost_contact": "it is not at its believed place: FindLookStand, DetectHandle, then Close",
    }
    DECLARATION = Declaration(pre=("not holding(any)",), effects=("not open({articulation})",))

    def execute(self) -> SkillCoroutine[None]:
        """Plan, close the fingers, touch, push, withdraw."""
        skills = self.skills
        if skills.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.held.name}")
        door, posture = find_articulation(skills, self.articulation), self.posture
        door.check_opening("opening", self.opening)
        plan: _Plan | None = yield self.compute("grasp_planning", self._plan, door)
        if plan is None:
            raise unreached(
                skills,
                SkillFailure("no_push", f"the arm cannot push {door.name} shut from here"),
                (skills.map_from_base.inverse() @ at for push in pushes(skills, door) for at in push.stations()[0]),
                world_at_opening(skills, door, skills.world.articulations.get(door.name, 0.0), "fingers"),
            )
        yield skills.gripper.close(skills.parameters.close.finger_force)
        yield from move_free(self, [plan.approach.pre], world_at_opening(skills, door, plan.push.start, "free"))
        yield from tare_wrist(self)
        with self.touching(handle(door.name, stopping_at(self.max_push))):
            try:
                start = yield from self._touch(plan.push)
                left = yield from self._push(plan, start)
            except (SkillFailure, *ALGORITHM_ERRORS) as failure:
                yield from retreat_after_failure(self, door, posture, failure)
                raise
            yield from retreat(self, door, posture)
        self.left = left
        self.feedback_message = f"{door.name} closed, to {left:.3f} by the map"

    def _plan(self, door: FurnitureArticulation) -> _Plan | None:
        from bestman_bt.manipulation.kinematics.arc_path import ArcSearch
        from bestman_bt.manipulation.motion_planning.approach import ApproachPoses, approaches

        skills = self.skills
        kinematics, base_from_map = skills.kinematics, skills.map_from_base.inverse()
        plans: list[_Plan] = []
        for push in pushes(skills, door):
            positions = push.positions()
            free = world_at_opening(skills, door, push.start, "free")
            contact = world_at_opening(skills, door, push.start, "fingers")
            way = [[base_from_map @ pose for pose in poses] for poses in push.stations()]
            for option, before in enumerate(push.stations(skills.parameters.close.standoff)[0]):
                for approach in approaches(
                    kinematics,
                    ApproachPoses(base_from_map @ before, way[0][option], way[0][option]),
                    skills.arm_positions(),
                    free,
                    contact,
                    skills.rng,
                ):
                    is_free = free_along(skills, door, positions, "fingers")
                    arc = ArcSearch().path_through(
                        kinematics, way, 0, option, approach.into[-1], skills.arm_model, is_free
                    )
                    if arc.complete:
                        score = arc.margin - 0.2 * abs(push.tilts[option])
                        plans.append(_Plan(push, approach, push.guide(arc), score))
            if plans:
                return max(plans, key=lambda plan: plan.score)
        return None

    def _tip(self, push: FrontPush, base_from_tool: Pose) -> Pose:
        return self.skills.map_from_base @ base_from_tool @ Pose(np.array([0.0, 0.0, push.tip]))

    def _touch(self, push: FrontPush) -> SkillCoroutine[float]:
        """Move straight until the front is felt; return the opening there."""
        skills = self.skills
        tool = skills.base_from_tool()
        parameters = skills.parameters.close
        distance = parameters.standoff + parameters.search_distance
        touch: GuardedOutcome = yield skills.arm.move_until(
            tool.rotation[:, 2], parameters.touch_speed, distance, parameters.touch_force
        )
        position = push.opening(self._tip(push, touch.tool).position)
        if not touch.touched:
            why = f"the front of {push.door.name} is not at its believed opening of {push.start:.2f}"
            raise SkillFailure("not_found", f"{why}: nothing is there up to {position:.2f}")
        return position

    def _push(self, plan: _Plan, start: float) -> SkillCoroutine[float]:
        """Push until something resists; how far it may be open then."""
        from bestman_bt.control.arm.constraint_following import FollowEnd, FollowGoal

        skills, push, door = self.skills, plan.push, plan.push.door
        base_from_map = skills.map_from_base.inverse()
        axis, base = push.axis(), base_from_map.rotation
        tip = self._tip(push, skills.base_from_tool()).position
        beyond = max(0.0, start) + skills.parameters.close.beyond_closed / push.lever
        following = skills.arm.follow_constraint(
            base @ axis.tangent(tip),
            FollowGoal(
                distance=beyond if axis.kind == "prismatic" else math.inf,
                angle=beyond if axis.kind == "revolute" else math.inf,
                end_stop=push.lever * (max(0.0, start) - self._uncertainty(push)),
                max_pull=self.max_push,
                guide=plan.guide,
                axis=replace(axis, point=base_from_map.apply(axis.point[None])[0], direction=base @ axis.direction),
                learns=False,
            ),
        )
        motion, failure = yield from followed(following)
        left = max(0.0, push.opening(self._tip(push, motion.tool).position))
        resisted = motion.end in (FollowEnd.JAMMED, FollowEnd.LOCKED)
        if resisted and left <= self._uncertainty(push):
            skills.world.believe_articulation(door.name, 0.0)
            return left
        if failure is None:
            raise SkillFailure("lost_contact", f"no resistance up to the closed position of {door.name}")
        skills.world.believe_articulation(door.name, min(left, door.articulation.upper))
        if left > self.opening:
            self.left = left
            code = "jammed" if resisted else error_code(motion.end)
            raise SkillFailure(code, f"{door.name} is still open by {left:.2f}: {failure}", failure.failure)
        return left

    def _uncertainty(self, push: FrontPush) -> float:
        """Return how far from shut, by the map, the end stop may be felt, metres or radians."""
        piece = push.door.furniture
        turned = piece.heading_error * (1.0 if push.door.articulation.kind == "revolute" else 0.0)
        tolerance = self.skills.parameters.close.end_stop_tolerance
        return (tolerance + 1.5 * piece.position_error) / push.lever + turned
