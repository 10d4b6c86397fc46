"""Placing: finding free space, setting the object down, releasing it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from behaviours.arm_motion import ARM_PLANNING_FAILS, follow_path, hand_contacts, move_free, unreached
from behaviours.contacts import MAX_FORCE, grasp, stopping_at, support, surface_below
from behaviours.perception.beliefs import believe_surface
from behaviours.perception.perceive import NO_CAMERA, camera_called
from behaviours.perception.surfaces import SURFACE_NOT_SEEN, UNKNOWN_SURFACE, surface_region
from behaviours.skill import ArmNode, Declaration, ObjectName, Skill, SkillCoroutine, SkillFailure, SurfaceName
from bestman_bt.control.gripper import HELD_WIDTH
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import NonNegative
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief

if TYPE_CHECKING:
    from bestman_bt.control.arm.guarded_move import GuardedOutcome
    from bestman_bt.manipulation.collision.base import CollisionWorld
    from bestman_bt.manipulation.motion_planning.approach import Approach
    from bestman_bt.perception.detection.base import DetectedScene
    from bestman_bt.perception.segmentation.surface_coverage import SurfaceCoverage


TURNS_OF_A_ROUND_OBJECT = 12
NUDGE = 0.001
"""Metres by which a hand that did not release the object is raised before it opens again."""


class FindPlacePose(Skill):
    """Look at a surface and check that the goal is free; the height comes from the measured surface."""

    REQUIRES = ("camera",)
    USES = ("wrist_camera",)
    object = In[str](ObjectName, "the object to place")
    surface = In[str](SurfaceName, "the surface, such as counter")
    goal = In(Pose, "x;y;z or x;y;z;roll;pitch;yaw in the map frame; z is measured")
    radius = In[float](NonNegative, "radius of the free disc, metres", default=0.06)
    camera = In(str, "head, wrist, or its name", default="head")
    pose = Out(Pose, "pose of the placed object, in the map frame", required=True)
    FAILS: ClassVar = {
        **UNKNOWN_SURFACE,
        **SURFACE_NOT_SEEN,
        **NO_CAMERA,
        "unknown_object": "add a model of it",
        "surface_full": "another surface",
        "goal_taken": "another goal: FindFreePlace",
        "goal_not_seen": "another view: FindStandPose, NavigateTo, LookAt",
    }
    DECLARATION = Declaration(effects=("free({goal})",))

    def execute(self) -> SkillCoroutine[None]:
        """Capture, measure the surface, and check the free space."""
        from bestman_bt.perception.segmentation.surface_coverage import surface_coverage

        skills = self.skills
        name: str = self.object
        surface: str = self.surface
        goal: Pose = self.goal
        model = skills.world.models.get(name)
        if model is None:
            raise SkillFailure("unknown_object", f"no model of {name!r}")
        view = camera_called(skills, self.camera).capture()
        region = surface_region(skills, surface, view)
        models = list(skills.world.models.values())
        scene: DetectedScene = yield self.compute(
            "detection", skills.detection.detect, view.in_base, region, models, skills.rng
        )
        believe_surface(skills, surface, view, scene)
        base_from_goal = view.map_from_base.inverse() @ goal
        x, y = (float(value) for value in base_from_goal.position[:2])
        self._check_room(surface_coverage(view.in_base, region, scene.scene), np.array([x, y]), surface)
        height = scene.plane.height_at(x, y) - float(model.bounds()[0, 2])
        upright = Pose.from_xyz_rpy((x, y, height), (0.0, 0.0, base_from_goal.yaw))
        self.pose = view.map_from_base @ upright

    def _check_room(self, coverage: SurfaceCoverage, point: NDArray[np.float64], surface: str) -> None:
        from bestman_bt.perception.segmentation.surface_coverage import FREE, OCCUPIED

        radius, place = self.radius, self.skills.parameters.place
        shares = coverage.disc(point, radius)
        if shares[OCCUPIED] <= place.max_occupied and shares[FREE] >= place.min_free:
            return
        across = f"{200 * radius:.0f} cm disc"
        if len(coverage.free_discs(radius, point)) == 0:
            raise SkillFailure("surface_full", f"no free {across} is left on the {surface}")
        if shares[OCCUPIED] > place.max_occupied:
            raise SkillFailure("goal_taken", f"{shares[OCCUPIED]:.0%} of the {across} at the goal is taken")
        raise SkillFailure("goal_not_seen", f"only {shares[FREE]:.0%} of the {across} at the goal is seen to be free")


class PlaceOn(ArmNode, Skill):
    """Move the held object above its place and lower it straight until contact."""

    REQUIRES = ("arm", "gripper")
    USES = ("force_torque",)
    object = In[str](ObjectName, "the held object")
    pose = In(Pose, "target pose of the object, in the map frame")
    FAILS: ClassVar = {
        **ARM_PLANNING_FAILS,
        "not_holding": "find it and take it: DetectObject, PlanGrasp, Grasp",
        "no_approach": "stand elsewhere: FindStandPose, NavigateTo",
        "nothing_below": "measure the surface again: FindPlacePose",
    }
    DECLARATION = Declaration(pre=("holding({object})", "free({pose})"), effects=("lowered({object}, {pose})",))

    def execute(self) -> SkillCoroutine[None]:
        """Plan the poses above and on the surface, then move."""
        skills = self.skills
        place, name = skills.parameters.place, self.object
        held = skills.held
        if held is None or held.name != name:
            raise SkillFailure("not_holding", f"the hand does not hold the {name}")
        base_from_object = skills.map_from_base.inverse() @ self.pose
        approach: Approach | None = yield self.compute("grasp_planning", self._plan, held, base_from_object)
        if approach is None:
            raise unreached(
                skills,
                SkillFailure("no_approach", f"the arm has no free path to place the {name} there from this base pose"),
                (down for _, down in place_tool_poses(held, base_from_object, self._above(held), place.drop_height)),
                self._lowering_world(held),
            )
        yield from move_free(self, [approach.pre])
        felt = stopping_at(place.set_down_force) if skills.wrist_wrench is not None else MAX_FORCE
        gripped = stopping_at(skills.gripper_model.part.max_force)
        with self.touching(grasp(name, gripped), support(name, surface_below(skills.world, self.pose), felt)):
            speed = skills.parameters.arm_motion.approach_speed
            yield from follow_path(self, approach.into, self._lowering_world(held), speed)
            if skills.wrist_wrench is not None:
                yield from self._set_down(name)

    def _set_down(self, name: str) -> SkillCoroutine[None]:
        """Lower the object until contact, because a dropped one falls over; a tilted object touches earlier than
        believed.
        """
        place = self.skills.parameters.place
        outcome: GuardedOutcome = yield self.skills.arm.move_until(
            (0.0, 0.0, -1.0), place.set_down_speed, place.hover_height + place.search_depth, place.set_down_force
        )
        if not outcome.touched:
            depth = f"{100 * place.search_depth:g} cm"
            raise SkillFailure("nothing_below", f"the {name} has no contact {depth} below the measured surface")
        if place.hover_height - outcome.distance > place.tilted_height:
            yield from self._level(place.hover_height - outcome.distance)

    def _level(self, left: float) -> SkillCoroutine[None]:
        """Loosen the hand so that an object that touches with an edge turns level, and lower the hand by at most
        ``left`` metres.
        """
        skills, place = self.skills, self.skills.parameters.place
        try:
            for force in (force for force in place.loosening_forces if force <= skills.gripper.model.part.max_force):
                yield skills.gripper.close(force)
                if left > NUDGE:
                    outcome: GuardedOutcome = yield skills.arm.move_until(
                        (0.0, 0.0, -1.0), place.set_down_speed, left, place.set_down_force
                    )
                    left -= outcome.distance
        except SkillFailure:
            yield skills.gripper.close()  # the arm must not go on with it in a loose hand
            raise

    def _plan(self, held: HeldObject, base_from_object: Pose) -> Approach | None:
        from bestman_bt.manipulation.motion_planning.approach import ApproachPoses, approaches

        skills, place = self.skills, self.skills.parameters.place
        free = skills.arm_world(skills.planning_scene())
        lowering, arm_alone = self._lowering_world(held), self._lowering_world(held, hand=True)
        kinematics, reference = skills.kinematics, skills.arm_positions()
        found: list[Approach] = []
        lift = place.drop_height if skills.wrist_wrench is None else place.hover_height
        for above, down in place_tool_poses(held, base_from_object, self._above(held), lift):
            # Back along the hand's axis there must be room, too: that is how it leaves what it has let go.
            back = down @ Pose(np.array([0.0, 0.0, -place.retreat]))
            poses = ApproachPoses(above, down, back)
            found += [
                approach
                for approach in approaches(kinematics, poses, reference, free, lowering, skills.rng)
                if self._has_room_below(approach, down, lift, arm_alone)
            ]
        return min(found, key=lambda approach: approach.cost) if found else None

    def _has_room_below(self, approach: Approach, down: Pose, lift: float, world: CollisionWorld) -> bool:
        """Return whether the arm stays clear of the support over the whole lowering by contact.

        The wrist senses contacts of object and hand, but not of the arm.
        """
        from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path

        deepest = lift + self.skills.parameters.place.search_depth
        lowest = Pose(down.position - np.array([0.0, 0.0, deepest]), down.quaternion)
        kinematics = self.skills.kinematics
        return cartesian_path(kinematics, approach.into[-1], lowest, world.is_free).complete

    def _above(self, held: HeldObject) -> float:
        """Return the height above the goal, metres, at which the descent begins."""
        return self.skills.parameters.place.descent

    def _lowering_world(self, held: HeldObject, hand: bool = False) -> CollisionWorld:
        """Return the collision world in which the object, and optionally the ``hand``, may touch the support."""
        skills = self.skills
        supports = [name for name in skills.world.obstacles if name.endswith("/surface")]
        allowed = [(held.name, support) for support in supports]
        if hand:
            allowed += hand_contacts(skills, *supports)
        return skills.arm_world(skills.planning_scene(allowed_pairs=allowed))


class Release(ArmNode, Skill):
    """Open the hand slowly, and believe the object at the place where the hand has left it."""

    REQUIRES = ("arm", "gripper")
    USES = ("force_torque",)
    object = In[str](ObjectName, "the held object")
    surface = In[str | None](SurfaceName, "the surface below it, for later searches", required=False)
    FAILS: ClassVar = {
        "not_holding": "there is nothing to release",
        "not_released": "it sticks to the fingers: Release again",
    }
    DECLARATION = Declaration(pre=("holding({object})",), effects=("not holding({object})",))

    def execute(self) -> SkillCoroutine[None]:
        """Open a little, so that neighbouring objects stay in place."""
        skills = self.skills
        held = skills.held
        if held is None:
            raise SkillFailure("not_holding", f"the hand does not hold the {self.object}")
        map_from_object = skills.map_from_base @ skills.base_from_tool() @ held.tool_from_object
        with self.touching(grasp(held.name), support(held.name, surface_below(skills.world, map_from_object))):
            yield from self._let_go(held)
        skills.held = None
        skills.world.objects[held.name] = ObjectBelief(
            held.name, held.model, map_from_object, 1.0, 0.005, skills.clock.now(), self.surface
        )

    def _let_go(self, held: HeldObject) -> SkillCoroutine[None]:
        skills, place = self.skills, self.skills.parameters.place
        outcome = yield skills.gripper.release()
        if outcome.width < held.width + HELD_WIDTH.let_go:
            # Caught: hold it loosely, so that it comes to lie as it likes between the fingers, and try again.
            yield skills.gripper.close(place.regrip_force)
            if skills.wrist_wrench is not None:
                yield skills.arm.move_until((0.0, 0.0, 1.0), place.set_down_speed, NUDGE, place.set_down_force)
            outcome = yield skills.gripper.release()
        if outcome.width < held.width + HELD_WIDTH.let_go:
            # The arm must not leave with a thing that is neither held nor free.
            yield skills.gripper.close()
            opened = f"the fingers opened to {1e3 * outcome.width:.0f} mm, it is {1e3 * held.width:.0f} mm wide"
            raise SkillFailure("not_released", f"the hand does not release the {held.name}: {opened}")


def place_tool_poses(held: HeldObject, frame_from_object: Pose, above: float, lift: float) -> list[tuple[Pose, Pose]]:
    """Return tool poses (above, down) that place the held object at ``frame_from_object``, one per symmetric rotation.

    ``above``: metres from the goal to the start of the straight descent. ``lift``: metres to its end.
    """
    count = held.model.symmetry_order or TURNS_OF_A_ROUND_OBJECT
    poses = []
    for i in range(count):
        turned = frame_from_object @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 2 * math.pi * i / count))
        lifted = Pose(turned.position + np.array([0.0, 0.0, lift]), turned.quaternion)
        down = lifted @ held.tool_from_object.inverse()
        poses.append((Pose(down.position + np.array([0.0, 0.0, above]), down.quaternion), down))
    return poses
