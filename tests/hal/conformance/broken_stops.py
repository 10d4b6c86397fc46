"""Stops that break a promise."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from hal.api import MotionErrorCode, MotionStatus
from tests.hal.conformance.changed_robot import Break, wrapped


def stops_with_the_wrong_reason(robot: Any) -> None:
    arm = robot.parts["arm"]

    def stop(do: Any) -> None:
        arm._connection.end_motion(MotionStatus.CANCELED, MotionErrorCode.FAULT, "something happened")
        do()

    wrapped(arm, "stop", stop)


def a_gripper_that_never_stops_listening(robot: Any) -> None:
    line = robot.parts["gripper"]._connection
    wrapped(line, "check_command", lambda do, command: line.check_connected())


def a_stop_that_wears_off(robot: Any) -> None:
    def stop(do: Any) -> None:
        do()
        if robot.connected:
            robot.clock.every(0.8, robot.clear_stop)

    wrapped(robot, "stop", stop)


def a_stop_that_counts(robot: Any) -> None:
    stops: list[None] = []

    def stop(do: Any) -> None:
        stops.append(None)
        do()

    def clear_stop(do: Any) -> None:
        stops.pop()
        if not stops:
            do()

    wrapped(robot, "stop", stop)
    wrapped(robot, "clear_stop", clear_stop)


def a_stop_that_is_only_a_pause(robot: Any) -> None:
    interrupted: list[bool] = []

    def stop(do: Any) -> None:
        interrupted.append(robot.parts["arm"]._connection.motion is not None)
        do()

    def clear_stop(do: Any) -> None:
        do()
        if interrupted.pop():
            robot.parts["arm"].command(velocities=np.full(7, 0.05))

    wrapped(robot, "stop", stop)
    wrapped(robot, "clear_stop", clear_stop)


def takes_up_again(method: str) -> Break:
    """The arm's last command of this kind that a stop has ended acts again when the stop is cleared."""

    def act(robot: Any) -> None:
        arm = robot.parts["arm"]
        last: list[Any] = []
        interrupted: list[Any] = []

        def command(do: Any, *arguments: Any, **keywords: Any) -> Any:
            last[:] = [lambda: do(*arguments, **keywords)]
            return do(*arguments, **keywords)

        def forget(do: Any, *arguments: Any) -> Any:
            last.clear()
            return do(*arguments)

        def stop(do: Any) -> None:
            interrupted[:] = last if not arm.resting else []
            last.clear()
            do()

        def clear_stop(do: Any) -> None:
            do()
            for again in interrupted:
                again()

        wrapped(arm, method, command)
        wrapped(arm, "move_to", forget)
        wrapped(robot, "stop", stop)
        wrapped(robot, "clear_stop", clear_stop)

    return act


def a_stop_of_the_main_thread_only(do: Any) -> None:
    if threading.current_thread() is threading.main_thread():
        do()


def a_part_that_stops_everything(robot: Any) -> None:
    def stop(do: Any) -> None:
        do()
        robot._latch.set()

    wrapped(robot.parts["base"], "stop", stop)


BROKEN: list[tuple[str, Break]] = [
    ("stop brings everything to rest", stops_with_the_wrong_reason),
    ("a stopped robot refuses commands", a_gripper_that_never_stops_listening),
    ("a stop stays until it is cleared", a_stop_that_wears_off),
    ("stopping twice is stopping once", a_stop_that_counts),
    ("nothing moves when the stop is cleared", a_stop_that_is_only_a_pause),
    ("nothing moves when the stop is cleared", takes_up_again("command")),
    ("nothing moves when the stop is cleared", takes_up_again("servo")),
    ("stop works from another thread", lambda robot: wrapped(robot, "stop", a_stop_of_the_main_thread_only)),
    ("a part can be stopped by itself", a_part_that_stops_everything),
]
