"""Opening doors and drawers: take the handle, go along with it, let go, step back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from py_trees.ports import PortInformation

from behaviours.arm_motion import FREE_SPEED, follow_path
from behaviours.grasp import CLOSED, handle_grasp_candidates
from behaviours.opening import Opening, plan_opening, stations, world_at_leaf
from behaviours.skill import ALGORITHM_ERRORS, Declaration, Skill, SkillFailure, Steps, StepsTo
from bestman_bt.control.arm import FollowedMotion, FollowEnd
from bestman_bt.manipulation.collision import CollisionWorld
from bestman_bt.manipulation.kinematics import arc_path, cartesian_path
from bestman_bt.manipulation.motion_planning import Approach, approaches
from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose import GraspCandidate, rank_grasps
from bestman_bt.sensing.force_torque import WristWrench
from bestman_bt.world_model import HandleBelief

BACK_OFF = 0.12
"""Metres that the hand goes back from a handle that it has let go."""
ENOUGH = 4
"""Reachable grasps among which the best is chosen."""

CODES = {
    FollowEnd.LOCKED: "locked",
    FollowEnd.JAMMED: "jammed",
    FollowEnd.GRIP_LOST: "grip_lost",
    FollowEnd.OBSTACLE: "obstacle",
    FollowEnd.ARM_LIMIT: "out_of_reach",
    FollowEnd.TIMEOUT: "timeout",
}


@dataclass(frozen=True, eq=False)
class _HandlePlan:
    """``turn``: share of a door's turn that the hand turns with it. ``reached``: share of the way that is in reach."""

    candidate: GraspCandidate
    approach: Approach
    turn: float
    reached: float
    score: float


class _Taring:
    """Waits until the wrist has learned its offset; where the hand was not still, the older one serves."""

    def __init__(self, wrist: WristWrench) -> None:
        self._wrist = wrist

    @property
    def done(self) -> bool:
        """Whether the readings are gathered."""
        return not self._wrist.taring

    def cancel(self) -> None:
        """It ends by itself."""


