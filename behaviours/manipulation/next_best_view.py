"""A second look: the wrist camera view that best resolves an object's orientation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, move_free
from behaviours.perception.beliefs import only_nearest, remember_view
from behaviours.perception.perceive import NO_CAMERA, region_around
from behaviours.perception.surfaces import SURFACE_NOT_SEEN
from behaviours.skill import ALGORITHM_ERRORS, ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import PlacedShape, Pose
from bestman_bt.messages.shapes import Fraction, NonNegative
from bestman_bt.world_model.world_model import ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.control.rgbd import RGBDSensor, RGBDView
    from bestman_bt.perception.detection.base import DetectedScene
    from bestman_bt.perception.pose_estimation.base import PoseHypothesis
    from bestman_bt.perception.pose_estimation.multi_view import ViewObservation
    from bestman_bt.perception.view_planning import RankedView


TRIED_VIEWS = 24
"""Number of views, the most informative first, to solve arm postures for."""
ROLLS = (0.0, math.pi / 2, -math.pi / 2, math.pi)
"""Rotations of the camera about its axis: equally informative, but not equally reachable."""
GOALS = 4
"""Number of reachable views after which the search ends."""


class SecondLook(ArmNode, Skill):
    """Look at an object again from the view that best resolves its yaw, and fuse the views; do nothing if the yaw is
    known.
    """

    REQUIRES = ("arm", "wrist_camera")
    object = In[str](ObjectName, "an object that was located")
    max_yaw_width = In[float](NonNegative, "acceptable yaw uncertainty, radians", default=0.35)
    min_confidence = In[float](Fraction, "of the pose", default=0.5)
    pose = Out(Pose, "where the object is, in the map frame")
    yaw_width = Out(float, "remaining yaw uncertainty, radians")
    FAILS: ClassVar = {
        **NO_CAMERA,
        **SURFACE_NOT_SEEN,
        **ARM_PLANNING_FAILS,
        "not_found": "DetectObject first",
        "no_view": "do without, or stand elsewhere: FindStandPose, NavigateTo",
        "object_lost": "DetectObject again",
    }
    DECLARATION = Declaration(pre=("located({object})",), effects=("yaw_known({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Rank views, move to the best reachable one, capture, and fuse the observations."""
        skills = self.skills
        name: str = self.object
        belief = skills.world.objects.get(name)
        if belief is None or not skills.observations.get(name):
            raise SkillFailure("not_found", f"the {name} has not been seen; detect it first")
        if belief.yaw_set.width > self.max_yaw_width:
            camera = skills.wrist_camera
            if camera is None:
                raise SkillFailure("no_camera", f"the robot {skills.robot.name} has no camera on its hand to look with")
            postures = yield self.compute("view_planning", self._postures, belief, camera)
            if not postures:
                raise SkillFailure("no_view", f"no informative view of the {name} is free and within reach from here")
            yield from self._go(postures)
            belief = yield from self._look(belief, camera)
            skills.world.objects[name] = belief
        self.pose = belief.pose
        self.yaw_width = belief.yaw_set.width
        self.feedback_message = f"{name}: yaw open by {math.degrees(belief.yaw_set.width):.0f}°"

    def _postures(self, belief: ObjectBelief, camera: RGBDSensor) -> list[NDArray[np.float64]]:
        """Return joint positions (n,) of feasible views, the most informative first."""
        skills = self.skills
        (hypothesis,) = self._joined(belief, skills.observations[belief.name])
        planner = skills.view_planning
        candidates = planner.candidates(hypothesis, camera.intrinsics)
        ranked = planner.rank(hypothesis, candidates, camera.intrinsics, self._others(belief))
        world = skills.arm_world(skills.planning_scene())
        reference = skills.arm_positions()
        camera_from_tool = camera.base_from_camera().inverse() @ skills.base_from_tool()
        postures = []
        for view in ranked[:TRIED_VIEWS]:
            for base_from_tool in self._tool_poses(view, camera_from_tool):
                found = skills.kinematics.solve(base_from_tool, reference, skills.rng, attempts=4)
                postures += [positions for positions in found.solutions if world.is_free(positions)][:1]
            if len(postures) >= GOALS:
                break
        return postures

    def _tool_poses(self, view: RankedView, camera_from_tool: Pose) -> list[Pose]:
        base_from_camera = self.skills.map_from_base.inverse() @ view.frame_from_camera
        rolled = [Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, roll)) for roll in ROLLS]
        return [base_from_camera @ roll @ camera_from_tool for roll in rolled]

    def _others(self, belief: ObjectBelief) -> list[PlacedShape]:
        """Return the shapes that may occlude the view, in the map frame."""
        world = self.skills.world
        shapes = [shape for obstacle in world.obstacles.values() for shape in obstacle.shapes]
        for other in world.objects.values():
            if other.name != belief.name:
                shapes += [replace(part, pose=other.pose @ part.pose) for part in other.model.collision]
        return shapes

    def _go(self, postures: Sequence[NDArray[np.float64]]) -> SkillCoroutine[None]:
        """Move to the most informative view that has a path."""
        for posture in postures[:-1]:
            try:
                yield from move_free(self, [posture])
            except ALGORITHM_ERRORS:
                continue
            return
        yield from move_free(self, [postures[-1]])

    def _look(self, belief: ObjectBelief, camera: RGBDSensor) -> SkillCoroutine[ObjectBelief]:
        from bestman_bt.perception.pose_estimation.multi_view import ViewObservation

        skills = self.skills
        view: RGBDView = camera.capture()
        base_from_object = view.map_from_base.inverse() @ belief.pose
        region = region_around(base_from_object, float(belief.model.size[2]))
        scene: DetectedScene = yield self.compute(
            "pose_estimation",
            skills.detection.detect,
            view.in_base,
            region,
            list(skills.world.models.values()),
            skills.rng,
        )
        found = only_nearest(scene, belief, base_from_object).detections
        if not found:
            raise SkillFailure("object_lost", f"the second look does not show the {belief.name}")
        seen = ViewObservation(found[0].cluster.seen_from(view.map_from_base), view.in_map)
        remember_view(skills, belief.name, seen)
        joined = yield self.compute("pose_estimation", self._joined, belief, skills.observations[belief.name])
        if not joined or joined[0].confidence < self.min_confidence:
            raise SkillFailure("object_lost", f"the views of the {belief.name} contradict each other")
        best: PoseHypothesis = joined[0]
        return replace(
            belief,
            pose=best.pose,
            confidence=best.confidence,
            position_std=best.position_std,
            yaw_set=best.yaw_set,
            stamp=view.stamp,
        )

    def _joined(self, belief: ObjectBelief, observations: Sequence[ViewObservation]) -> tuple[PoseHypothesis, ...]:
        return self.skills.multi_view.estimate(observations, [belief.model])
