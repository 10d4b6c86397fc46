"""The script of a task's disturbances: somebody disturbs when the robot believes something and it is so."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bestman_bt.configuration import DisturbanceConfig
from bestman_bt.configuration.disturbance import DisturbanceKind
from bestman_bt.evaluation.new_places import NewPlace, NewPlaces
from bestman_bt.messages import JointKind
from bestman_bt.runtime import Session
from bestman_bt.world_model import is_open, leaf_called, openness_of
from hal.simulation import DisturbanceEvent, DisturbanceInjector, GroundTruth

HAND_AWAY = 0.6
"""Metres between the robot's hand and an object that somebody else takes."""
HAND_OUT = 0.35
"""Metres between the robot's hand and the handle of a door or drawer that somebody else pushes."""
LIFTED = 0.03
"""Metres above where it stood from which on an object counts as lifted."""
ABOVE = 0.10
"""Metres beside where it stood within which a lifted object falls back there when it slips, and not on the floor."""
STILL = (0.01, 0.1)
"""Metres and radians per second below which an object rests."""
UPRIGHT = math.radians(10.0)
PUSH_SPEED: dict[JointKind, float] = {"prismatic": 0.25, "revolute": 0.8}
"""Metres and radians per second at which somebody shuts a drawer or door."""
TRIES_AGAIN = 1.0
"""Seconds after which somebody tries again who was in the robot's way or found no room."""


_Event = DisturbanceEvent | None


@dataclass
class _Script:
    """``delay``: seconds from trigger to event. ``due``: when that is. ``event``: once it is done.

    ``stood_at``: where an object last stood.
    """

    asked: DisturbanceConfig
    rng: np.random.Generator
    delay: float
    due: float | None = None
    event: DisturbanceEvent | None = None
    stood_at: tuple[float, ...] | None = None


class Disturbances:
    """Does each of a task's disturbances once; call ``after_tick`` after each tick of the tree.

    What triggers one has to hold when it is done, too: until then, somebody waits. The run's record tells what was
    done; what found no occasion was not.
    """

    def __init__(self, session: Session, truth: GroundTruth, injector: DisturbanceInjector) -> None:
        self._session, self._truth, self._injector = session, truth, injector
        self._places = NewPlaces(session, truth)
        self._was_held: set[str] = set()
        self._scripts = []
        for index, asked in enumerate(session.setup.config.task.disturbances):
            rng = np.random.default_rng([session.setup.config.seed, zlib.crc32(b"disturbances"), index])
            if asked.object is None or asked.object in truth.object_names:  # else the seed has left it out
                self._scripts.append(_Script(asked, rng, float(rng.uniform(*asked.after))))
        self._kinds: Mapping[DisturbanceKind, tuple[Callable[[_Script], bool], Callable[[_Script], _Event]]] = {
            "moved": (self._is_seen, self._move_on_surface),
            "elsewhere": (self._is_seen, self._move_elsewhere),
            "slips": (self._is_lifted, self._let_slip),
            "shut": (self._stands_open, self._shut),
        }

    def after_tick(self) -> None:
        """Do what is due."""
        now, hands = self._session.robot.clock.now(), self._session.skills.world.hands
        self._was_held |= {held.name for held in hands.values()}
        for script in self._scripts:
            happens, act = self._kinds[script.asked.kind]
            if script.event is not None or not happens(script):
                continue
            if script.due is None:
                script.due = now + script.delay
            if now >= script.due:
                script.event = act(script)
                script.due = now + TRIES_AGAIN

    @property
    def events(self) -> tuple[DisturbanceEvent, ...]:
        """What was done up to now: whatever else the monitor was told is none of this script's doing."""
        return tuple(script.event for script in self._scripts if script.event is not None)

    # What has to happen

    def _is_seen(self, script: _Script) -> bool:
        """The robot knows where it is, has not had it in its hand yet, and the hand is far away."""
        name, truth = str(script.asked.object), self._truth
        if name not in self._session.skills.world.objects or name in self._was_held:
            return False
        speed, pose = truth.object_speed(name), truth.object_pose(name)
        rests = speed[0] < STILL[0] and speed[1] < STILL[1] and pose.tilt < UPRIGHT
        return rests and math.dist(self._hand(), pose.position) > HAND_AWAY

    def _is_lifted(self, script: _Script) -> bool:
        """The robot has lifted it, and it is still above where it stood."""
        name, truth = str(script.asked.object), self._truth
        position = tuple(truth.object_pose(name).position.tolist())
        if not truth.touches_robot(name):
            if truth.supports(name):
                script.stood_at = position
            return False
        stood = script.stood_at
        return stood is not None and position[2] > stood[2] + LIFTED and math.dist(position[:2], stood[:2]) < ABOVE

    def _stands_open(self, script: _Script) -> bool:
        """It was opened, and the hand is out of it again."""
        name, world = str(script.asked.articulation), self._session.skills.world
        opened = self._truth.articulation_position(name)
        if not is_open(world, name) or opened < openness_of(leaf_called(world, name)).shut:
            return False
        piece = next(p for p in self._session.setup.world.furniture if p.name == name.partition("/")[0])
        leaf = next(a for a in piece.model.articulations if a.name == name.partition("/")[2])
        handle = piece.pose @ leaf.moved(opened) @ leaf.handle.pose
        return script.asked.object not in self._was_held and math.dist(self._hand(), handle.position) > HAND_OUT

    # What somebody then does

    def _move_on_surface(self, script: _Script) -> _Event:
        asked = script.asked
        return self._put(asked, self._places.beside(str(asked.object), asked.distance, script.rng))

    def _move_elsewhere(self, script: _Script) -> _Event:
        asked = script.asked
        return self._put(asked, self._places.elsewhere(str(asked.object), asked.surface, script.rng))

    def _let_slip(self, script: _Script) -> _Event:
        return self._injector.let_slip(str(script.asked.object))

    def _shut(self, script: _Script) -> _Event:
        name = str(script.asked.articulation)
        return self._injector.push_shut(name, PUSH_SPEED[leaf_called(self._session.skills.world, name).kind])

    def _put(self, asked: DisturbanceConfig, place: NewPlace | None) -> _Event:
        if place is None:
            return None
        return self._injector.move_object(str(asked.object), place.pose, place.surface)

    def _hand(self) -> tuple[float, ...]:
        """Where the hand really is, in the map frame, metres."""
        pose = self._truth.frame_pose(self._session.skills.arm_model.tool_frame)
        return tuple(pose.position.tolist())
