"""Drives of hostile planners and followers: how hard the robot's base and arm press on what stands.

Each drive begins somewhere in one of ten rooms, with a path that passes through walls and furniture
or a follower that does not follow: straight on, oscillating, late, backwards, NaN, recoveries (back up, turn on the
spot), and set-points far beyond the limits. Nothing but the base's own protection stands between them and the wheels.
Judged by the simulator's contacts: those of a link of the robot with a wall, furniture or the floor.

    python -m benchmarks.hostile_drives --drives 200 --json
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import platform
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from bestman_bt.messages import Path2D, Pose, Pose2D, Twist2D
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.runtime.robot_session import session

ROOMS: tuple[tuple[str, int], ...] = (
    *(("kitchen", 7), ("kitchen_furnished", 1), ("kitchen_with_chairs", 2), ("dining_room", 3), ("fridge_room", 4)),
    *(("apartment", 5), ("apartment_doors", 6), ("chest_room", 7), ("kitchen_half_open_door", 8), ("apartment", 9)),
)
"""Scenes and the seeds of their worlds."""
MOST_FORCE = 20.0
"""Newtons on anything that stands."""
SECONDS = 5.0
"""Simulated, of one drive."""
STRETCHED = (0.0, 0.9, 0.0, -1.2, 0.0, 2.1, 0.785)
"""Joint positions of a Panda that reaches out ahead, radians."""
STANDING = ("wall", "furniture", "floor", "object")


@dataclass
class HostileFollower(PathFollower):
    """Does what ``command`` says, seconds after it began, and never ends."""

    command: Callable[[float], Twist2D]
    time: float = 0.0

    def reset(self, path: Path2D, costmap: Any = None) -> None:
        """The path means nothing."""
        self.time = 0.0

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        """The next command, whatever is around."""
        self.time += dt
        return FollowerCommand(self.command(self.time), done=False, remaining=2.0)


def _late(speed: float, late: float) -> Callable[[float], Twist2D]:
    """Turns away from where it goes, but ``late`` seconds too late."""
    return lambda t: Twist2D(speed, 0.0, 0.0) if t % (2.0 * late) < late else Twist2D(-speed, 0.0, 0.8)


def followers(rng: np.random.Generator) -> dict[str, PathFollower]:
    """One of each kind, drawn anew."""
    speed, turn, period = rng.uniform(0.2, 2.0), rng.uniform(-3.0, 3.0), rng.uniform(0.3, 3.0)
    laws: dict[str, Callable[[float], Twist2D]] = {
        "straight": lambda t: Twist2D(speed, 0.0, 0.0),
        "backwards": lambda t: Twist2D(-speed, 0.0, 0.0),
        "arc": lambda t: Twist2D(speed, 0.0, turn),
        "spin": lambda t: Twist2D(0.0, 0.0, turn),
        "oscillating": lambda t: Twist2D(speed * math.sin(6.28 * t / period), 0.0, turn * math.cos(6.28 * t / period)),
        "bang-bang": lambda t: Twist2D(math.copysign(speed, math.sin(6.28 * t / period)), 0.0, turn),
        "late": _late(speed, period),
        "noise": lambda t: Twist2D(*rng.normal(0.0, 2.0, 3).tolist()),
        "huge": lambda t: Twist2D(1e6, 1e6, 1e6),
        "NaN": lambda t: Twist2D(math.nan if t > 1.0 else speed, 0.0, math.nan if t > 1.5 else turn),
    }
    return {name: HostileFollower(law) for name, law in laws.items()}


def paths(rng: np.random.Generator, start: Pose2D) -> dict[str, Path2D]:
    """Straight through everything, the same backwards, a zigzag, one that is NaN halfway."""
    goal = Pose2D(*(np.array(start.xy) + rng.uniform(-6.0, 6.0, 2)).tolist(), float(rng.uniform(-3.0, 3.0)))
    straight = np.linspace(start.xy, goal.xy, 40)
    zigzag = straight + np.array([(0.3 * (-1) ** index, 0.3 * (index % 3 - 1)) for index in range(40)])
    return {
        "straight path": Path2D(straight, goal),
        "reversed path": Path2D(straight, goal, np.ones(39, dtype=bool)),
        "zigzag path": Path2D(zigzag, goal),
        "path out of the room": Path2D(np.linspace(start.xy, (40.0, 40.0), 300), Pose2D(40.0, 40.0, 0.0)),
    }


def drives(rng: np.random.Generator) -> Iterator[tuple[str, Callable[[Any], Any]]]:
    """Endless: each kind in turn, as words and what begins it with a base controller."""
    for turn in itertools.count():
        for name, follower in followers(rng).items():
            yield name, lambda base, f=follower: base.follow(straight_on(base), base.costmap, f)
        for kind in range(4):
            yield (
                f"path {kind}",
                lambda base, k=kind, known=turn % 2: base.follow(
                    list(paths(rng, base.pose).values())[k], base.costmap if known else None
                ),
            )
        distance, angle = float(rng.uniform(0.2, 3.0)), float(rng.uniform(-3.1, 3.1))
        yield "back up", lambda base, d=distance: base.drive(-d)
        yield "drive on", lambda base, d=distance: base.drive(d)
        yield "turn by odometry", lambda base, a=angle: base.turn(a)


def straight_on(base: Any) -> Path2D:
    """Two metres ahead."""
    goal = base.pose @ Pose2D(2.0, 0.0, 0.0)
    return Path2D(np.array([base.pose.xy, goal.xy]), goal)


@dataclass
class _Base:
    """What a drive is given: the controller, the believed pose and the costmap."""

    controller: Any
    world: Any
    costmap: Any
    from_body: Pose
    """Of the simulated body, at the start, when it stands where it is believed to."""

    @property
    def pose(self) -> Pose2D:
        return self.world.base.pose

    def __getattr__(self, name: str) -> Any:
        return getattr(self.controller, name)


@dataclass
class Result:
    """Newtons on what stands: by drive, the hardest contact; ``pairs``: of those beyond the limit."""

    drives: list[dict[str, Any]] = field(default_factory=list)

    @property
    def worst(self) -> float:
        """Newtons."""
        return max((drive["force_n"] for drive in self.drives), default=0.0)

    def document(self) -> dict[str, Any]:
        """For ``--json``."""
        over = [drive for drive in self.drives if drive["force_n"] > MOST_FORCE]
        return {
            "drives": len(self.drives),
            "over": len(over),
            "worst_n": round(self.worst, 1),
            "driven_m": round(sum(drive["driven_m"] for drive in self.drives), 1),
            "hits": over,
            "most_n": MOST_FORCE,
            "machine": {"processor": platform.machine(), "python": platform.python_version()},
            "versions": {name: version(name) for name in ("bestman-bt", "pybullet", "numpy")},
            "rooms": [list(room) for room in ROOMS],
        }


def room_drives(
    scene: str, seed: int, count: int, robot: str = "diff_panda", stretched: bool = False
) -> list[dict[str, Any]]:
    """So many hostile drives in one room; each as what it was, how hard it hit, and how far it got."""
    rng, told = np.random.default_rng([seed, len(scene)]), []
    with session(robot=robot, scene=scene, seed=seed) as opened:
        skills, simulated = opened.skills, opened.robot
        if stretched:
            motion = skills.arm.move_to(np.array(STRETCHED))
            while not motion.done:
                simulated.clock.sleep(0.05)
        body = simulated.client.getBasePositionAndOrientation(simulated.simulation.built.robot)
        from_body = skills.world.base.pose.to_pose().inverse() @ Pose(*map(np.array, body))
        base = _Base(skills.base, skills.world, skills.known_costmap(), from_body)
        for name, begin in itertools.islice(drives(rng), count):
            _put_somewhere(simulated, base, rng)
            began, start = simulated.clock.now(), base.pose
            motion = begin(base)
            while not motion.done and simulated.clock.now() - began < SECONDS:
                simulated.clock.sleep(0.05)
            skills.base.stop()
            simulated.clock.sleep(0.5)
            since = simulated.audit_record().duration - (simulated.clock.now() - began)
            hits = [
                contact
                for contact in simulated.audit_record().contacts
                if contact.end >= since and contact.kinds[0] in ("robot", "fingers") and contact.kinds[1] in STANDING
            ]
            hardest = max(hits, key=lambda contact: contact.peak_force, default=None)
            told.append(
                {
                    "scene": scene,
                    "seed": seed,
                    "drive": name,
                    "force_n": round(hardest.peak_force, 1) if hardest else 0.0,
                    "pair": [hardest.first, hardest.second] if hardest else [],
                    "driven_m": round(start.distance_to(base.pose), 2),
                    "end": str(motion.failure.text if motion.failure else motion.status.value)[:80],
                }
            )
    return told


def _put_somewhere(simulated: Any, base: _Base, rng: np.random.Generator) -> None:
    """Put the robot where it stands free, which no drive could do; it is told, and looks around for half a second."""
    costmap, client = base.costmap, simulated.client
    cells = np.argwhere(costmap.distance > costmap.footprint.circumscribed_radius + 0.05)
    body = simulated.simulation.built.robot
    for x, y in costmap.grid_points(cells[rng.integers(len(cells), size=50)]):
        there = Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
        moved = there.to_pose() @ base.from_body
        client.resetBasePositionAndOrientation(body, moved.position.tolist(), moved.quaternion.tolist())
        base.believe(there, 0.01, 0.01)
        beside = [gap for other in _standing(simulated) for gap in client.getClosestPoints(body, other, 0.03)]
        if beside:  # of what the map lacks
            continue
        simulated.clock.sleep(0.5)
        return
    raise RuntimeError("there is nowhere to begin")


def _standing(simulated: Any) -> list[int]:
    built = simulated.simulation.built
    return [*built.walls.values(), *built.furniture.values(), *built.objects.values()]


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=200)
    parser.add_argument("--rooms", type=int, default=len(ROOMS))
    parser.add_argument("--robot", default="diff_panda")
    parser.add_argument("--stretched", action="store_true", help="with the arm ahead of the base, half a metre")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    result = Result()
    for scene, seed in ROOMS[: asked.rooms]:
        for drive in room_drives(scene, seed, -(-asked.drives // asked.rooms), asked.robot, asked.stretched):
            result.drives.append(drive)
            if not asked.json:
                print(drive, flush=True)
    if asked.json:
        print(json.dumps(result.document(), indent=1))
    else:
        print(f"worst {result.worst:.1f} N, {sum(d['force_n'] > MOST_FORCE for d in result.drives)} beyond")
    sys.exit(result.worst > MOST_FORCE)


if __name__ == "__main__":
    main()
