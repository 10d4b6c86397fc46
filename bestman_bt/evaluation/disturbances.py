"""The scripted disturbances of a task, each triggered when a belief of the robot agrees with the ground truth."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from bestman_bt.configuration.task import DisturbanceConfig, DisturbanceKind
from bestman_bt.facts.evidence import Evidence
from bestman_bt.facts.standing import is_over, surface_pose
from bestman_bt.messages import JointKind, Pose, Pose2D
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.scene.placing import gap_to_furniture, gap_to_objects, planar_radius, standing_on
from bestman_bt.scene.plane_geometry import depth_inside, rectangle
from bestman_bt.scene.scene import PlacedObject
from bestman_bt.world_model.openness import articulation_called, is_open, openness_of
from hal.simulation.audit_record import DisturbanceEvent
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.ground_truth import GroundTruth

EDGE = 0.04
"""Distance between an object and the edge of its surface, metres: the map may be off by 3 cm."""
REACH = 0.35
"""Largest distance of an object from the front of a surface, metres."""
CLEARANCE = 0.08
"""Distance of an object from other objects, and from the goals of the scene, metres."""
HEIGHTS = (0.3, 1.1)
"""Heights above the floor of surfaces to which an object may be moved, metres."""
TRIES = 200


@dataclass(frozen=True)
class Relocation:
    """A new place of an object: ``surface`` (``furniture/name``) and ``pose`` in the map frame."""

    surface: str
    pose: Pose


class RelocationSampler:
    """Draws places in the current state of a world, including open drawers."""

    def __init__(self, session: RobotSession, truth: GroundTruth) -> None:
        self._evidence = Evidence(session.setup, truth, {})
        self._world, self._map = session.setup.world, session.skills.world.map
        self._models = {placed.name: placed.model for placed in self._world.objects}

    def beside(self, name: str, distance: tuple[float, float], rng: np.random.Generator) -> Relocation | None:
        """Return a place on the surface of an object, ``distance`` metres away, or None if none was found."""
        below = (surface for surface in self._surfaces(inside=True) if is_over(self._evidence, name, surface))
        for surface in below:
            here = (self._map_from(surface).inverse() @ self._evidence.truth.object_pose(name)).position
            for _ in range(TRIES):
                way, direction = rng.uniform(*distance), rng.uniform(-math.pi, math.pi)
                x, y = here[0] + way * math.cos(direction), here[1] + way * math.sin(direction)
                place = self._place(name, surface, float(x), float(y), rng)
                if place is not None:
                    return place
        return None

    def elsewhere(self, name: str, asked: str | None, rng: np.random.Generator) -> Relocation | None:
        """Return a place on the surface ``asked``, else on any open surface of other furniture, or None."""
        surfaces = list(self._surfaces(inside=False))
        if asked is None:
            below = self._evidence.truth.supports(name)
            surfaces = [surface for surface in surfaces if surface.partition("/")[0] not in below]
        else:
            surfaces = [surface for surface in surfaces if asked in (surface, surface.partition("/")[0])]
        for surface in rng.permutation(surfaces):
            _, _, (length, width), _ = surface_pose(self._evidence, surface)
            for _ in range(TRIES):
                x, y = rng.uniform(-length / 2, length / 2), rng.uniform(-width / 2, width / 2)
                place = self._place(name, str(surface), float(x), float(y), rng)
                if place is not None:
                    return place
        return None

    def _surfaces(self, inside: bool) -> Iterator[str]:
        """Yield the surfaces of the map as ``furniture/name``; with ``inside`` also those in drawers
        and behind doors.
        """
        for piece in self._map.furniture.values():
            for surface in piece.surfaces:
                name = f"{piece.name}/{surface.name}"
                height = float(self._map_from(name).position[2])
                if inside or (not piece.is_inside(surface) and HEIGHTS[0] < height < HEIGHTS[1]):
                    yield name

    def _map_from(self, surface: str) -> Pose:
        return surface_pose(self._evidence, surface)[1]

    def _place(self, name: str, surface: str, x: float, y: float, rng: np.random.Generator) -> Relocation | None:
        """Return the pose at ``x``, ``y`` of a surface (x from front to back) with a random yaw, or None if it is not
        suitable.
        """
        piece, map_from_surface, size, room = surface_pose(self._evidence, surface)
        model = self._models[name]
        on_surface = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        pose = standing_on(map_from_surface, on_surface, model)
        reached = x + size[0] / 2 < REACH and float(model.size[2]) < room
        inside = depth_inside(rectangle(Pose2D(), size), on_surface.xy) >= planar_radius(model) + EDGE
        if not (reached and inside):
            return None
        truth = self._evidence.truth
        others = {other: model for other, model in self._models.items() if other != name}
        kept_free = [
            *(PlacedObject(other, model, truth.object_pose(other)) for other, model in others.items()),
            *(PlacedObject(goal, model, there) for goal, there in self._world.goals.items()),
        ]
        gap = min(gap_to_objects(pose, model, kept_free), gap_to_furniture(pose, model, piece, self._world.furniture))
        return Relocation(surface, pose) if gap >= CLEARANCE else None


HAND_AWAY = 0.6
"""Smallest distance between the robot's hand and an object that a scripted person takes, metres."""
HAND_OUT = 0.35
"""Smallest distance between the robot's hand and the handle of a door or drawer that a scripted person pushes,
metres.
"""
LIFTED = 0.03
"""Height above its initial place from which an object counts as lifted, metres."""
ABOVE = 0.10
"""Horizontal distance from its initial place within which a slipping object falls back there and not onto the floor,
metres.
"""
STILL = (0.01, 0.1)
"""Speeds below which an object is at rest, m/s and rad/s."""
UPRIGHT = math.radians(10.0)
PUSH_SPEED: dict[JointKind, float] = {"prismatic": 0.25, "revolute": 0.8}
"""Speeds at which a scripted person shuts a drawer or door, m/s and rad/s."""
TRIES_AGAIN = 1.0
"""Seconds until an intervention that was blocked by the robot, or had no free space, is retried."""


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
    """Executes each of a task's disturbances once; call ``after_tick`` after each tick of the tree.

    The disturbance waits until its trigger also holds at the time of execution. The run's record lists the executed
    ones; a disturbance without an opportunity is not executed.
    """

    def __init__(self, session: RobotSession, truth: GroundTruth, injector: DisturbanceInjector) -> None:
        self._session, self._truth, self._injector = session, truth, injector
        self._places = RelocationSampler(session, truth)
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
        """Execute the due disturbances."""
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
        """Return the executed disturbances."""
        return tuple(script.event for script in self._scripts if script.event is not None)

    def _is_seen(self, script: _Script) -> bool:
        """Return whether the robot has seen the object and not held it yet, and the object stands still, upright, far
        from the hand.
        """
        name, truth = str(script.asked.object), self._truth
        if name not in self._session.skills.world.objects or name in self._was_held:
            return False
        speed, pose = truth.object_speed(name), truth.object_pose(name)
        rests = speed[0] < STILL[0] and speed[1] < STILL[1] and pose.tilt < UPRIGHT
        return rests and math.dist(self._hand(), pose.position) > HAND_AWAY

    def _is_lifted(self, script: _Script) -> bool:
        """Return whether the robot has lifted the object and it is still above its former place."""
        name, truth = str(script.asked.object), self._truth
        position = tuple(truth.object_pose(name).position.tolist())
        if not truth.touches_robot(name):
            if truth.supports(name):
                script.stood_at = position
            return False
        stood = script.stood_at
        return stood is not None and position[2] > stood[2] + LIFTED and math.dist(position[:2], stood[:2]) < ABOVE

    def _stands_open(self, script: _Script) -> bool:
        """Return whether the articulation was opened and the hand has left it."""
        name, world = str(script.asked.articulation), self._session.skills.world
        opened = self._truth.articulation_position(name)
        if not is_open(world, name) or opened < openness_of(articulation_called(world, name)).shut:
            return False
        piece = next(p for p in self._session.setup.world.furniture if p.name == name.partition("/")[0])
        door = next(a for a in piece.model.articulations if a.name == name.partition("/")[2])
        handle = piece.pose @ door.moved(opened) @ door.handle.pose
        return script.asked.object not in self._was_held and math.dist(self._hand(), handle.position) > HAND_OUT

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
        return self._injector.push_shut(name, PUSH_SPEED[articulation_called(self._session.skills.world, name).kind])

    def _put(self, asked: DisturbanceConfig, place: Relocation | None) -> _Event:
        if place is None:
            return None
        return self._injector.move_object(str(asked.object), place.pose, place.surface)

    def _hand(self) -> tuple[float, ...]:
        """Return the true position of the hand, map frame, metres."""
        pose = self._truth.frame_pose(self._session.skills.arm_model.tool_frame)
        return tuple(pose.position.tolist())
