"""Localisation of the base: at the start, and after it is lost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Lt
from py_trees.ports import PortInformation

from behaviours.skill import Declaration, Skill, SkillCondition, SkillCoroutine, SkillFailure
from bestman_bt.engine import In, Out
from bestman_bt.messages import Pose2D
from bestman_bt.messages.shapes import Count, Positive

if TYPE_CHECKING:
    from bestman_bt.navigation.localization.base import OdometryScan, Place


KNOWN_POSITION_STD = 0.5
"""Largest position uncertainty of a usable pose, metres."""
ROOM_TO_TURN = 0.03
"""Metres that the lidar must see free around the base before it turns without a map."""


class Relocalise(Skill):
    """Localise the base on the whole map, ignoring its believed pose; turn and scan again until the result is unique.

    The base only turns in place, and only if the lidar sees enough room.
    """

    REQUIRES = ("base", "lidar")
    looks = In[int](Count, "scans, with a turn between them", default=4)
    turn = In[float](
        Annotated[float, Gt(-math.pi), Lt(math.pi)],
        "radians between two scans, within a half turn",
        default=math.pi / 2,
    )
    certainty = In[float](Annotated[float, Gt(0), Lt(1)], "least probability of the found place", default=0.95)
    pose = Out(Pose2D, "where the base was found, in the map frame")
    FAILS: ClassVar = {
        "ambiguous": "drive on and look again: DriveOnHeading, then Relocalise",
        "not_on_map": "the map shows another place, or much has changed: ExploreAndMap",
        "no_room": "BackUp, then Relocalise",
    }
    DECLARATION = Declaration(effects=("localised",))

    def execute(self) -> SkillCoroutine[None]:
        """Take a scan, search for the pose, turn if it is ambiguous, and wait for the tracking to converge."""
        skills = self.skills
        looks, certainty = self.looks, self.certainty
        scans: list[OdometryScan] = []
        yield skills.base.park()
        for look in range(looks):
            if look:
                self._check_room(scans[-1])
                yield skills.base.turn(self.turn)
            scans.append(skills.base.scan())
            places: tuple[Place, ...] = yield self.compute(
                "global_localization",
                skills.global_localization.locate,
                skills.world.map,
                scans,
                skills.base.lidar.base_from_lidar,
            )
            self.feedback_message = _places_text(places)
            if places and places[0].probability >= certainty:
                break
        else:
            raise SkillFailure("ambiguous" if places else "not_on_map", _places_text(places))
        best = places[0]
        skills.base.believe(best.pose, best.position_std, best.heading_std)
        yield skills.base.park()
        if skills.base.localisation.lost:
            raise SkillFailure("not_on_map", f"{_places_text(places)}, but the scans after that do not fit")
        self.pose = skills.world.base.pose

    def _check_room(self, seen: OdometryScan) -> None:
        corners = np.array(self.skills.base.model.footprint)
        radius = float(np.linalg.norm(corners, axis=1).max())
        away = np.linalg.norm(self.skills.base.lidar.base_from_lidar.apply(seen.scan.points()), axis=1)
        if away.size and away.min() < radius + ROOM_TO_TURN:
            raise SkillFailure("no_room", f"the base cannot turn: an obstacle is {away.min():.2f} m away")


class InitialPoseReceived(SkillCondition):
    """Check whether the base has a pose on the map: given or found, and not lost since."""

    REQUIRES = ("base", "lidar")
    INPUT_PORTS: ClassVar = {
        "initial_pose_received": PortInformation(bool, False, "no effect; accepted for Nav2's files")
    }
    max_position_std = In[float](Positive, "largest std of the position, metres", default=KNOWN_POSITION_STD)
    FAILS: ClassVar = {
        "no_pose": "Relocalise",
        "lost": "Relocalise",
    }

    def check(self) -> tuple[str, str] | None:
        """Compare the standard deviations of the localisation with the limits."""
        believed, limit = self.skills.world.base, self.max_position_std
        if believed.position_std > limit:
            return "no_pose", f"the believed base position is uncertain by ±{believed.position_std:.1f} m"
        if self.skills.base.localisation.lost:
            return "lost", "the base is not localised"
        return None


def _places_text(places: tuple[Place, ...]) -> str:
    if not places:
        return "no place of the map matches the scans"
    best = places[0]
    where = f"({best.pose.x:.2f}, {best.pose.y:.2f}) m, {math.degrees(best.pose.theta):.0f}°"
    if len(places) == 1:
        return f"the base is at {where}"
    return f"the base is at {where} with a probability of {best.probability:.0%}; {len(places)} places match the scans"
