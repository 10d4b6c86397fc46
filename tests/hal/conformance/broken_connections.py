"""Descriptions and connections that break a promise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tests.hal.conformance.changed_robot import Break, changed, telling, wrapped
from tests.robot_models import with_limits, with_part


def a_part_that_is_not_mentioned(robot: Any) -> None:
    del robot.parts["lidar"]


def any_part_will_do(robot: Any) -> None:
    changed(robot, part=lambda self, name, kind: self.parts.get(name, self.parts["arm"]))


def feels_before_it_is_connected(robot: Any) -> None:
    connections: list[None] = []
    wrapped(robot, "connect", lambda do: (connections.append(None), do())[1])
    wrapped(robot.parts["wrist_force_torque"], "wrench", lambda do: do() if connections else None)


def sees_after_it_was_disconnected(robot: Any) -> None:
    lidar, latest = robot.parts["lidar"], []

    def connect(do: Any) -> None:
        do()
        latest.append(lidar.scan())

    wrapped(robot, "connect", connect)
    wrapped(lidar, "scan", lambda do: do() if robot.connected or not latest else latest[0])


def connects_only_once(do_not: Any) -> None:
    def connect(do: Any) -> None:
        if do_not.connected:
            raise RuntimeError("already connected")
        do()

    wrapped(do_not, "connect", connect)


def begins_time_anew(robot: Any) -> None:
    def connect(do: Any) -> None:
        do()
        robot.clock._steps = 0
        robot.clock._target = 0.0

    wrapped(robot, "connect", connect)


def lame_the_second_time(robot: Any) -> None:
    connections: list[bool] = []
    wrapped(robot, "connect", lambda do: (connections.append(robot.connected), do())[1])
    wrapped(robot.parts["arm"], "cycle", lambda do, elapsed: do(elapsed) if connections.count(False) < 2 else None)


def leaves_motions_running(robot: Any) -> None:
    line = robot.parts["arm"]._connection
    wrapped(line, "close", lambda do: setattr(line, "connected", False))


def forgets_a_stop(robot: Any) -> None:
    wrapped(robot, "connect", lambda do: (do(), robot.clear_stop())[0])


def restless(robot: Any) -> None:
    """From its second connection on, the arm drifts until somebody commands it."""
    connected: list[None] = []

    def connect(do: Any) -> None:
        again = not robot.connected
        do()
        if again and connected and not robot.stopped:
            robot.parts["arm"].move_to(robot.parts["arm"].positions() + 0.2, 0.05)
        connected.append(None)

    wrapped(robot, "connect", connect)


BROKEN: list[tuple[str, Break]] = [
    ("a robot that connects again stands still", restless),
    (
        "the description can be read before connecting",
        telling("head_camera", "intrinsics", lambda k: replace(k, fx=0.0)),
    ),
    ("every part of the model is there or unsupported", a_part_that_is_not_mentioned),
    (
        "joints have the limits of the model",
        telling("head", "model", lambda model: with_limits(model, velocity=1.5 * model.velocity)),
    ),
    (
        "a base is as the model says",
        telling("base", "model", lambda d: replace(d, footprint=tuple((100 * x, y) for x, y in d.footprint))),
    ),
    (
        "a gripper is as the model says",
        telling("gripper", "model", lambda model: with_part(model, max_force=2 * model.part.max_force)),
    ),
    ("frames are those of the model", telling("lidar", "frame", lambda frame: "laser")),
    ("an unknown part is refused with the names there are", any_part_will_do),
    ("nothing works without a connection", feels_before_it_is_connected),
    ("connecting and disconnecting are idempotent", connects_only_once),
    ("connecting and disconnecting are idempotent", begins_time_anew),
    ("nothing works after disconnecting", sees_after_it_was_disconnected),
    ("a robot that connects again takes commands", lame_the_second_time),
    ("disconnecting ends motions", leaves_motions_running),
    ("a stop is kept across connections", forgets_a_stop),
]