class Open(Skill):
    """Open a door or drawer by a believed handle, from where the base stands; the hand lets go at the end.

    The hand feels its way: hinge or rail are learned on the way. What counts is how far the hand was carried.
    """

    INPUT_PORTS: ClassVar = {
        "articulation": PortInformation(str, description="furniture/leaf of the map"),
        "handle": PortInformation(str, description="a believed handle"),
        "opening": PortInformation(float, description="how far to open: metres of a drawer, radians of a door"),
        "force": PortInformation(float, required=False, default_value=40.0, description="closing force, newtons"),
        "max_pull": PortInformation(float, required=False, default_value=45.0, description="newtons"),
        "posture": PortInformation(str, required=False, default_value="carry", description="of the arm at the end"),
    }
    OUTPUT_PORTS: ClassVar = {
        "opened": PortInformation(float, required=False, description="how far it was opened, metres or radians")
    }
    DECLARATION = Declaration(pre=("handle_known({handle})", "not holding(any)"), effects=("open({articulation})",))

    def execute(self) -> Steps:
        """Plan, grasp, follow, let go, withdraw."""
        skills = self.skills
        name: str = self.get_input("handle")
        if skills.world.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.world.held.name}")
        belief = skills.world.handles.get(name)
        if belief is None:
            raise SkillFailure("handle_not_found", f"the handle {name} has not been seen; detect it first")
        opening = plan_opening(skills, self.get_input("articulation"), belief, self.get_input("opening"))
        plan: _HandlePlan | None = yield self.compute("grasp_planning", self._plan, opening, belief)
        if plan is None:
            raise SkillFailure("no_grasp", f"no grasp of {name} is free and within reach from here")
        closed = world_at_leaf(skills, opening, 0.0)
        yield skills.gripper.open(plan.candidate.opening)
        yield from self._move(plan.approach.pre, world_at_leaf(skills, opening, 0.0, touching=False))
        if skills.wrist_wrench is not None:
            skills.wrist_wrench.tare()
            yield _Taring(skills.wrist_wrench)
        yield from follow_path(self, plan.approach.into, closed, speed=0.35)
        yield skills.gripper.close(self.get_input("force"))
        try:
            self._check_held()
            motion = yield from self._pull(opening, plan.turn)
        except (SkillFailure, *ALGORITHM_ERRORS) as failure:
            yield from self._withdraw_after(opening, failure)
            raise
        done = motion.angle if opening.angle is not None else motion.distance
        yield from self._withdraw(opening)
        self.set_output("opened", done)
        if done < opening.asked:
            code = CODES.get(motion.end, "not_open")
            raise SkillFailure(code, f"{opening.articulation} opened by {done:.2f} of {opening.asked:.2f} only")
        self.feedback_message = f"{opening.articulation} open by {done:.2f}"

    def _plan(self, opening: Opening, belief: HandleBelief) -> _HandlePlan | None:
        skills = self.skills
        kinematics, reference = skills.algorithms.kinematics, skills.arm_positions()
        base_from_map = skills.map_from_base.inverse()
        free, contact = world_at_leaf(skills, opening, 0.0, touching=False), world_at_leaf(skills, opening, 0.0)
        plans: list[_HandlePlan] = []
        for ranked in rank_grasps(handle_grasp_candidates(skills, belief)):
            candidate = ranked.candidate
            for approach in approaches(
                kinematics,
                candidate.pre_grasp,
                candidate.grasp,
                candidate.grasp,
                reference,
                free,
                contact,
                skills.rng,
                count=4,
            ):
                for turn in opening.turns():
                    way = stations(opening, candidate.grasp, turn, base_from_map)
                    arc = arc_path(kinematics, way, approach.into[-1], skills.arm_model)
                    score = ranked.score + 0.5 * arc.margin
                    plans.append(_HandlePlan(candidate, approach, turn, arc.fraction, score))
            if sum(plan.reached >= 1.0 for plan in plans) >= ENOUGH:
                break
        return max(plans, key=lambda plan: (plan.reached, plan.score)) if plans else None

    def _check_held(self) -> None:
        gripper = self.skills.gripper
        if not gripper.pressing() or gripper.width() < self.skills.gripper_model.min_width + CLOSED:
            width = 1e3 * gripper.width()
            raise SkillFailure("grasp_failed", f"the hand closed to {width:.0f} mm and does not hold the handle")

    def _pull(self, opening: Opening, turn: float) -> StepsTo[FollowedMotion]:
        """Go along; a following that ends early tells how far it came, too."""
        skills = self.skills
        direction = skills.map_from_base.inverse().rotation @ opening.handle.opening_direction
        asked = {"distance": opening.distance} if opening.angle is None else {"angle": opening.angle}
        following = skills.arm.follow_constraint(
            direction,
            **asked,
            turn=turn,
            max_pull=self.get_input("max_pull"),
            grip=skills.gripper.watch_slip(),
            hint=opening.leaf.kind,
        )
        failure: SkillFailure | None = None
        try:
            yield following
        except SkillFailure as error:
            failure = error
        motion = following.result
        if motion is None:
            assert failure is not None
            raise failure
        done = motion.angle if opening.angle is not None else motion.distance
        if motion.end is not FollowEnd.GRIP_LOST:
            skills.world.believe_articulation(opening.articulation, max(0.0, min(done, opening.leaf.upper)))
        if failure is not None and (done < opening.asked or motion.end is FollowEnd.GRIP_LOST):
            raise SkillFailure(CODES.get(motion.end, failure.code), f"{opening.articulation}: {failure}") from failure
        return motion

    def _withdraw_after(self, opening: Opening, failure: Exception) -> Steps:
        """Withdraw; where that fails, too, what went wrong first is what is told."""
        try:
            yield from self._withdraw(opening)
        except (SkillFailure, *ALGORITHM_ERRORS) as second:
            self.explain("not_withdrawn", f"the hand could not be withdrawn: {second}")
            raise failure from second

    def _withdraw(self, opening: Opening) -> Steps:
        """Open the hand, go straight back, and take the arm to its posture.

        The leaf is where the hand has been: closer than the map's error lets any motion come.
        """
        skills = self.skills
        yield skills.gripper.open()
        position = skills.world.articulations.get(opening.articulation, 0.0)
        world = world_at_leaf(skills, opening, position, ignore=opening.bodies())
        back = skills.base_from_tool() @ Pose(np.array([0.0, 0.0, -BACK_OFF]))
        line = cartesian_path(skills.algorithms.kinematics, skills.arm_positions(), back, world.is_free)
        if len(line.path) > 1:
            yield from follow_path(self, line.path, world, speed=0.5)
        posture = skills.robot.posture(self.get_input("posture"), skills.arm_model.joint_names)
        around = world_at_leaf(skills, opening, position, touching=False)
        if not around.is_free(skills.arm_positions()):
            around = world_at_leaf(skills, opening, position, touching=False, ignore=[opening.articulation])
        yield from self._move(posture, around)

    def _move(self, goal: NDArray[np.float64], world: CollisionWorld) -> Steps:
        skills = self.skills
        timed = yield self.compute(
            "motion_planning",
            skills.algorithms.motion_planning.plan,
            skills.arm_positions(),
            [goal],
            world,
            skills.arm_model,
            skills.rng,
            FREE_SPEED,
            None,
        )
        yield skills.arm.follow(timed.trajectory, free=True)
