"""The leaves of the ROSCon 2024 deliberation workshop, on PyRoboSim without ROS; what they do, for task planners.

The names and ports are those of the workshop's C++ nodes (pyrobosim_btcpp), so that its trees load unchanged.
"""

from __future__ import annotations

from pyrobosim.planning.actions import TaskAction

from behaviours.skill import Declaration
from bestman_bt.engine import FAILURE, SUCCESS, Condition, In, NodeRegistry, Out, SyncAction, ThreadedAction
from bestman_bt.task_planning.abilities import operator_of
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import Operator
from workshop_world import WorkshopWorld

ENOUGH = 30.0
"""Percent of the battery: no action and drive to the charger uses more."""


class RobotAction(ThreadedAction):
    """An action of the simulated robot: it blocks its caller, so it runs in a thread."""

    KIND = ""
    context: WorkshopWorld

    def on_work(self, inputs: TaskAction) -> int:
        """Execute it; a failure's message is the simulator's."""
        result = self.context.execute(inputs)
        if not result.is_success():
            self.feedback_message = result.message or result.status.name
        return SUCCESS if result.is_success() else FAILURE

    def on_halted(self) -> None:
        """Stop the robot, then wait for the thread."""
        self.context.cancel()
        super().on_halted()


class Navigate(RobotAction):
    """Drive to a location or hallway."""

    KIND = "navigate"
    target = In(str, "the name of a location or hallway")

    def prepare(self) -> TaskAction:
        """Return the action."""
        return TaskAction(self.KIND, target_location=self.target)


class Open(Navigate):
    """Open the location where the robot is."""

    KIND = "open"


class Close(Navigate):
    """Close the location where the robot is."""

    KIND = "close"


class PickObject(RobotAction):
    """Pick an object at the robot's location."""

    KIND = "pick"
    object = In(str, "its name")
    location = In(str, "where the planner expects it", default="")
    surface = In(str, "the part of the place that has it", default="")

    def prepare(self) -> TaskAction:
        """Return the action."""
        return TaskAction(self.KIND, object=self.object)


class PlaceObject(PickObject):
    """Place the held object at the robot's location."""

    KIND = "place"


class DetectObject(PickObject):
    """Look for an object at the robot's location."""

    KIND = "detect"


class GetCurrentLocation(SyncAction):
    """Write the name of the robot's location."""

    location = Out(str, "the robot's location")
    context: WorkshopWorld

    def on_tick(self) -> int:
        """Write it at once."""
        self.location = self.context.location
        return SUCCESS


class IsBatteryFull(Condition):
    """Whether the battery level is at least the threshold."""

    full_threshold = In(float, "percent", default=90.0)
    level = In(float, "percent", default="{@battery_level}")

    def on_tick(self) -> int:
        """Compare them."""
        return SUCCESS if self.level >= self.full_threshold else FAILURE


class IsBatteryLow(Condition):
    """Whether the battery level is below the threshold."""

    low_threshold = In(float, "percent", default=20.0)
    level = In(float, "percent", default="{@battery_level}")

    def on_tick(self) -> int:
        """Compare them."""
        return SUCCESS if self.level < self.low_threshold else FAILURE


class Holds(Condition):
    """Whether facts hold in the world; the conditions of planned trees."""

    fact = In(str, "on(bread0, table_tabletop) and not open(pantry)")
    context: WorkshopWorld

    def on_tick(self) -> int:
        """Look at the world."""
        facts = self.context.facts(ENOUGH)
        return SUCCESS if all(literal.holds_in(facts) for literal in parse_literals(self.fact)) else FAILURE


class Recharge(Navigate):
    """Drive to a charger: the same action, another effect for planners."""


def registry() -> NodeRegistry:
    """Return the nodes of BehaviorTree.CPP and the workshop's."""
    nodes = NodeRegistry()
    leaves = (Navigate, Open, Close, PickObject, PlaceObject, DetectObject, GetCurrentLocation, Recharge)
    for leaf in (*leaves, IsBatteryFull, IsBatteryLow, Holds):
        nodes.register(leaf)
    return nodes


def _operator(name: str, parameters: dict[str, str], pre: str, effects: str, cost: float = 1.0) -> Operator:
    return operator_of(name, Declaration(pre=(pre,), effects=(effects,), parameters=parameters, cost=cost))


def operators(world: WorkshopWorld) -> tuple[Operator, ...]:
    """Return what the leaves need and bring about, for planners.

    Where actions use the battery, the robot works with objects only once it can reach a charger.
    """
    safe = "".join(f"; reachable({charger})" for charger in world.chargers if world.uses_battery)
    arrives = "forall l - location: not at(l); at({target})"
    opens = "open({target}); forall l - location: beyond({target}, l) -> reachable(l)"
    here = f"charged; at({{location}}); contains({{location}}, {{surface}}); open({{location}}){safe}"
    return (
        _operator("Navigate", {"target": "location"}, "charged; reachable({target})", arrives),
        _operator("Recharge", {"target": "charger"}, "reachable({target})", f"{arrives}; charged", cost=5.0),
        _operator("Open", {"target": "location"}, "charged; at({target}); hand_empty; not open({target})", opens),
        _operator(
            "Close", {"target": "location"}, "charged; at({target}); hand_empty; open({target})", "not open({target})"
        ),
        _operator(
            "PickObject",
            {"object": "object", "location": "location", "surface": "surface"},
            f"{here}; on({{object}}, {{surface}}); hand_empty",
            "holding({object}); not hand_empty; not on({object}, {surface})",
        ),
        _operator(
            "PlaceObject",
            {"object": "object", "location": "location", "surface": "surface"},
            f"{here}; holding({{object}})",
            "on({object}, {surface}); hand_empty; not holding({object})",
        ),
    )
