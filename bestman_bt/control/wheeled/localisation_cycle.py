"""Localisation loop: odometry at each control tick, a scan every few ticks, and detection of a lost pose."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass

from bestman_bt.control.history import History, NotRecordedError, pose_between
from bestman_bt.control.inertial import FusedOdometry
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.control.lidar import LidarSensor, deskewed
from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.localization.base import LocalizationEstimate, Localizer, OdometryScan
from bestman_bt.world_model.world_model import BasePose, WorldModel
from hal.api import Clock, NoDataError

LONGER = 2
"""Number of control ticks to wait for a due scan, so that its age is the lidar's latency plus one tick."""
MOST_LEFT_OUT = 5
"""Number of consecutive scans that may be skipped because their time is unknown."""


@dataclass(frozen=True)
class Localising:
    """Parameters of localisation. ``rate``: control rate, 20 to 50 Hz. ``scan_every``: control ticks per lidar scan.

    ``settle_scans``: scans at rest after which the pose of a resting base is final; from then on it scans only every
    ``rest_scan_every`` ticks, to notice a push. ``still_speed`` (m/s), ``still_turn_rate`` (rad/s): limits of rest. The
    robot is lost if its standard deviation exceeds ``lost_position_std`` metres or ``lost_scans`` scans in a row were
    rejected.
    """

    rate: float = 40.0
    scan_every: int = 4
    settle_scans: int = 5
    rest_scan_every: int = 40
    still_speed: float = 0.01
    still_turn_rate: float = 0.01
    lost_position_std: float = 0.10
    lost_scans: int = 20


@dataclass(frozen=True)
class PlacedScan:
    """A scan with the odometry pose at its stamp and the believed pose of the lidar in the map frame.

    ``fits``: whether the localisation accepted it; hits of a rejected scan cannot be placed on the map.
    """

    scan: LaserScan
    odometry: Pose2D
    map_from_lidar: Pose2D
    fits: bool


