"""Standing to open a door or drawer: where to see its handle from, and where to pull it from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from py_trees.ports import PortInformation

from behaviours.grasp import handle_grasp_candidates
from behaviours.opening import Opening, find_leaf, leaf_front, plan_opening, stations, world_at_leaf
from behaviours.skill import Declaration, Skill, SkillFailure, Steps
from bestman_bt.manipulation.kinematics import StandAlong, StandAlongParameters, rank_stand_poses_along, stands_around
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.perception.grasp_pose import handle_motion, rank_grasps

LOOK_DISTANCES = (0.90, 1.05, 0.75, 1.20)
"""Metres from a front to the middle of the base that looks at it."""
DISTANCES = (0.55, 0.65, 0.75, 0.85, 0.95)
"""Metres from a handle to the middle of the base that pulls it."""
BEARINGS = tuple(math.radians(degrees) for degrees in range(-75, 76, 15))
TURNS = (0.0, -0.5, 0.5)
BASE_GAP = 0.05
"""Metres that the base keeps from where the leaf passes."""
GRASPS = 3
"""Different grasps for which stands are sought."""
SAME_STAND = 0.05
STANDS = StandAlongParameters(enough=2, most=16)


class FindLookStand(Skill):
    """Choose where to stand to see the front of a door or drawer of the map, and where to look from there."""

    INPUT_PORTS: ClassVar = {"articulation": PortInformation(str, description="furniture/leaf of the map")}
    OUTPUT_PORTS: ClassVar = {
        "stand": PortInformation(Pose2D, description="where to stand, in the map frame"),
        "front": PortInformation(Pose, description="the middle of the closed front, in the map frame"),
    }
    DECLARATION = Declaration(effects=("stand_known({articulation})",))

    def execute(self) -> Steps:
        """The first distance at which the base has room."""
        articulation: str = self.get_input("articulation")
        furniture, leaf = find_leaf(self.skills, articulation)
        front = leaf_front(furniture, leaf)
        side = float(furniture.pose.to_pose().inverse().apply(front.position[None])[0][1])
        clearance = yield self.compute("stand_planning", _clearance, self)
        for distance in LOOK_DISTANCES:
            stand = furniture.pose @ Pose2D(-furniture.footprint[0] / 2 - distance, side, 0.0)
            if clearance(stand) > 0.0:
                self.set_output("stand", stand)
                self.set_output("front", front)
                return
        raise SkillFailure("no_stand", f"no room to stand before {articulation}")


class FindOpenStand(Skill):
    """Choose where to stand so that the arm takes a handle and follows it as far as is asked, on one branch.

    Each time it is asked again it gives another stand, until none is left.
    """

    INPUT_PORTS: ClassVar = {
        "articulation": PortInformation(str, description="furniture/leaf of the map"),
        "handle": PortInformation(str, description="a believed handle"),
        "opening": PortInformation(float, description="how far to open: metres of a drawer, radians of a door"),
    }
    OUTPUT_PORTS: ClassVar = {"stand": PortInformation(Pose2D, description="where to stand, in the map frame")}
    DECLARATION = Declaration(pre=("handle_known({handle})",), effects=("stand_known({articulation})",))

    def on_load(self) -> None:
        """Nothing has been tried yet."""
        self._tried: list[Pose2D] = []

    def execute(self) -> Steps:
        """Rank stands around the handle by how well the arm follows the whole way."""
        name: str = self.get_input("handle")
        articulation: str = self.get_input("articulation")
        belief = self.skills.world.handles.get(name)
        if belief is None:
            raise SkillFailure("handle_not_found", f"the handle {name} has not been seen; detect it first")
        opening = plan_opening(self.skills, articulation, belief, self.get_input("opening"))
        clearance = yield self.compute("stand_planning", _clearance, self)
        stands = yield self.compute("stand_planning", self._rank, opening, clearance)
        if not stands:
            raise SkillFailure("no_stand", f"the arm cannot follow {articulation} as far as asked from anywhere free")
        best = stands[0].pose
        self._tried.append(best)
        self.set_output("stand", best)
        self.feedback_message = f"stand at {best.x:.2f}, {best.y:.2f}, {np.degrees(best.theta):.0f}°"

    def _rank(self, opening: Opening, clearance: Callable[[Pose2D], float]) -> Sequence[StandAlong]:
        skills = self.skills
        belief = skills.world.handles[self.get_input("handle")]
        position, outward = opening.handle.pose.position, opening.handle.outward
        front = math.atan2(outward[1], outward[0])
        swept = _swept(opening)
        corners = np.array(skills.base.description.footprint)
        shoulder, _ = skills.algorithms.kinematics.reach
        height = opening.handle.panel_size[1] if opening.handle.panel_size is not None else 2.0 * position[2]
        above_base = position[2] - height / 2 > shoulder[2]

        def is_base_free(stand: Pose2D) -> bool:
            local = stand.inverse().apply(swept)
            low, high = corners.min(axis=0) - BASE_GAP, corners.max(axis=0) + BASE_GAP
            if above_base:
                return clearance(stand) > 0.0
            return clearance(stand) > 0.0 and not bool(((local > low) & (local < high)).all(axis=1).any())

        candidates = [
            stand
            for stand in stands_around(position[:2], DISTANCES, [front + bearing for bearing in BEARINGS], TURNS)
            if all(stand.distance_to(tried) > SAME_STAND for tried in self._tried) and is_base_free(stand)
        ]
        for ranked in rank_grasps(handle_grasp_candidates(skills, belief))[:GRASPS]:
            grasp = skills.map_from_base @ ranked.candidate.grasp
            before = skills.map_from_base @ ranked.candidate.pre_grasp
            for turn in opening.turns():
                found = rank_stand_poses_along(
                    candidates,
                    [[before], *stations(opening, grasp, turn)],
                    skills.algorithms.kinematics,
                    skills.arm_model,
                    skills.arm_positions(),
                    skills.rng,
                    is_free_at=lambda stand: self._is_free_at(opening, stand),
                    current=skills.world.base.pose,
                    parameters=STANDS,
                )
                if found:
                    return sorted(found, key=lambda stand: -stand.score)
        return []

    def _is_free_at(self, opening: Opening, stand: Pose2D) -> Callable[[NDArray[np.float64], int], bool]:
        """Half-way and from there on the leaf counts as open, before as closed."""
        last = len(opening.way())
        worlds = [
            world_at_leaf(self.skills, opening, position, stand)
            for position in (0.0, opening.angle if opening.angle is not None else opening.distance)
        ]
        return lambda positions, station: station not in (0, last) or worlds[int(station == last)].is_free(positions)


def _clearance(skill: Skill) -> Callable[[Pose2D], float]:
    return skill.skills.costmap().clearance_at


def _swept(opening: Opening) -> NDArray[np.float64]:
    """Points (N, 2) of the map over which handle and front pass."""
    handle = opening.handle
    points = [handle.pose.position]
    if handle.panel is not None and handle.panel_size is not None:
        across = np.linspace(-0.5, 0.5, 9) * handle.panel_size[0]
        points += list(handle.panel.apply(np.column_stack([across, np.zeros((9, 2))])))
    moved = [handle_motion(handle, float(distance)).apply(np.array(points)) for distance in opening.way()]
    return np.concatenate(moved)[:, :2]
