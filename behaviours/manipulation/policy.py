"""Execution of learned policies: action chunks are checked before they move anything, and the tool stays in its box."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import hand_contacts
from behaviours.computation import TimeSource, Until
from behaviours.contacts import Contact, grasp, support, surface_below
from behaviours.context import SkillContext
from behaviours.perception.perceive import NO_CAMERA
from behaviours.skill import ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.control import MotionStatus
from bestman_bt.engine import In, OneOf, Out
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.trajectory.base import SpeedScale
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import Positive
from bestman_bt.world_model.world_model import HeldObject

if TYPE_CHECKING:
    from bestman_bt.control import Motion
    from bestman_bt.control.gripper import GripperOutcome
    from bestman_bt.manipulation.policy.base import ActionChunk, Observation, Policy
    from bestman_bt.manipulation.policy.chunk_stream import StreamedMotion
    from bestman_bt.manipulation.policy.specification import PolicySpecification, Workspace


POLICY_SPEED = SpeedScale(0.5, 0.35)
OUTSIDE = 0.02
"""Metres by which the measured tool may leave the box before the arm is stopped; plans may not leave it at all."""
CLOSED = 0.002
"""Gripper width, metres, below which an action means close; also the smallest change that counts as another width."""


class PolicyMotion:
    """The motion of a policy until the clock's ``deadline``, with the tool in ``box``.

    ``closed_at``: base_from_tool at the last close command of the gripper. Nothing moves after ``cancel``.
    """

    def __init__(self, skills: SkillContext, box: Workspace, deadline: float) -> None:
        from bestman_bt.manipulation.policy.chunk_stream import ChunkStream

        self._skills, self.box, self.deadline = skills, box, deadline
        self.stream = ChunkStream(skills.arm_model, speed=POLICY_SPEED)
        self.closed_at: Pose | None = None
        self._arm: Motion[None] | None = None
        self._fingers: Motion[GripperOutcome] | None = None
        self._width = skills.gripper.width()
        self._chunk: tuple[ActionChunk, float] | None = None

    @property
    def asked_width(self) -> float:
        """The last commanded gripper width, metres."""
        return self._width

    def asked(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the commanded positions and velocities of the arm now, (n,) each; the measured ones at rest.

        Deltas added to commanded positions compensate for gravity and lag, and measured velocities are coarse.
        """
        now, motion = self._skills.clock.now(), self.stream.motion
        if motion is not None and self.stream.moving(now):
            state = motion.state(now)
            return state.positions, state.velocities
        positions = self._skills.arm_positions()
        return positions, np.zeros(len(positions))

    def follow(self, spliced: StreamedMotion) -> None:
        """Continue along a checked motion. Raises StaleChunkError if it arrives too late."""
        trajectory = self.stream.accept(spliced, self._skills.clock.now())
        self._arm = self._skills.arm.follow(trajectory, guard=self._objection)

    def carry_out(self, chunk: ActionChunk, seen: float, count: int) -> SkillCoroutine[bool]:
        """Wait until ``count`` actions of the chunk, which began at ``seen``, have ended; return whether the gripper
        moved.
        """
        self._chunk = chunk, seen
        return (yield from self._until(seen + max(1, count) * chunk.dt))

    def finish(self) -> SkillCoroutine[None]:
        """Wait until the current motion has come to rest."""
        if self.stream.motion is not None:
            yield from self._until(self.stream.motion.end)
        while self._arm is not None and not self._arm.done:
            yield from self._until(self._skills.clock.now() + 1e-3)

    def cancel(self) -> None:
        """Bring arm and fingers to rest; a held object stays held."""
        for handle in (self._arm, self._fingers):
            if handle is not None:
                handle.cancel()

    def _until(self, time: float) -> SkillCoroutine[bool]:
        clock, acted = self._skills.clock, False
        while True:
            self._watch()
            acted = self._move_gripper() or acted
            if clock.now() >= time - 1e-9:
                return acted
            yield _next_tick(clock)

    def _watch(self) -> None:
        """Raise where arm or gripper has failed."""
        for handle in (self._arm, self._fingers):
            if handle is not None and handle.done and handle.status is not MotionStatus.SUCCEEDED:
                failure = handle.failure
                if failure is not None and failure.code == "guarded" and self._skills.clock.now() >= self.deadline:
                    raise SkillFailure("timeout", "stopped in the middle of a chunk: the goal was not reached in time")
                raise SkillFailure.of(failure)

    def _objection(self) -> str | None:
        if self._skills.clock.now() >= self.deadline:
            return "time is up"
        position = self._skills.base_from_tool().position
        if self.box.contains(position, OUTSIDE):
            return None
        return f"the tool left the workspace at {np.round(position, 3).tolist()}"

    def _move_gripper(self) -> bool:
        """Send the chunk's current gripper width if it is new; return whether the gripper moves."""
        gripper = self._skills.gripper
        moving = self._fingers is not None and not self._fingers.done
        if self._chunk is None or self._chunk[0].gripper_widths is None:
            return moving
        chunk, seen = self._chunk
        widths = self._chunk[0].gripper_widths
        index = min(int((self._skills.clock.now() - seen) / chunk.dt), len(widths) - 1)
        width = float(np.clip(widths[index], 0.0, gripper.model.max_width))
        if abs(width - self._width) <= CLOSED:
            return moving
        self._width = width
        if width < CLOSED:
            self.closed_at = self._skills.base_from_tool()
            self._fingers = gripper.close()
        else:
            self._fingers = gripper.open(width)
        return True