class LocalisationCycle:
    """Updates ``world.base`` with each ``step``; ``seen`` is called with each scan.

    ``estimate``: the localizer's latest estimate, available after ``begin``. ``lost``: whether the pose is unknown
    until a scan fits again; also set by the controller that drives by the map.
    """

    estimate: LocalizationEstimate

    def __init__(
        self,
        clock: Clock,
        lidar: LidarSensor,
        localizer: Localizer,
        odometer: FusedOdometry,
        world: WorldModel,
        localising: Localising = Localising(),
        seen: Callable[[PlacedScan], None] = lambda scan: None,
    ) -> None:
        self.clock, self.lidar, self.world, self.seen = clock, lidar, world, seen
        self.period = 1.0 / localising.rate  # seconds of a control tick
        self.odometer = odometer
        self.localizer = localizer  # who puts another one here tells it where to begin, see ``believe``
        self._localising = localising
        self._ticks = self._scans_at_rest = self._refused_scans = self._left_out = 0
        self.lost = self._confirmed = False
        self.odometry = Pose2D()
        self._odometries = History(pose_between)
        self._latest: OdometryScan | None = None

    @property
    def settled(self) -> bool:
        """Whether the base is at rest and has been localised there by enough scans."""
        return self._scans_at_rest >= self._localising.settle_scans

    @property
    def is_localized(self) -> bool:
        """Whether the estimate is certain enough to drive by the map."""
        p = self._localising
        return self.estimate.position_std <= p.lost_position_std and self._refused_scans < p.lost_scans

    @property
    def lost_reason(self) -> str:
        """Return the reason for a lost localisation as text."""
        estimate = self.estimate
        why = estimate.match.reason if estimate.match is not None and estimate.match.reason else "odometry alone"
        if self._confirmed or estimate.position_std > self._localising.lost_position_std:
            return f"the pose of the base is too uncertain (±{estimate.position_std:.2f} m: {why})"
        return (
            f"no scan fits at the given pose of the base ({why}). Has something moved it, such as a run before this "
            "one? Bring it back (ReturnToStart ends a tree at its start), restart its twin, or look where it is "
            "(Relocalise)"
        )

    def begin(self) -> None:
        """Start at the believed ``world.base``."""
        believed = self.world.base
        self.odometer.begin()
        self._odometries.clear()
        self._latest = None
        self._reset(believed)
        self.lost = believed.position_std > self._localising.lost_position_std

    def end(self) -> None:
        """Stop localising."""
        self.odometer.end()

    def believe(self, believed: BasePose) -> None:
        """Continue from another pose; the base is lost until a scan fits there."""
        self.world.base = believed
        self._reset(believed)
        self.lost = True

    def look_again(self, forgive: bool = False) -> None:
        """Wait for new scans at rest; ``forgive``: do not count the scans rejected so far."""
        self._scans_at_rest = 0
        if forgive:
            self._refused_scans = 0

    def scan(self) -> OdometryScan:
        """Return the latest scan and its odometry pose. Raises NotConnectedError or NoDataError."""
        self._odometries.add(self.clock.now(), self.odometer.pose())
        try:
            return self._taken()
        except NotRecordedError as error:
            raise _unplaced(error) from error

    def pose_at(self, stamp: float) -> Pose2D:
        """Return the believed pose of the base in the map frame at ``stamp``. Raises NotRecordedError outside the last
        seconds.
        """
        believed = self.world.base.pose
        if not self._odometries:
            return believed
        try:
            odometry = self._odometries.at(stamp)
        except NotRecordedError:  # a busy machine holds ``step`` up: the present odometry covers the time since
            with contextlib.suppress(*READING_ERRORS):
                self._odometries.add(self.clock.now(), self.odometer.pose())
            odometry = self._odometries.at(stamp)
        return believed @ self.odometry.inverse() @ odometry

    def step(self) -> None:
        """Run one control tick. Raises NotConnectedError or NoDataError."""
        p = self._localising
        odometry = self.odometer.pose()
        moved = self.odometry.inverse() @ odometry
        self.odometry = odometry
        self._odometries.add(self.clock.now(), odometry)
        if math.hypot(moved.x, moved.y) * p.rate > p.still_speed or abs(moved.theta) * p.rate > p.still_turn_rate:
            self._scans_at_rest = 0
        self.estimate = self.localizer.predict(self.estimate, odometry)
        self._ticks += 1
        every = p.rest_scan_every if self.settled and not self.lost else p.scan_every
        taken = self._due(every)
        if taken is not None:
            # From where the base is now to where its lidar was when the scan was taken.
            base_from_lidar = odometry.inverse() @ taken.odometry @ self.lidar.base_from_lidar
            self.estimate = estimate = self.localizer.correct(self.estimate, taken.scan, base_from_lidar)
            self._scans_at_rest += 1
            fits = estimate.match is not None and estimate.match.accepted
            if fits:
                self._refused_scans, self.lost, self._confirmed = 0, False, True
            else:
                self._refused_scans += 1
            self.seen(PlacedScan(taken.scan, taken.odometry, estimate.pose @ base_from_lidar, fits))
        believed = self.estimate
        self.world.base = BasePose(believed.pose, believed.position_std, believed.heading_std, self.clock.now())

    def _due(self, every: int) -> OdometryScan | None:
        """Return the scan that is due this tick, if one is.

        If the lidar's pose at that time is unknown, as after its clock was set, the scan is skipped. Raises NoDataError
        after too many in a row.
        """
        if self._ticks < every:
            return None
        before = self._latest
        try:
            taken = self._taken()
        except NotRecordedError as error:
            self._ticks, self._left_out = 0, self._left_out + 1
            if self._left_out > MOST_LEFT_OUT:
                raise _unplaced(error) from error
            return None
        if taken is before and self._ticks < every + LONGER:
            return None
        self._ticks = self._left_out = 0
        return taken

    def _taken(self) -> OdometryScan:
        """Return the latest scan as it would be if the lidar had stood still, and the odometry of then;
        NotRecordedError.
        """
        scan, latest = self.lidar.scan(), self._latest
        if latest is not None and latest.scan.stamp == scan.stamp:
            return latest
        odometry = self._odometries.at(scan.stamp)
        if scan.time_increment:
            end = self._odometries.at(scan.stamp + scan.time_increment * len(scan.ranges))
            base_from_lidar = self.lidar.base_from_lidar
            scan = deskewed(scan, base_from_lidar.inverse() @ odometry.inverse() @ end @ base_from_lidar)
        self._latest = OdometryScan(odometry, scan)
        return self._latest

    def _reset(self, believed: BasePose) -> None:
        self.odometry = self.odometer.pose()
        self._odometries.add(self.clock.now(), self.odometry)
        self.estimate = self.localizer.start(believed.pose, self.odometry, believed.position_std, believed.heading_std)
        self._confirmed = False
        self._scans_at_rest = self._refused_scans = 0


def _unplaced(error: NotRecordedError) -> NoDataError:
    return NoDataError(f"the pose of the lidar is unknown for its scan: {error}")
