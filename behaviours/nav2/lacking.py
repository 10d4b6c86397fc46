"""Nav2's leaves that have no counterpart here: their trees load, and where one is ticked it says what it lacks."""

from __future__ import annotations

from typing import ClassVar

from behaviours.nav2.ports import SERVER, SERVICE, Nav2Errors, nothing_written, without_meaning
from behaviours.skill import InstantSkill, SkillCondition, SkillFailure
from bestman_bt.engine import In

_ROUTE_INPUTS = without_meaning("start", "goal", "start_id", "goal_id", "use_start", "use_poses")
_ROUTE_OUTPUTS = nothing_written("route", "path")


class _Lacking(Nav2Errors, InstantSkill):
    """Fail, and say why."""

    LACKS: ClassVar = ""
    FAILS: ClassVar = {"not_available": "nothing: there is no such thing here; give the tree another way"}

    def act(self) -> None:
        """Say it."""
        raise SkillFailure("not_available", self.LACKS)


class ComputeRoute(_Lacking):
    """A route over a graph; there is none here."""

    LACKS: ClassVar = "there is no route graph here; ComputePathToPose plans on the map"
    INPUT_PORTS: ClassVar = {**SERVER, **_ROUTE_INPUTS}
    OUTPUT_PORTS: ClassVar = {**_ROUTE_OUTPUTS, **nothing_written("planning_time")}


class ComputeAndTrackRoute(_Lacking):
    """A route over a graph, tracked; there is none here."""

    LACKS: ClassVar = ComputeRoute.LACKS
    INPUT_PORTS: ClassVar = {**SERVER, **_ROUTE_INPUTS}
    OUTPUT_PORTS: ClassVar = {
        **_ROUTE_OUTPUTS,
        **nothing_written("execution_duration", "last_node_id", "next_node_id", "current_edge_id", "rerouted"),
    }


class ExtractRouteNodesAsGoals(_Lacking):
    """The places of a route; there is none here."""

    LACKS: ClassVar = ComputeRoute.LACKS
    INPUT_PORTS: ClassVar = without_meaning("route")
    OUTPUT_PORTS: ClassVar = nothing_written("goals")


class AssistedTeleop(_Lacking):
    """Driving by hand, with collision checks; trees do not do that here."""

    LACKS: ClassVar = "nobody drives by hand through a tree here"
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("is_recovery", "time_allowance")}


class FollowObject(_Lacking):
    """Driving after something that moves; there is no such controller here."""

    LACKS: ClassVar = "there is no controller here that follows what moves"
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("pose_topic", "max_duration", "tracked_frame")}
    OUTPUT_PORTS: ClassVar = nothing_written("total_elapsed_time")


class ToggleCollisionMonitor(_Lacking):
    """Nothing to do to enable the collision monitor, which is always on; it cannot be switched off."""

    LACKS: ClassVar = "the collision monitor cannot be switched off by a tree"
    INPUT_PORTS: ClassVar = {**SERVICE}
    enable = In(bool, "false is refused", default=True)

    def act(self) -> None:
        """Refuse to disable it."""
        if not self.enable:
            raise SkillFailure("not_available", self.LACKS)


class _LackingCondition(SkillCondition):
    """Fail, and say why."""

    LACKS: ClassVar = ""
    FAILS: ClassVar = {"not_available": "nothing: there is no such thing here; give the tree another way"}

    def check(self) -> tuple[str, str] | None:
        """Say it."""
        return "not_available", self.LACKS


class IsBatteryLow(_LackingCondition):
    """Whether the battery is low; no robot here tells."""

    LACKS: ClassVar = "no part of the robot tells the state of its battery"
    INPUT_PORTS: ClassVar = without_meaning("min_battery", "battery_topic", "is_voltage")


class IsBatteryCharging(_LackingCondition):
    """Whether the battery is charged; no robot here tells."""

    LACKS: ClassVar = IsBatteryLow.LACKS
    INPUT_PORTS: ClassVar = without_meaning("battery_topic")


class TransformAvailable(_LackingCondition):
    """Whether a transform of ROS is there; there is no tf here."""

    LACKS: ClassVar = "there is no tf here; InitialPoseReceived asks whether the base knows where it is"
    INPUT_PORTS: ClassVar = without_meaning("child", "parent")
