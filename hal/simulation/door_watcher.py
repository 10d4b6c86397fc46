"""Checks that doors and drawers are moved only by contacts and their weight, and slowed only by dry friction."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.scene.scene import LATCH_TRAVEL, Articulation, PlacedFurniture, World
from hal.simulation.audit_record import Finding
from hal.simulation.guards import Reader
from hal.simulation.joint_motors import mass_distribution
from hal.simulation.simulation import Simulation

# Radians or metres, seconds, N m or N. Honest doors keep to their velocity within 1e-15; in a hand that trembles the
# solver leaves efforts of any size and sense at up to 0.01 per second, free ones slide against their friction exactly.
DRIFT = 1e-5
DRIFT_DECAY = 0.99
GAIN = 1e-3
MOVING = 1e-3
SLIDING = 0.05
EFFORT_TOLERANCE = (0.02, 0.01)  # share and least


@dataclass
class WatchedArticulation:
    """A door or drawer. ``friction``, ``latched``: efforts of its joint beyond and within ``travel``; ``falling``:
    largest speed gain by its weight in one step; ``position``, ``velocity``: after the previous step. ``drift``: recent
    motion without a velocity.
    """

    name: str
    body: int
    joint: int
    upper: float
    friction: float
    latched: float
    travel: float
    falling: float
    position: float
    velocity: float
    drift: float = 0.0
    accused: bool = False


class DoorWatcher:
    """Checks doors and drawers after every physics step.

    Each must have moved by exactly its velocity. It may gain speed only if something presses on it, its weight pulls,
    or it leaves an end stop that it was pressed into. The motor of its joint, which represents dry friction and the
    latch (``hal.simulation.doors``), must have exerted their effort against the motion: no more, and no less while it
    slides.
    """

    def __init__(self, simulation: Simulation, world: World, reader: Reader) -> None:
        built = simulation.built
        self._simulation, self._time_step = simulation, simulation.parameters.time_step
        self._states, self._contacts, self._robot = reader.joint_states, reader.contacts, built.robot
        # A cup pulls at what it touches, however lightly.
        hands = simulation.model.of(GripperModel).values()
        self._cups = {
            built.links[link] for hand in hands if hand.part.kind == "suction" for link in hand.part.finger_links
        }
        self._pieces: list[tuple[int, list[int], list[WatchedArticulation]]] = []
        scripted = {door.articulation for door in world.moving_doors}
        for piece in world.furniture:
            doors = []
            for articulation in piece.model.articulations:
                name = f"{piece.name}/{articulation.name}"
                if name in scripted:  # what moves it is told as a disturbance
                    continue
                body, joint = built.articulations[name]
                door = WatchedArticulation(
                    name=name,
                    body=body,
                    joint=joint,
                    upper=articulation.upper,
                    friction=articulation.friction,
                    latched=articulation.friction + articulation.latch,
                    travel=LATCH_TRAVEL[articulation.kind],
                    falling=_acceleration_by_weight(piece, articulation) * self._time_step,
                    position=reader.joint_states(body, [joint])[0][0],
                    velocity=0.0,
                )
                doors.append(door)
            if doors:
                self._pieces.append((doors[0].body, [door.joint for door in doors], doors))
        self.jumps: list[Finding] = []
        self.unexplained_forces: list[Finding] = []

    def watch_step(self, pushed: Collection[str] = ()) -> None:
        """Process the joints after one physics step. ``pushed``: doors and drawers that an intervention holds."""
        for body, joints, doors in self._pieces:
            for door, position, velocity, effort in zip(doors, *self._states(body, joints), strict=True):
                if velocity != door.velocity or position != door.position:  # else it rests as it did
                    self._watch(door, position, velocity, effort, door.name in pushed)

    def _watch(self, door: WatchedArticulation, position: float, velocity: float, effort: float, pushed: bool) -> None:
        door.drift = DRIFT_DECAY * door.drift + position - door.position - velocity * self._time_step
        if abs(door.drift) > DRIFT:
            self.jumps.append(Finding(self._stamp, f"{door.name} moved by {door.drift:.5f} without a velocity"))
            door.drift = 0.0
        fault = ""
        if not pushed:  # that is told as a disturbance
            fault = self.motor_fault(door, velocity, effort) or self._fault_of_speed(door, velocity)
        if fault and not door.accused:
            self.unexplained_forces.append(Finding(self._stamp, f"{door.name} {fault}"))
        door.accused = bool(fault) or (door.accused and abs(velocity) > MOVING)
        door.position, door.velocity = position, velocity

    def motor_fault(self, door: WatchedArticulation, velocity: float, effort: float) -> str:
        """Return, as text, the deviation of a joint motor's effort from friction and latch; empty without a
        deviation.
        """
        owed = door.latched if abs(door.position) < door.travel else door.friction
        slack = EFFORT_TOLERANCE[0] * owed + EFFORT_TOLERANCE[1]
        if abs(effort) > owed + slack:
            return f"is driven by its joint with {abs(effort):.2f}, its friction is {owed:.2f}"
        if abs(velocity) < MOVING or (effort * velocity < 0.0 and abs(effort) > owed - slack):
            return ""
        slides = min(velocity * door.velocity, velocity**2) > SLIDING**2
        if not slides and (self._leaves_stop(door, velocity) or self._is_pressed(door)):
            return ""
        if effort * velocity > 0.0:
            return f"is driven by its joint with {abs(effort):.2f}"
        return f"slides against {abs(effort):.2f}, its friction is {owed:.2f}"

    def _fault_of_speed(self, door: WatchedArticulation, velocity: float) -> str:
        gained = abs(velocity) - max(0.0, math.copysign(door.velocity, velocity * door.velocity))
        if gained <= GAIN + door.falling:
            return ""
        if self._leaves_stop(door, velocity) or self._is_pressed(door):
            return ""
        return f"gained {gained:.4f} per second in a step, and nothing pressed on it"

    def _leaves_stop(self, door: WatchedArticulation, velocity: float) -> bool:
        """Return whether an end stop that it was pressed into pushes it back, no further than out of the stop."""
        beyond = max(-door.position, door.position - door.upper)
        return (velocity > 0.0) is (door.position < 0.0) and abs(velocity) * self._time_step < beyond

    def _is_pressed(self, door: WatchedArticulation) -> bool:
        return any(
            touch.pressure > 0.0 or (touch.second == self._robot and touch.second_link in self._cups)
            for touch in self._contacts(door.body, door.joint)
        )

    @property
    def _stamp(self) -> float:
        return self._simulation.elapsed


def _acceleration_by_weight(piece: PlacedFurniture, door: Articulation) -> float:
    """Return the most that the weight of a door or drawer can speed it up along or about its axis, m/s² or rad/s²."""
    axis = np.array(door.axis)
    upright = abs(float((piece.pose.rotation @ axis)[2]))
    if door.kind == "prismatic":
        return GRAVITY * upright
    tilt = math.sqrt(max(0.0, 1.0 - upright**2))
    if tilt < 1e-6:
        return 0.0
    centre, inertia = mass_distribution(door.parts, door.mass)
    arm = float(np.linalg.norm(np.cross(axis, centre - np.array(door.origin))))
    return door.mass * GRAVITY * arm * tilt / (float(axis @ inertia @ axis) + door.mass * arm**2)
