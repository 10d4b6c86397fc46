"""How late the set-points of a robot's controllers are sent, while its arm swings between two postures.

Usage: ``python benchmarks/servo_jitter.py --robot ROBOT.yaml --seconds 60 --json``. The robot's own controllers stand
behind twins on the same machine; the client has the priority that ``IsolatedRobot`` gives it.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict
from typing import Any

from bestman_bt.evaluation.versions import versions
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import Arm
from hal.hardware.control_loop import ControlLoop, take_real_time_priority
from hal.hardware.robot import HardwareRobot
from hal.hardware.robot_process import SERVING_PRIORITY
from hal.twins.process import TwinProcess


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", required=True)
    parser.add_argument("--scene", default="pick_place_table")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    arguments = parser.parse_args()
    with TwinProcess(arguments.robot, arguments.scene) as twin:
        take_real_time_priority(SERVING_PRIORITY)
        with HardwareRobot(load_robot_model(arguments.robot, twin.settings)) as robot:
            loops = [loop for connection in robot.connections.values() for loop in connection.loops]
            for loop in loops:
                loop.forget_lateness()
            failed = swing(robot, arguments.seconds)
            report = {
                "robot": arguments.robot,
                "seconds": arguments.seconds,
                "motions_failed": failed,
                "loops": [lateness(loop) for loop in loops],
                "world_gave_up_s": twin.judge("time")["given_up"],
                "load": os.getloadavg()[0],
                "cores": os.cpu_count(),
                "versions": versions(),
            }
    if arguments.json:
        print(json.dumps(report, indent=2))
        return
    print(f"load {report['load']:.1f} on {report['cores']} cores; motions that failed: {failed}")
    for loop in loops:
        print(f"{loop.name} at {loop.rate:g} Hz: {loop.lateness()}")


def lateness(loop: ControlLoop) -> dict[str, Any]:
    """Of one loop, milliseconds."""
    told = asdict(loop.lateness())
    late = {f"{name}_ms": round(1e3 * told[name], 3) for name in ("median", "p99", "worst")}
    return {"loop": loop.name, "hertz": loop.rate, "cycles": told["cycles"], "missed": told["missed"], **late}


def swing(robot: HardwareRobot, seconds: float) -> int:
    """Move to and fro for a while; how many motions failed."""
    arm = next(part for part in robot.parts.values() if isinstance(part, Arm))
    postures = [robot.model.posture(name, arm.joint_names) for name in ("home", "carry")]
    end, failed, count = robot.clock.now() + seconds, 0, 0
    while robot.clock.now() < end:
        motion = arm.move_to(postures[count % 2], 0.3)
        while not motion.done:
            robot.clock.sleep(0.05)
        failed += motion.failure is not None
        count += 1
    return failed


if __name__ == "__main__":
    main()
