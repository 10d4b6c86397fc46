"""Nav2's leaves without a counterpart: their trees load, and ticking one fails with the reason."""

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
    FAILS: ClassVar = {"not_available": "this feature is not available; give the tree an alternative"}

    def act(self) -> None:
        """Fail with the reason."""
        raise SkillFailure("not_available", self.LACKS)


class ComputeRoute(_Lacking):
    """Compute a route over a graph; not supported."""

    LACKS: ClassVar = "route graphs are not supported; ComputePathToPose plans on the map"
    INPUT_PORTS: ClassVar = {**SERVER, **_ROUTE_INPUTS}
    OUTPUT_PORTS: ClassVar = {**_ROUTE_OUTPUTS, **nothing_written("planning_time")}


class ComputeAndTrackRoute(_Lacking):
    """Compute and track a route over a graph; not supported."""

    LACKS: ClassVar = ComputeRoute.LACKS
    INPUT_PORTS: ClassVar = {**SERVER, **_ROUTE_INPUTS}
    OUTPUT_PORTS: ClassVar = {
        **_ROUTE_OUTPUTS,
        **nothing_written("execution_duration", "last_node_id", "next_node_id", "current_edge_id", "rerouted"),
    }


class ExtractRouteNodesAsGoals(_Lacking):
    """Extract the nodes of a route as goals; not supported."""

    LACKS: ClassVar = ComputeRoute.LACKS
    INPUT_PORTS: ClassVar = without_meaning("route")
    OUTPUT_PORTS: ClassVar = nothing_written("goals")


class AssistedTeleop(_Lacking):
    """Teleoperate with collision checks; not supported in trees."""

    LACKS: ClassVar = "teleoperation is not supported in trees"
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("is_recovery", "time_allowance")}


class FollowObject(_Lacking):
    """Follow a moving object; not supported."""

    LACKS: ClassVar = "following moving objects is not supported"
    INPUT_PORTS: ClassVar = {**SERVER, **without_meaning("pose_topic", "max_duration", "tracked_frame")}
    OUTPUT_PORTS: ClassVar = nothing_written("total_elapsed_time")


class ToggleCollisionMonitor(_Lacking):
    """Enable the collision monitor, which is always on; disabling it is refused."""

    LACKS: ClassVar = "the collision monitor cannot be switched off by a tree"
    INPUT_PORTS: ClassVar = {**SERVICE}
    enable = In(bool, "false is refused", default=True)

    def act(self) -> None:
        """Raise SkillFailure if disabling is requested."""
        if not self.enable:
            raise SkillFailure("not_available", self.LACKS)


class _LackingCondition(SkillCondition):
    """Fail, and say why."""

    LACKS: ClassVar = ""
    FAILS: ClassVar = {"not_available": "this feature is not available; give the tree an alternative"}

    def check(self) -> tuple[str, str] | None:
        """Fail with the reason."""
        return "not_available", self.LACKS


class IsBatteryLow(_LackingCondition):
    """Check whether the battery is low; not supported, as no part reports its battery to trees."""

    LACKS: ClassVar = "no part of the robot reports the state of its battery"
    INPUT_PORTS: ClassVar = without_meaning("min_battery", "battery_topic", "is_voltage")


class IsBatteryCharging(_LackingCondition):
    """Check whether the battery is charging; not supported."""

    LACKS: ClassVar = IsBatteryLow.LACKS
    INPUT_PORTS: ClassVar = without_meaning("battery_topic")


class TransformAvailable(_LackingCondition):
    """Check whether a transform of ROS is available; not supported, as there is no tf."""

    LACKS: ClassVar = "there is no tf; InitialPoseReceived checks whether the base is localised"
    INPUT_PORTS: ClassVar = without_meaning("child", "parent")
