"""Wheeled bases: localisation that runs all the time, and one driving action at a time on top of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.handle import ControlHandle
from bestman_bt.control.wheeled.action_loop import ActionLoop, ActionLoopParameters
from bestman_bt.control.wheeled.base_action import DrivenPath
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.localisation_cycle import (
    LocalisationCycle,
    LocalisationCycleParameters,
    PlacedScan,
)
from bestman_bt.control.wheeled.motion_limits import footprint_of, motion_limits
from bestman_bt.control.wheeled.velocity_gate import VelocityGate
from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning import Costmap
from bestman_bt.navigation.local_planning import (
    ObstacleLayer,
    PathFollower,
    RotateToHeading,
    SweptPath,
)
from bestman_bt.navigation.localization import LocalizationEstimate, Localizer, OdometryScan, WheelOdometry
from bestman_bt.sensing.inertial import FusedOdometry
from bestman_bt.sensing.lidar import LidarSensor
from bestman_bt.world_model import BasePose, WorldModel
from hal.api import BaseDescription, Clock, MobileBase, Timer


@dataclass(frozen=True)
class BaseControllerParameters:
    """Those of its two halves."""

    localisation: LocalisationCycleParameters = field(default_factory=LocalisationCycleParameters)
    actions: ActionLoopParameters = field(default_factory=ActionLoopParameters)


class BaseController:
    """Drives one base by odometry and lidar; keeps ``world.base`` up to date from ``start`` to ``close``.

    A new action supersedes the one under way. Every handle's result is the believed pose at the end. ``odometry``: of
    wheels and gyroscope together; by default that of the wheels. ``monitor``: has the last word on each velocity; by
    default one without a bumper. ``layer``: what the lidar sees and the map lacks.
    """

    def __init__(
        self,
        base: MobileBase,
        clock: Clock,
        lidar: LidarSensor,
        localizer: Localizer,
        follower: PathFollower,
        world: WorldModel,
        parameters: BaseControllerParameters | None = None,
        rotation: RotateToHeading | None = None,
        odometry: FusedOdometry | None = None,
        monitor: CollisionMonitor | None = None,
        layer: ObstacleLayer | None = None,
    ) -> None:
        p = parameters or BaseControllerParameters()
        self._base, self._clock, self._follower, self._world = base, clock, follower, world
        self._rotation = rotation or RotateToHeading()
        self._gate = VelocityGate(base, monitor or CollisionMonitor(base.description))
        self.layer = layer or ObstacleLayer()
        odometer = odometry or FusedOdometry(base, clock, WheelOdometry())
        self._where = LocalisationCycle(clock, lidar, localizer, odometer, world, p.localisation, self._observe)
        self._period = 1.0 / p.localisation.rate
        self._loop = ActionLoop(
            base, clock, self._where, self._gate, self._rotation, self.layer, world, p.actions, self._period
        )
        self.last_scan: PlacedScan | None = None
        """What the localisation saw last, for whoever shows it."""
        self._timer: Timer | None = None
        self._own_follower = follower
        follower.configure(motion_limits(base.description))

    @property
    def name(self) -> str:
        """The base's name in its robot."""
        return self._base.name

    @property
    def description(self) -> BaseDescription:
        """Limits and footprint of the base."""
        return self._base.description

    @property
    def estimate(self) -> LocalizationEstimate:
        """The localizer's estimate; RuntimeError before ``start``."""
        return self._where.estimate

    @property
    def lost(self) -> bool:
        """Whether the base does not know where it is: it drives by the map only after a scan has fitted again."""
        return self._where.lost

    @property
    def base_from_lidar(self) -> Pose2D:
        """The lidar's pose in the base frame."""
        return self._where.base_from_lidar

    @property
    def path(self) -> Path2D | None:
        """The path that is driven, None where none is."""
        driven = self._loop.driven
        return None if driven is None else driven.path

    @property
    def remaining(self) -> float:
        """Metres that are left of ``path``; 0 without one."""
        driven = self._loop.driven
        return 0.0 if driven is None else driven.swept.remaining

    def velocity(self) -> Twist2D:
        """Measured, in the base frame; raises as readings do."""
        return self._base.velocity()

    @property
    def stuck(self) -> bool:
        """Whether the base does not get on, for a while already or until it gave up, and nothing has begun since."""
        return self._loop.stuck

    @property
    def speed_limit(self) -> float | None:
        """m/s, for all actions until it is set to something else; None: as fast as the base may. At 0 it stands."""
        return self._gate.speed_limit

    @speed_limit.setter
    def speed_limit(self, limit: float | None) -> None:
        self._gate.speed_limit = limit

    def blocked_at(self) -> tuple[float, NDArray[np.float64]] | None:
        """Where something that the map lacks is on the path that is driven: metres until then, and the point (2,).

        None where the path is free, as far as can be seen, or nothing is driven.
        """
        driven, pose = self._loop.driven, self._world.base.pose
        if driven is None or not len(self.layer.points):
            return None
        here = np.array([pose.x, pose.y, pose.theta])
        return driven.swept.contact(here, self.layer.points, self._gate.outline)

    def scan(self) -> OdometryScan:
        """What the lidar sees now; raises as its readings do."""
        with self._loop.lock:
            return self._where.scan()

    def start(self) -> None:
        """Begin to localise, from the believed ``world.base``; idempotent."""
        if self._timer is None:
            self._where.begin()
            self.layer.use_costmap(Costmap.from_map(self._world.map, footprint_of(self.description)))
            self._timer = self._clock.every(self._period, self._loop.tick)

    def close(self) -> None:
        """Stop driving and localising; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._loop.stop()
            self._where.end()

    def believe(self, pose: Pose2D, position_std: float, heading_std: float) -> None:
        """Stop, and go on from another pose in the map frame; it is lost until a scan has fitted there."""
        with self._loop.lock:
            self.stop()
            self._where.believe(BasePose(pose, position_std, heading_std, self._clock.now()))
            self.layer.clear()

    def localise_by(self, localizer: Localizer) -> Localizer:
        """Go on with another localizer from the pose that is believed now; returns the one before."""
        with self._loop.lock:
            before, self._where.localizer = self._where.localizer, localizer
            believed = self._world.base
            self.believe(believed.pose, believed.position_std, believed.heading_std)
            return before

    def follow(
        self, path: Path2D, costmap: Costmap | None = None, follower: PathFollower | None = None
    ) -> ControlHandle[BasePose]:
        """Drive along a path in the map frame to its goal pose; ``costmap``: what the map has, without ``layer``.

        With one, the base gives way to people who walk, and followers that go around obstacles may leave the path.
        ``follower``: for this path, in place of the controller's own.
        """
        with self._loop.lock:
            self._follow_by(follower or self._own_follower)
            if costmap is not None:
                self.layer.use_costmap(costmap)
            self._gate.use_footprint(footprint_of(self.description) if costmap is None else costmap.footprint)
            self._follower.reset(path, costmap)
            driven = DrivenPath(path, SweptPath(path), costmap is not None)
            return self._started.begin(self._follower, path.goal, driven=driven)

    def rotate_to(self, heading: float) -> ControlHandle[BasePose]:
        """Turn on the spot to ``heading``, radians in the map frame."""
        pose = self._world.base.pose
        self._rotation.turn_to(heading)
        return self._started.begin(self._rotation, Pose2D(pose.x, pose.y, heading), math.inf)

    def drive(self, distance: float, speed: float | None = None) -> ControlHandle[BasePose]:
        """Drive straight, ``distance`` metres ahead, or back where it is negative; nothing is checked but progress.

        ``speed``: m/s, no faster than that.
        """
        pose = self._world.base.pose
        goal = pose @ Pose2D(distance, 0.0, 0.0)
        points = np.array([pose.xy, goal.xy])
        with self._loop.lock:
            self._follow_by(self._own_follower)
            self._follower.reset(Path2D(points, goal, np.array([distance < 0.0])))
            return self._started.begin(self._follower, goal, speed=speed)

    def turn(self, angle: float) -> ControlHandle[BasePose]:
        """Turn on the spot by ``angle``, within ±pi, as the odometry counts it: also where the base is lost."""
        self._rotation.turn_to(wrap_angle(self._where.odometry.theta + angle))
        return self._started.begin(self._rotation, None, by_odometry=True)

    def park(self) -> ControlHandle[BasePose]:
        """Come to rest, hold the wheels and let the localisation settle."""
        with self._loop.lock:
            self._base.stop()
            return self._started.begin(None, None)

    def stop(self) -> None:
        """Bring the base to rest at once; what was under way is cancelled."""
        with self._loop.lock:
            self._base.stop()
            self._loop.stop()

    def _follow_by(self, follower: PathFollower) -> None:
        if follower is not self._follower:
            follower.configure(motion_limits(self.description))
            self._follower = follower

    @property
    def _started(self) -> ActionLoop:
        if self._timer is None:
            raise RuntimeError("BaseController was asked to drive before start()")
        return self._loop

    def _observe(self, seen: PlacedScan) -> None:
        self.last_scan = seen
        self._gate.observe(seen.scan, self.base_from_lidar, seen.odometry)
        self._follower.observe(seen.scan, seen.map_from_lidar)
        if seen.fits:
            self.layer.update(seen.scan, seen.map_from_lidar)
