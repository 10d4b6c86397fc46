"""A world of the workshop in PyRoboSim: its actions, its state as facts, its battery."""

from __future__ import annotations

import random
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pyrobosim.core.hallway import Hallway
from pyrobosim.core.locations import ObjectSpawn
from pyrobosim.core.yaml_utils import WorldYamlLoader
from pyrobosim.planning.actions import ExecutionResult, TaskAction

from bestman_bt.task_planning.symbolic.problem import Fact


class WorkshopWorld:
    """``seed``: of failing actions and of the path planner; ``speed``: times real time, negative as fast as possible.

    ``actions``: number of actions so far, failed ones included. ``empty``: whether the battery has ever been empty.
    """

    def __init__(self, file: Path, seed: int, speed: float) -> None:
        random.seed(seed)
        np.random.seed(seed)  # noqa: NPY002 - PyRoboSim draws from the global generator
        self.world = WorldYamlLoader().from_file(file)
        self.robot = self.world.robots[0]
        for number, options in enumerate(self.robot.action_execution_options.values()):
            options.rng = np.random.default_rng([seed, number])
        self.speed = speed
        self.actions = 0
        self.empty = False

    def execute(self, action: TaskAction) -> ExecutionResult:
        """Execute an action to its end."""
        self.actions += 1
        result = self.robot.execute_action(action, realtime_factor=self.speed)
        self.empty = self.empty or self.battery <= 0.0
        return result

    def cancel(self) -> None:
        """Stop what the robot is doing."""
        if self.robot.is_busy():
            self.robot.cancel_actions()

    @property
    def battery(self) -> float:
        """The battery level in percent."""
        return float(self.robot.battery_level)

    @property
    def uses_battery(self) -> bool:
        """Whether any action uses the battery."""
        return any(options.battery_usage for options in self.robot.action_execution_options.values())

    @property
    def chargers(self) -> list[str]:
        """The names of the locations that charge the battery."""
        return [place.name for place in self.world.locations if place.is_charger]

    @property
    def location(self) -> str:
        """The name of the robot's location."""
        return str(self.robot.location.name)

    def _sides(self) -> dict[str, tuple[str, ...]]:
        """Return location → the rooms from which it can be reached: two of a hallway."""
        rooms = {hall.name: (hall.room_start.name, hall.room_end.name) for hall in self.world.hallways}
        return rooms | {place.name: (place.parent.name,) for place in self.world.locations}

    def _room(self) -> str:
        location = self.robot.location
        if isinstance(location, Hallway):
            return str(location.room_start.name)
        return str(location.parent.parent.name if isinstance(location, ObjectSpawn) else location.name)

    def _reached(self) -> set[str]:
        """Return the rooms that the robot can reach through open hallways."""
        location, rooms = self.robot.location, {self._room()}
        if isinstance(location, Hallway) and location.is_open:
            rooms.add(location.room_end.name)
        ways = [(hall.room_start.name, hall.room_end.name) for hall in self.world.hallways if hall.is_open]
        while added := {room for way in ways if rooms & set(way) for room in way} - rooms:
            rooms |= added
        return rooms

    def objects(self) -> dict[str, str]:
        """Return name → type, for planners."""
        places = {name: "charger" if name in self.chargers else "location" for name in self._sides()}
        surfaces = {spawn.name: "surface" for place in self.world.locations for spawn in place.children}
        return places | surfaces | {thing.name: "object" for thing in self.world.objects}

    def fixed(self) -> Iterable[Fact]:
        """Yield what no action changes."""
        sides = self._sides()
        for place in self.world.locations:
            for spawn in place.children:
                yield Fact("contains", (place.name, spawn.name))
        for hall in self.world.hallways:
            for name, rooms in sides.items():
                if set(rooms) & set(sides[hall.name]):
                    yield Fact("beyond", (hall.name, name))

    def facts(self, enough: float) -> frozenset[Fact]:
        """Return all facts that hold; ``charged``: the battery level is at least ``enough``."""
        found = set(self.fixed())
        rooms = self._reached()
        for name, sides in self._sides().items():
            if rooms & set(sides):
                found.add(Fact("reachable", (name,)))
        for place in (*self.world.locations, *self.world.hallways):
            if place.is_open:
                found.add(Fact("open", (place.name,)))
        location = self.robot.location
        place = location.parent if isinstance(location, ObjectSpawn) else location
        found.add(Fact("at", (place.name,)))
        held = self.robot.manipulated_object
        found.add(Fact("holding", (held.name,)) if held is not None else Fact("hand_empty"))
        for thing in self.world.objects:
            if thing is not held:
                found.add(Fact("on", (thing.name, thing.parent.name)))
        if self.battery >= enough:
            found.add(Fact("charged"))
        return frozenset(found)
