"""Acting by a learned policy: its chunks are checked before they move anything, and the tool stays in its box."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from py_trees.ports import PortInformation

from behaviours.skill import Skill, SkillFailure, Steps, StepsTo
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.policy import (
    ActionChunk,
    Observation,
    Policy,
    PolicySpecification,
    Workspace,
    chunk_path,
    chunk_trajectory,
    pose_error,
    pose_vector,
)
from bestman_bt.manipulation.trajectory import SpeedScale, first_touch
from bestman_bt.messages import JointTrajectory, Pose

POLICY_SPEED = SpeedScale(0.5, 0.35)
STILL = 1e-3
"""Radians below which a chunk moves nothing."""
STILL_CHUNKS = 3
OUTSIDE = 0.02
"""Metres by which the measured tool may leave the box before the arm is stopped: its plans may not leave it at all."""
CLOSED = 0.002
"""Metres of gripper width below which a policy means: close."""


class RunPolicy(Skill):
    """Act by a learned policy until the tool is at the goal, or the gripper holds something.

    Each chunk is checked against the workspace and against everything that is believed to be there before it moves, and
    runs at its own pace within half of the arm's speed. Fails with ``timeout``, ``stalled``, ``workspace``,
    ``collision``, or with what the policy itself is to blame for, such as ``bad_action`` or ``policy_unreachable``.
    """

    INPUT_PORTS: ClassVar = {
        "policy": PortInformation(str, description="a shipped name, an .onnx file or the .yaml of a policy server"),
        "goal": PortInformation(Pose, required=False, description="where the tool shall be, in the map frame"),
        "success": PortInformation(str, required=False, default_value="goal", description="goal or holding"),
        "timeout": PortInformation(float, required=False, default_value=20.0, description="seconds"),
        "position_tolerance": PortInformation(float, required=False, default_value=0.01, description="metres"),
        "rotation_tolerance": PortInformation(float, required=False, default_value=0.1, description="radians"),
        "workspace": PortInformation(
            str, required=False, default_value="", description="x;y;z;x;y;z in the base frame; the policy's by default"
        ),
    }
    OUTPUT_PORTS: ClassVar = {"chunks": PortInformation(int, required=False, description="how many were carried out")}

    def execute(self) -> Steps:
        """Ask, check, move, look again."""
        policy = self.skills.policies(self.get_input("policy"))
        try:
            yield from self._run(policy)
        finally:
            policy.close()

    def _run(self, policy: Policy) -> Steps:
        skills = self.skills
        spec, goal = policy.specification, self._goal()
        box = self._check(spec, goal)
        deadline = skills.clock.now() + self.get_input("timeout")
        policy.reset()
        done, still = 0, 0
        self.set_output("chunks", done)
        while not self._succeeded(goal):
            if skills.clock.now() >= deadline:
                raise SkillFailure("timeout", f"not there in time{self._distance(goal)}")
            chunk = yield self.compute("policy", policy.act, self._observation(spec, goal))
            start = skills.arm_positions()
            trajectory = yield self.compute("trajectory", self._checked, chunk, start, box)
            moves = float(np.abs(trajectory.positions - start).max()) > STILL
            if moves:
                yield from self._follow(trajectory, box, deadline)
            acted = yield from self._move_gripper(chunk)
            still = 0 if moves or acted else still + 1
            if still == STILL_CHUNKS:
                raise SkillFailure("stalled", f"the policy does not move any more{self._distance(goal)}")
            done += 1
            self.set_output("chunks", done)
        self.feedback_message = f"{done} chunks"

    def _goal(self) -> Pose | None:
        map_from_goal: Pose | None = self.get_input("goal")
        return None if map_from_goal is None else self.skills.map_from_base.inverse() @ map_from_goal

    def _check(self, spec: PolicySpecification, goal: Pose | None) -> Workspace:
        """Refuse before anything moves; returns the box."""
        skills = self.skills
        if spec.joint_names != skills.arm_model.joint_names or spec.robot not in ("", skills.robot.name):
            raise SkillFailure("other_robot", f"the policy moves {spec.robot} {spec.joint_names}, not this arm")
        success = self.get_input("success")
        if success not in ("goal", "holding"):
            raise SkillFailure("bad_input", f"success should be goal or holding but is {success!r}")
        if goal is None and (spec.goal_size or success == "goal"):
            raise SkillFailure("no_goal", "the policy, or the condition of success, needs a goal")
        if spec.goal_size not in (0, 7):
            raise SkillFailure("other_goal", f"the policy takes a goal of {spec.goal_size} numbers, a pose has 7")
        given: str = self.get_input("workspace")
        if not given and spec.workspace is None:
            raise SkillFailure("no_workspace", "the policy knows no workspace: give one, the tool must stay in it")
        try:
            box = Workspace.from_string(given) if given else Workspace(*map(np.array, spec.workspace or ()))
        except ManipulationError as error:
            raise SkillFailure("bad_input", str(error)) from error
        for what, pose in (("goal", goal), ("tool", skills.base_from_tool())):
            if pose is not None and not box.contains(pose.position):
                where = np.round(pose.position, 3).tolist()
                raise SkillFailure("workspace", f"the {what} at {where} is outside the workspace {box}")
        return box

    def _succeeded(self, goal: Pose | None) -> bool:
        if self.get_input("success") == "holding":
            return self.skills.gripper.pressing()
        assert goal is not None
        error = pose_error(goal, self.skills.base_from_tool())
        return bool(
            np.linalg.norm(error[:3]) <= self.get_input("position_tolerance")
            and np.linalg.norm(error[3:]) <= self.get_input("rotation_tolerance")
        )

    def _distance(self, goal: Pose | None) -> str:
        if goal is None:
            return ""
        error = pose_error(goal, self.skills.base_from_tool())
        return f": {np.linalg.norm(error[:3]):.3f} m and {np.linalg.norm(error[3:]):.2f} rad from the goal"

    def _observation(self, spec: PolicySpecification, goal: Pose | None) -> Observation:
        skills = self.skills
        cameras = {"head": skills.camera, "wrist": skills.wrist_camera}
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
        )

    def _checked(self, chunk: ActionChunk, start: NDArray[np.float64], box: Workspace) -> JointTrajectory:
        """The chunk as a motion from ``start`` (n,) that keeps to the box and touches nothing."""
        skills = self.skills
        kinematics = skills.algorithms.kinematics
        path = chunk_path(chunk, start, kinematics, skills.arm_model)
        outside = box.first_outside(path, kinematics)
        if outside is not None:
            raise SkillFailure("workspace", f"the policy would leave the workspace at {np.round(outside, 3).tolist()}")
        trajectory = chunk_trajectory(path, chunk.dt, skills.arm_model, POLICY_SPEED)
        touch = first_touch(trajectory, skills.arm_world(skills.planning_scene()))
        if touch is not None:
            raise SkillFailure("collision", f"the policy would touch {touch}")
        return trajectory

    def _follow(self, trajectory: JointTrajectory, box: Workspace, deadline: float) -> Steps:
        """Carry the chunk out; the arm is stopped in mid-motion where time is up or the tool leaves the box."""
        try:
            yield self.skills.arm.follow(trajectory, guard=lambda: self._objection(box, deadline))
        except SkillFailure as failure:
            if failure.code == "guarded" and self.skills.clock.now() >= deadline:
                raise SkillFailure("timeout", "stopped in the middle of a chunk: not there in time") from failure
            raise

    def _objection(self, box: Workspace, deadline: float) -> str | None:
        if self.skills.clock.now() >= deadline:
            return "time is up"
        position = self.skills.base_from_tool().position
        if box.contains(position, OUTSIDE):
            return None
        return f"the tool has left the workspace at {np.round(position, 3).tolist()}"

    def _move_gripper(self, chunk: ActionChunk) -> StepsTo[bool]:
        """Bring the gripper where the chunk ends; returns whether that was a command."""
        gripper = self.skills.gripper
        if chunk.gripper_widths is None:
            return False
        width = float(np.clip(chunk.gripper_widths[-1], 0.0, gripper.description.max_width))
        if width < CLOSED and not gripper.pressing() and gripper.width() > CLOSED:
            yield gripper.close()
            return True
        if width >= CLOSED and abs(width - gripper.width()) > CLOSED:
            yield gripper.open(width)
            return True
        return False