def _next_tick(clock: TimeSource) -> Until:
    now = clock.now()
    return Until(lambda: clock.now() > now)


STILL = 1e-3
"""Largest joint motion of a chunk that counts as no motion, radians."""
STILL_CHUNKS = 3
LEAD = 0.15
"""Seconds from the policy's answer until its chunk takes effect; by then it has to be checked."""
SUCCESSES = ("goal", "holding", "lifted")


class RunPolicy(ArmNode, Skill):
    """Run a learned policy until the tool is at the goal, or the gripper holds something, or has lifted it.

    The policy is queried again before its chunk is over, and the motion continues without a stop. Each chunk is checked
    against the workspace and all believed obstacles before it moves anything. Fails with ``timeout``, ``stalled``,
    ``workspace``, ``collision``, or an error of the policy itself, such as ``bad_action`` or ``policy_unreachable``.
    The hand may touch ``object``, which is believed to be held at the end.
    """

    REQUIRES = ("arm", "gripper")
    USES = ("camera", "wrist_camera")
    policy = In(str, "a shipped name, an .onnx file, the .yaml of a policy server or file.py:Class")
    goal = In(Pose, "target of the tool or of the picking, in the map frame", required=False)
    object = In[str | None](ObjectName, "a seen object that the policy picks", required=False)
    success = In[str](Annotated[str, OneOf(lambda: SUCCESSES)], "goal, holding or lifted", default="goal")
    lift = In[float](Positive, "metres, for lifted", default=0.1)
    timeout = In[float](Positive, "seconds", default=20.0)
    position_tolerance = In[float](Positive, "metres", default=0.01)
    rotation_tolerance = In[float](Positive, "radians", default=0.1)
    workspace = In(str, "x;y;z;x;y;z in the base frame; the policy's by default", default="")
    chunks = Out(int, "number of executed actions")

    # Of an object only where one is given; of the effects the one that ``success`` asks for.
    FAILS: ClassVar = {
        **NO_CAMERA,
        "not_found": "DetectObject first",
        "hand_not_empty": "put the held object down: FindPlacePose, PlaceOn, Release",
        "workspace": "stand where the policy's box holds the goal: FindStandPose, NavigateTo",
        "collision": "come from another posture: Retreat, MoveArm",
        "stalled": "look again and start over: MoveArm, DetectObject, RunPolicy; or pick by PlanGrasp, Grasp",
        "timeout": "look again and start over: MoveArm, DetectObject, RunPolicy; or pick by PlanGrasp, Grasp",
        "no_goal": "give a goal",
        "other_goal": "a policy whose goal is a pose",
        "other_robot": "a policy that was trained for this arm",
        "no_workspace": "give a workspace",
        "policy_failed": "pick by PlanGrasp, Grasp",
        "policy_unusable": "another file of the policy",
        "bad_observation": "another policy, or the cameras that it needs",
        "bad_action": "pick by PlanGrasp, Grasp",
        "stale_chunk": "RunPolicy again; the policy is too slow",
        "policy_unreachable": "check that its server is running",
        "policy_server": "check the output of its server",
    }
    DECLARATION = Declaration(pre=("visible({object})",), effects=("tool_at({goal})", "holding({object})"))

    motion: PolicyMotion | None = None
    """The motion that runs while the skill is active, for recorders."""

    def execute(self) -> SkillCoroutine[None]:
        """Query the policy, check each chunk, execute it, and monitor the result during the motion."""
        policy = self.skills.policies(self.policy, self.folders)
        try:
            timeout, goal = self.timeout, self._goal()
            box = self._check(policy.specification, goal)
            yield from self._open_hand(policy.specification)
            deadline = self.skills.clock.now() + timeout
            self.motion = motion = PolicyMotion(self.skills, box, deadline)
            try:
                with self.touching(*self._contacts()):
                    yield from self._run(policy, motion, goal)
            finally:
                self.motion = None
                motion.cancel()
        finally:
            policy.close()

    def _contacts(self) -> Iterator[Contact]:
        """Yield the permitted contacts of the object, if one is given."""
        name = self.object
        if name:
            belief = self.skills.world.objects[name]
            yield grasp(name)
            yield support(name, belief.surface or surface_below(self.skills.world, belief.pose))

    def _run(self, policy: Policy, motion: PolicyMotion, goal: Pose | None) -> SkillCoroutine[None]:
        from bestman_bt.manipulation.policy.chunk_stream import chunk_path
        from bestman_bt.manipulation.policy.errors import StaleChunkError

        clock, spec = self.skills.clock, policy.specification
        policy.reset()
        done, still = 0, 0
        self.chunks = done
        while True:
            if self._succeeded(motion, goal):
                yield from motion.finish()
                if self._succeeded(motion, goal):
                    break
            if clock.now() >= motion.deadline:
                raise SkillFailure("timeout", f"the goal was not reached in time{self._distance(goal)}")
            seen, (start, velocities) = clock.now(), motion.asked()
            chunk = yield self.compute("policy", policy.act, self._observation(spec, goal, velocities))
            path = chunk_path(chunk, start, self.skills.kinematics, self.skills.arm_model)
            moves = bool(np.abs(path - start).max() > STILL) or motion.stream.moving(seen)
            if moves:
                begin = clock.now() + LEAD if motion.stream.moving(seen) else clock.now()
                try:
                    spliced = yield self.compute("trajectory", self._checked, motion, path, chunk.dt, seen, begin)
                    motion.follow(spliced)
                except StaleChunkError:
                    continue  # the arm has come to rest meanwhile, or does so now: look again
            acted = yield from motion.carry_out(chunk, seen, spec.executed or len(chunk.actions) // 2)
            still = 0 if moves or acted else still + 1
            if still == STILL_CHUNKS:
                raise SkillFailure("stalled", f"the policy no longer moves{self._distance(goal)}")
            done += 1
            self.chunks = done
        self._believe_held(motion, goal)
        self.feedback_message = f"{done} chunks"

    def _goal(self) -> Pose | None:
        map_from_goal: Pose | None = self.goal
        return None if map_from_goal is None else self.skills.map_from_base.inverse() @ map_from_goal

    def _check(self, spec: PolicySpecification, goal: Pose | None) -> Workspace:
        """Refuse before anything moves; returns the box."""
        from bestman_bt.manipulation.policy.specification import Workspace

        skills = self.skills
        if spec.joint_names != skills.arm_model.joint_names or spec.robot not in ("", skills.robot.name):
            raise SkillFailure("other_robot", f"the policy is for {spec.robot} {spec.joint_names}, not for this arm")
        success, name = self.success, self.object
        if name and name not in skills.world.objects:
            raise SkillFailure("not_found", f"the {name} has not been seen; detect it first")
        if goal is None and (spec.goal_size or success == "goal"):
            raise SkillFailure("no_goal", "the policy, or the condition of success, needs a goal")
        if spec.goal_size not in (0, 7):
            raise SkillFailure("other_goal", f"the policy expects a goal of {spec.goal_size} numbers, but a pose has 7")
        given: str = self.workspace
        if not given and spec.workspace is None:
            raise SkillFailure("no_workspace", "the policy has no workspace: give one to bound the tool")
        try:
            box = Workspace.from_string(given) if given else Workspace(*map(np.array, spec.workspace or ()))
        except ManipulationError as error:
            raise SkillFailure("bad_input", str(error)) from error
        for what, pose in (("goal", goal), ("tool", skills.base_from_tool())):
            if pose is not None and not box.contains(pose.position):
                where = np.round(pose.position, 3).tolist()
                raise SkillFailure("workspace", f"the {what} at {where} is outside the workspace {box}")
        return box

    def _open_hand(self, spec: PolicySpecification) -> SkillCoroutine[None]:
        """Open the hand, in which state a policy that drives the gripper starts."""
        skills = self.skills
        if not spec.moves_gripper or not spec.open_width:
            return
        if skills.held is not None:
            raise SkillFailure("hand_not_empty", f"the hand holds the {skills.held.name}")
        if abs(skills.gripper.width() - spec.open_width) > CLOSED:
            yield skills.gripper.open(spec.open_width)

    def _succeeded(self, motion: PolicyMotion, goal: Pose | None) -> bool:
        from bestman_bt.manipulation.policy.features import pose_error

        success = self.success
        if success != "goal":
            if not self.skills.gripper.pressing():
                return False
            closed_at = motion.closed_at
            if success == "holding":
                return True
            height = self.skills.base_from_tool().position[2]
            return closed_at is not None and bool(height - closed_at.position[2] >= self.lift)
        assert goal is not None
        error = pose_error(goal, self.skills.base_from_tool())
        return bool(
            np.linalg.norm(error[:3]) <= self.position_tolerance
            and np.linalg.norm(error[3:]) <= self.rotation_tolerance
        )

    def _distance(self, goal: Pose | None) -> str:
        from bestman_bt.manipulation.policy.features import pose_error

        if goal is None or self.success != "goal":
            return ""
        error = pose_error(goal, self.skills.base_from_tool())
        return f": {np.linalg.norm(error[:3]):.3f} m and {np.linalg.norm(error[3:]):.2f} rad from the goal"

    def _observation(
        self, spec: PolicySpecification, goal: Pose | None, velocities: NDArray[np.float64]
    ) -> Observation:
        from bestman_bt.manipulation.policy.base import Observation
        from bestman_bt.manipulation.policy.features import pose_vector

        skills = self.skills
        cameras = {"head": skills.camera if skills.has("camera") else None, "wrist": skills.wrist_camera}
        images: dict[str, NDArray[np.uint8]] = {}
        for name in spec.images:
            camera = cameras.get(name)
            if camera is None:
                raise SkillFailure("no_camera", f"the policy needs a camera {name!r}, which the robot lacks")
            images[name] = camera.capture().image.rgb
        return Observation(
            skills.arm_positions(),
            skills.base_from_tool(),
            np.zeros(0) if goal is None else pose_vector(goal),
            skills.gripper.width(),
            images,
            velocities,
        )

    def _checked(
        self, motion: PolicyMotion, path: NDArray[np.float64], dt: float, seen: float, begin: float
    ) -> StreamedMotion:
        """Return the motion along ``path`` (H + 1, n) from the clock's ``begin`` on: in the box, and it touches
        nothing.
        """
        from bestman_bt.manipulation.trajectory.base import first_touch

        skills = self.skills
        kinematics = skills.kinematics
        outside = motion.box.first_outside(path, kinematics)
        if outside is None:
            spliced = motion.stream.splice(path, dt, seen, begin)
            outside = motion.box.first_outside(spliced.trajectory.positions, kinematics)
        if outside is not None:
            raise SkillFailure("workspace", f"the policy would leave the workspace at {np.round(outside, 3).tolist()}")
        name = self.object
        allowed = hand_contacts(skills, name) if name else ()
        touch = first_touch(spliced.trajectory, skills.arm_world(skills.planning_scene(allowed_pairs=allowed)))
        if touch is not None:
            raise SkillFailure("collision", f"the policy would touch {touch}")
        return spliced

    def _believe_held(self, motion: PolicyMotion, goal: Pose | None) -> None:
        """Believe that the picked object is in the hand, as observed, but centred between the fingers."""
        skills, name = self.skills, self.object
        if not name or goal is None or motion.closed_at is None or self.success == "goal":
            return
        tool_from_object = motion.closed_at.inverse() @ goal
        centred = Pose(tool_from_object.position * [1.0, 0.0, 1.0], tool_from_object.quaternion)
        belief = skills.world.objects.pop(name)
        skills.held = HeldObject(name, belief.model, centred, skills.gripper.width())
