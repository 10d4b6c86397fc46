"""What of a wanted velocity reaches the wheels: limits, people who walk, the monitor's last word."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor
from bestman_bt.control.wheeled.velocity_gate import VelocityGate
from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.robot_model.model import BaseModel
from tests.control.scripted_parts import BASE, CORNERS, ScriptedBase
from tests.robot_models import base_model

OMNI = base_model(CORNERS, max_vy=0.6)
POSE, ODOMETRY = Pose2D(2.0, -1.0, 2.2), Pose2D(-4.0, 3.0, -0.7)
AT_REST, DT = Twist2D(), 0.025


def gate_of(model: BaseModel = BASE) -> tuple[VelocityGate, ScriptedBase]:
    base = ScriptedBase(POSE, ODOMETRY, model)
    return VelocityGate(base, CollisionMonitor(model)), base


def command(gate, twist, most=None, velocity=AT_REST, people=(), tall=(), period=DT):
    return gate.command(twist, most, velocity, POSE, ODOMETRY, people, tall, period)


def scan_of(points: np.ndarray) -> LaserScan:
    """Of points (N, 2) in the frame of a lidar in the middle of the base."""
    ranges = np.full(360, np.inf)
    beam = np.round((np.arctan2(points[:, 1], points[:, 0]) + math.pi) / (2 * math.pi) * 360).astype(int) % 360
    np.minimum.at(ranges, beam, np.hypot(points[:, 0], points[:, 1]))
    return LaserScan(ranges, -math.pi, 2 * math.pi / 360, 0.1, 8.0, 0.0)


@pytest.mark.parametrize(
    ("twist", "most", "told"),
    [
        (Twist2D(0.3, 0.0, 0.5), None, Twist2D(0.3, 0.0, 0.5)),
        (Twist2D(1.2, 0.0, 0.5), None, Twist2D(0.6, 0.0, 0.25)),
        (Twist2D(-1.2, 0.0, 0.5), None, Twist2D(-0.6, 0.0, 0.25)),
        (Twist2D(0.3, 0.0, -2.4), None, Twist2D(0.15, 0.0, -1.2)),
        (Twist2D(0.4, 0.0, 0.4), 0.2, Twist2D(0.2, 0.0, 0.2)),
        (Twist2D(0.8, 0.0, 0.4), 5.0, Twist2D(0.6, 0.0, 0.3)),
        (Twist2D(0.3, 0.2, 0.0), None, Twist2D(0.3, 0.0, 0.0)),
    ],
)
def test_a_twist_beyond_a_limit_is_scaled_as_a_whole(twist, most, told):
    gate, base = gate_of()
    command(gate, twist, most)
    assert [base.told[-1].vx, base.told[-1].vy, base.told[-1].wz] == pytest.approx([told.vx, told.vy, told.wz])
    assert not gate.waits


def test_a_base_that_can_goes_sideways_as_fast_as_its_limit():
    gate, base = gate_of(OMNI)
    command(gate, Twist2D(0.2, -1.2, 0.2))
    assert [base.told[-1].vx, base.told[-1].vy, base.told[-1].wz] == pytest.approx([0.1, -0.6, 0.1])


def test_at_a_limit_of_nothing_it_neither_drives_nor_turns_and_reports_that_it_waits():
    gate, base = gate_of()
    for limit, waits in ((0.0, True), (0.01, False), (None, False)):
        command(gate, Twist2D(0.3, 0.0, 0.5), most=limit)
        assert gate.waits == waits
        assert (base.told[-1] == Twist2D()) == waits


def walker(x: float, y: float, vx: float, vy: float) -> MovingObstacle:
    """Given in the frame of the base."""
    (mx, my), (wx, wy) = POSE.apply([x, y]), POSE.apply([vx, vy]) - POSE.xy
    return MovingObstacle(mx, my, wx, wy, 0.2)


def test_for_somebody_who_comes_it_stands_and_goes_on_gently_when_the_way_is_free_again():
    gate, base = gate_of()
    command(gate, Twist2D(0.5, 0.0, 0.1), people=[walker(1.5, 0.0, -0.6, 0.0)])
    assert base.told[-1] == Twist2D()
    assert gate.waits
    shares = []
    for _ in range(60):
        command(gate, Twist2D(0.5, 0.0, 0.1))
        shares.append(base.told[-1].vx / 0.5)
        assert base.told[-1].wz == pytest.approx(0.1 * shares[-1])
        assert gate.waits == (shares[-1] < 0.05)
    assert shares[:3] == pytest.approx([DT, 2 * DT, 3 * DT])
    assert shares[-1] == 1.0


def test_somebody_who_walks_away_is_no_reason_to_slow_down():
    gate, base = gate_of()
    command(gate, Twist2D(0.5), people=[walker(0.9, 0.0, 0.7, 0.0)])
    assert base.told[-1] == Twist2D(0.5)


def test_what_the_monitor_brakes_for_stops_the_base_and_is_not_commanded():
    gate, base = gate_of()
    gate.observe(scan_of(np.array([[0.33, 0.0], [0.33, 0.05], [0.33, -0.05]])), Pose2D(), ODOMETRY)
    monitored = command(gate, Twist2D(0.5), velocity=Twist2D(0.5))
    assert monitored.brake
    assert (base.stops, base.told) == (1, [])
    assert "ahead" in gate.held_by
    command(gate, Twist2D(-0.5))
    assert (base.stops, base.told) == (1, [Twist2D(-0.5)])


def test_why_a_base_does_not_get_on_is_reported_by_its_wheels_where_nothing_else_holds_it():
    gate, _ = gate_of()
    for velocity, words in (
        (Twist2D(0.015, 0.0, 0.015), "do not turn"),
        (Twist2D(0.025), "wheels turn"),
        (Twist2D(0.0, 0.0, -0.025), "wheels turn"),
    ):
        command(gate, Twist2D(0.3), velocity=velocity)
        assert words in gate.held_by
