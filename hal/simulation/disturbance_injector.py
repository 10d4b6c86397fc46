"""Interventions in a run: moves objects, pushes drawers shut, makes held objects slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import Pose
from hal.simulation.audit_record import DisturbanceEvent, Finding
from hal.simulation.bodies import among
from hal.simulation.doors import DoorPush, Hand
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot

KEEPS_AWAY = 0.10
"""Distance from the robot and its held object within which no intervention places an object or pushes, metres."""
OVERLAP = 1e-3
"""Maximum overlap of an object with others at a free place, metres."""
PUTS_DOWN_FROM = 5e-4
"""Height above the surface from which an object is released, metres."""
OUT_OF_HAND = 0.1
"""Seconds without robot contact after which an object counts as having slipped out of the hand."""
SLIP_TIME = 1.5
"""Seconds after which an object that stays in the hand without friction gets its friction back."""
FALL_TIME = 2.0
"""Seconds in which a dropped object comes to rest."""
PUSH_TIME = 10.0
"""Seconds after which a blocked push is given up."""
ENDS_WITHIN = 0.1
"""Seconds after its end time within which a slip or a push has ended; checked after every control period."""
PUSH_EFFORT = {"prismatic": 30.0, "revolute": 10.0}
"""Maximum force and torque of a pushing hand, N and N m."""


@dataclass
class _Push:
    event: DisturbanceEvent
    push: DoorPush
    until: float


@dataclass
class _Slip:
    """``friction``: the object's own, restored at ``until`` at the latest.

    ``touched_at``: when the robot last touched it.
    """

    event: DisturbanceEvent
    friction: tuple[float, float]
    until: float
    touched_at: float


class DisturbanceInjector:
    """The actions of scripted disturbances. Create it right after ``robot.connect()``, before ``close_truth``.

    Its actions are listed in ``AuditRecord.disturbances`` and are not faults of the run if the evaluation knows of
    them: each action returns its event, and ``audit`` compares these with those that the monitor has excused. An
    injector created later also works, but all its actions count as tampering. It never acts within ``KEEPS_AWAY`` of
    the robot, except by ``let_slip``, so it never causes a contact of the robot.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        self._simulation = simulation = robot.simulation
        self._reader = simulation.reader(ReadPurpose.SCRIPT)
        self._log = robot.disturbance_log()
        self._engine = simulation.actor()
        self._hand = Hand(self._engine)
        self._doors = {
            f"{piece.name}/{door.name}": door for piece in robot.world.furniture for door in piece.model.articulations
        }
        self._pushes: list[_Push] = []
        self._slips: dict[int, _Slip] = {}
        self._falls: dict[int, tuple[DisturbanceEvent, float]] = {}
        simulation.controls.append(self._update)

    def move_object(self, name: str, pose: Pose, surface: str) -> DisturbanceEvent | None:
        """Move an object to ``pose`` in the map frame, at rest; ``surface``: description of the place.

        Returns None, without an effect, while the robot or another object touches it, or its new place is occupied.
        """
        body = among(self._simulation.built.objects, name, "object")
        before = self._reader.body_pose(body)
        if self._near_robot(body) or self._touches_objects(body):
            return None
        raised = (pose.position + np.array((0.0, 0.0, PUTS_DOWN_FROM))).tolist()
        self._engine.put(body, raised, pose.quaternion.tolist())
        if self._near_robot(body) or self._overlaps(body):
            self._engine.put(body, *before)
            return None
        way = float(np.linalg.norm(pose.position - before[0]))
        text = f"a person moves the {name} by {way:.2f} m, on {surface}"
        event = DisturbanceEvent(self._now, self._now, "put", name, text, (*raised, *pose.quaternion.tolist()))
        self._log.announce(event)
        return event

    def push_shut(self, articulation: str, speed: float) -> DisturbanceEvent | None:
        """Start to push a door or drawer shut with the force of a hand; ``speed``: m/s or rad/s.

        Returns None, without an effect, while the robot is near. If it comes near later, the hand waits.
        """
        place = among(self._simulation.built.articulations, articulation, "door or drawer")
        door = self._doors[articulation]
        if any(running.push.place == place for running in self._pushes) or self._near_robot(*place):
            return None
        push = DoorPush(place, door, 0.0, speed, PUSH_EFFORT[door.kind])
        until, text = self._now + PUSH_TIME, f"a person pushes {articulation} shut"
        event = DisturbanceEvent(self._now, until + ENDS_WITHIN, "push", articulation, text)
        self._pushes.append(_Push(event, push, until))
        self._log.announce(event)
        return event

    def let_slip(self, name: str) -> DisturbanceEvent | None:
        """Remove an object's friction until it is out of the hand; returns None if the robot does not touch it."""
        body = among(self._simulation.built.objects, name, "object")
        if body in self._slips or not self._touched(body):
            return None
        friction, until = self._engine.friction(body), self._now + SLIP_TIME
        event = DisturbanceEvent(
            self._now, until + FALL_TIME + ENDS_WITHIN, "slip", name, f"the {name} slips in the hand"
        )
        self._slips[body] = _Slip(event, friction, until, self._now)
        self._log.announce(event)
        self._engine.set_friction(body, 0.0, 0.0)
        return event

    @property
    def _now(self) -> float:
        """As the monitor's stamps: seconds since the scene was built."""
        return self._simulation.elapsed

    def _record(self, text: str) -> None:
        self._log.record(Finding(self._now, text))

    def _update(self) -> None:
        """Update the events, before each control period."""
        self._pushes = [running for running in self._pushes if not self._push_ends(running)]
        for body, (event, until) in list(self._falls.items()):
            if self._now > until or self._touched(body):
                self._log.rest(event)
                del self._falls[body]
        for body, slip in list(self._slips.items()):
            if self._touched(body):
                slip.touched_at = self._now
            out = self._now - slip.touched_at > OUT_OF_HAND
            if out or self._now > slip.until:
                self._engine.set_friction(body, *slip.friction)
                del self._slips[body]
                self._falls[body] = (slip.event, self._now + FALL_TIME)
                self._record(f"the {slip.event.name} is {'out of' if out else 'still in'} the hand")

    def _push_ends(self, running: _Push) -> bool:
        """Push on, or wait where the robot is near; whether that was the last of it."""
        push, event = running.push, running.event
        if self._near_robot(*push.place):
            self._hand.rest(push)
            self._log.rest(event)
        elif self._hand.push(push):
            self._log.rest(event)
            self._record(f"a person has shut {event.name}")
            return True
        else:
            self._log.resume(event)
        if self._now < running.until:
            return False
        self._hand.rest(push)
        self._log.rest(event)
        self._record(f"a person releases {event.name}")
        return True

    def _touched(self, body: int) -> bool:
        return bool(self._reader.contacts(self._simulation.built.robot, other=body))

    def _touches_objects(self, body: int) -> bool:
        others = set(self._simulation.built.objects.values())
        return any(contact.second in others for contact in self._reader.contacts(body))

    def _near_robot(self, body: int, link: int | None = None) -> bool:
        """Return whether the robot, or an object that it touches, is within ``KEEPS_AWAY`` of a body or one of its
        links.
        """
        built = self._simulation.built
        held = [other for other in built.objects.values() if other != body and self._touched(other)]
        return any(self._reader.gaps(other, body, KEEPS_AWAY, link) for other in (built.robot, *held))

    def _overlaps(self, body: int) -> bool:
        """Return whether a body overlaps others at their current poses."""
        return any(
            gap < -OVERLAP
            for other in self._simulation.built.body_names
            if other != body
            for gap in self._reader.gaps(body, other, 0.0)
        )
