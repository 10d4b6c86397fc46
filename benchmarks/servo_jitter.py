"""How late the set-points of a robot's controllers are sent, while its arm swings between two postures.

Usage: python -m benchmarks.servo_jitter --robot ROBOT.yaml --seconds 60. The robot's own controllers stand behind
twins; for the figure of an idle machine, run it on one, or with real-time priority (chrt -f 10 …).
"""

from __future__ import annotations

import argparse
import os

from bestman_bt.robot_model import load_robot_model
from hal.api import Arm
from hal.hardware import HardwareRobot
from hal.twins import TwinProcess


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", required=True)
    parser.add_argument("--scene", default="pick_place_table")
    parser.add_argument("--seconds", type=float, default=60.0)
    arguments = parser.parse_args()
    with TwinProcess(arguments.robot, arguments.scene) as twin:
        model = load_robot_model(arguments.robot, twin.settings)
        with HardwareRobot(model) as robot:
            for connection in robot.connections.values():
                for loop in connection.loops:
                    loop.forget_lateness()
            errors = swing(robot, arguments.seconds)
            print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; motions that failed: {errors}")
            for connection in robot.connections.values():
                for loop in connection.loops:
                    print(f"{loop.name} at {loop.rate:g} Hz: {loop.lateness()}")
            print(f"the twins' world gave up {twin.judge('time')['given_up']:.3f} s")


def swing(robot: HardwareRobot, seconds: float) -> int:
    """Move to and fro for a while; how many motions failed."""
    arm = next(part for part in robot.parts.values() if isinstance(part, Arm))
    postures = [robot.model.posture(name, arm.joint_names) for name in ("home", "carry")]
    end, failed, count = robot.clock.now() + seconds, 0, 0
    while robot.clock.now() < end:
        motion = arm.move_to(postures[count % 2], 0.3)
        while not motion.done:
            robot.clock.sleep(0.05)
        failed += motion.error is not None
        count += 1
    return failed


if __name__ == "__main__":
    main()
