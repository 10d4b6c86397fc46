"""Maps apartments by exploration in physics, and judges the map and the way with and without loop closures.

``python benchmarks/slam.py [--apartments N] [--seed S] [--json] [--pictures DIR]``; docs/slam.md tells the keys.
The control and the larger slip are the same readings given to SLAM again. All poses that count as truth come from the
simulator, and only this program sees them.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from behaviours.explore import ExploreAndMap
from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import Box, Cylinder, LaserScan, PlacedShape, Pose, Pose2D
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED
from bestman_bt.navigation.slam import PoseGraphSlam, PoseGraphSlamParameters, SlamEstimate
from bestman_bt.runtime import Executor, session
from bestman_bt.scene import World, semantic_map
from hal.api import Lidar
from hal.pybullet import GroundTruth

SPACING = 0.01
"""Metres between the points that true outlines are made of."""


@dataclass(frozen=True)
class Reading:
    odometry: Pose2D
    scan: LaserScan
    base_from_lidar: Pose2D
    true_pose: Pose2D


class RecordedSlam(PoseGraphSlam):
    """Notes what it is given, with the true pose at that moment."""

    def __init__(self, truth: GroundTruth) -> None:
        super().__init__()
        self._truth = truth
        self.readings: list[Reading] = []

    def add(self, odometry: Pose2D, scan: LaserScan, base_from_lidar: Pose2D) -> SlamEstimate:
        self.readings.append(Reading(odometry, scan, base_from_lidar, self._truth.base_pose().to_pose2d()))
        return super().add(odometry, scan, base_from_lidar)


@dataclass
class Exploration:
    seed: int
    succeeded: bool
    why: str
    sim_s: float
    floor: float
    contacts: list[str]
    readings: list[Reading]
    told: Pose2D
    slam: RecordedSlam
    truth: TrueSurfaces


@dataclass(frozen=True)
class Judged:
    """``ate``: root mean square metres between keyframes and truth, after the rigid alignment that makes it least
    (Sturm et al. 2012); ``from_start``: the same with the first pose alone aligned. ``cells``: share of the occupied
    cells whose centre is within 5 cm of a true surface; ``found``: share of the surfaces that the beams hit with an
    occupied cell within 5 cm. ``loops``: closures.
    """

    ate: float
    from_start: float
    cells: float
    found: float
    loops: int


class TrueSurfaces:
    """The outlines of all that stands in the lidar's plane, as points."""

    def __init__(self, world: World, height: float) -> None:
        segments = [semantic_map(world).walls]
        for piece in world.furniture:
            shapes = list(piece.model.parts)
            for leaf in piece.model.articulations:
                moved = leaf.moved(piece.open.get(leaf.name, 0.0))
                shapes += [PlacedShape(part.shape, moved @ part.pose) for part in leaf.parts]
            for placed in shapes:
                segments.append(_slice(placed.shape, piece.pose @ placed.pose, height))
        self.segments = np.concatenate(segments)
        lengths = np.linalg.norm(self.segments[:, 2:] - self.segments[:, :2], axis=1)
        self.points = np.concatenate(
            [
                s[:2] + (s[2:] - s[:2]) * np.linspace(0.0, 1.0, max(2, math.ceil(length / SPACING)))[:, None]
                for s, length in zip(self.segments, lengths, strict=True)
            ]
        )


def _slice(shape: Any, pose: Pose, height: float) -> NDArray[np.float64]:
    """Outline (N, 4) of an upright shape at a height, none where it does not reach there."""
    z = float(pose.position[2])
    if isinstance(shape, Box) and abs(height - z) < shape.size[2] / 2:
        x, y = shape.size[0] / 2, shape.size[1] / 2
        corners = pose.to_pose2d().apply(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))
    elif isinstance(shape, Cylinder) and abs(height - z) < shape.length / 2:
        turn = np.arange(24) * (2.0 * math.pi / 24)
        corners = pose.position[:2] + shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
    else:
        return np.zeros((0, 4))
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


def explore(seed: int, scene: str) -> Exploration:
    with session(scene=scene, seed=seed, task="navigate_apartment") as opened:
        slam = RecordedSlam(GroundTruth(opened.robot))
        skills = opened.skills
        skills.algorithms = replace(skills.algorithms, slam=slam)
        told, begin = skills.world.base.pose, skills.clock.now()
        tree = opened.load(ExploreAndMap(max_time=900.0))
        execution = Executor(tree, opened.robot.clock, period=0.05, time_limit=1000.0).run()
        grid = slam.grid
        lidar = opened.robot.part("lidar", Lidar)
        height = float(ForwardKinematics(opened.setup.robot_model).pose(lidar.frame, {}).position[2])
        return Exploration(
            seed=seed,
            succeeded=execution.succeeded,
            why="; ".join(f"{failure.error_code}: {failure.why}" for failure in skills.failures),
            sim_s=skills.clock.now() - begin,
            floor=float((grid.data == FREE).sum()) * grid.resolution**2,
            contacts=[str(contact) for contact in opened.robot.honesty_record().contacts],
            readings=slam.readings,
            told=told,
            slam=slam,
            truth=TrueSurfaces(opened.setup.world, height),
        )


def again(run: Exploration, loop_closure: bool, slip: float) -> PoseGraphSlam:
    """The same readings once more; ``slip``: shares by which the wheels' way and turns are falsified, and rad/m."""
    rng = np.random.default_rng(run.seed)
    way, turn, bend = rng.normal(0.0, slip, 3)
    slam = PoseGraphSlam(PoseGraphSlamParameters(loop_closure=loop_closure))
    odometry = run.readings[0].odometry
    before = odometry
    slam.reset(run.told, odometry)
    for reading in run.readings:
        moved = before.inverse() @ reading.odometry
        before = reading.odometry
        odometry = odometry @ Pose2D(
            moved.x * (1.0 + way), moved.y * (1.0 + way), moved.theta * (1.0 + turn) + bend * moved.x
        )
        slam.add(odometry, reading.scan, reading.base_from_lidar)
    return slam


def judge(run: Exploration, slam: PoseGraphSlam) -> Judged:
    trajectory, grid = slam.trajectory, slam.grid
    by_stamp = {reading.scan.stamp: reading.true_pose for reading in run.readings}
    true = np.array([by_stamp[stamp].xy for stamp in trajectory.stamps.tolist()])
    first = by_stamp[float(trajectory.stamps[0])] @ Pose2D(*trajectory.poses[0]).inverse()
    from_start = np.linalg.norm(first.apply(trajectory.poses[:, :2]) - true, axis=1)
    aligned = rigid_alignment(trajectory.poses[:, :2], true)
    errors = np.linalg.norm(aligned.apply(trajectory.poses[:, :2]) - true, axis=1)
    cells = aligned.apply(grid.to_points(np.argwhere(grid.data == OCCUPIED)))
    off, _ = cKDTree(run.truth.points).query(cells)
    seen = np.concatenate([r.true_pose.apply(r.base_from_lidar.apply(r.scan.points())) for r in run.readings[::5]])
    away, nearest = cKDTree(run.truth.points).query(seen)
    hit, count = np.unique(nearest[away < 0.03], return_counts=True)
    missed, _ = cKDTree(cells).query(run.truth.points[hit[count >= 2]])
    return Judged(
        ate=float(np.sqrt(np.mean(errors**2))),
        from_start=float(np.sqrt(np.mean(from_start**2))),
        cells=float((off < 0.05).mean()),
        found=float((missed < 0.05).mean()),
        loops=len(trajectory.loops),
    )


def rigid_alignment(points: NDArray[np.float64], onto: NDArray[np.float64]) -> Pose2D:
    """The pose that brings ``points`` (N, 2) nearest to ``onto`` in the mean of squares (Umeyama 1991, no scale)."""
    a, b = points - points.mean(axis=0), onto - onto.mean(axis=0)
    angle = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    shift = onto.mean(axis=0) - Pose2D(0.0, 0.0, angle).apply(points.mean(axis=0))
    return Pose2D(float(shift[0]), float(shift[1]), angle)


def picture(run: Exploration, slam: PoseGraphSlam, path: Path, title: str) -> None:
    """The map, the keyframes (blue), the true way (green, dashed) and the loop closures (red)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    grid, trajectory = slam.grid, slam.trajectory
    by_stamp = {reading.scan.stamp: reading.true_pose for reading in run.readings}
    true = np.array([by_stamp[stamp].xy for stamp in trajectory.stamps.tolist()])
    aligned = rigid_alignment(true, trajectory.poses[:, :2])
    shade = np.select([grid.data == OCCUPIED, grid.data == FREE], [0.0, 1.0], 0.8)
    rows, columns = grid.data.shape
    x, y = grid.origin
    extent = (x, x + columns * grid.resolution, y, y + rows * grid.resolution)
    figure, axes = plt.subplots(figsize=(8, 8 * rows / columns), dpi=110)
    axes.imshow(shade, cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent, interpolation="nearest")
    segments = run.truth.segments
    ends = aligned.apply(segments.reshape(-1, 2)).reshape(-1, 2, 2)
    axes.plot(ends[:, :, 0].T, ends[:, :, 1].T, color="orange", lw=0.6, zorder=2)
    for first, second in trajectory.loops.tolist():
        pair = trajectory.poses[[first, second], :2]
        axes.plot(pair[:, 0], pair[:, 1], color="red", lw=0.5, alpha=0.6, zorder=3)
    axes.plot(*trajectory.poses[:, :2].T, "o-", color="royalblue", ms=2.2, lw=0.9, zorder=4)
    axes.plot(*aligned.apply(true).T, "--", color="limegreen", lw=0.9, zorder=5)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def measure(seed: int, scene: str, slip: float, pictures: Path | None) -> dict[str, Any]:
    run = explore(seed, scene)
    made = judge(run, run.slam)
    without = again(run, loop_closure=False, slip=0.0)
    slipping, slipping_without = again(run, True, slip), again(run, False, slip)
    judged = {"without": judge(run, without)}
    judged |= {"slip": judge(run, slipping), "slip_without": judge(run, slipping_without)}
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        for name, slam, what in (("map", run.slam, made), ("no_closure", slipping_without, judged["slip_without"])):
            title = f"seed {seed}, {name}: ATE {1e3 * what.ate:.0f} mm, {what.loops} loop closures"
            picture(run, slam, pictures / f"slam_{seed}_{name}.png", title)
    return {
        "seed": seed,
        "succeeded": run.succeeded,
        "why": run.why,
        "exploration_sim_s": run.sim_s,
        "floor_m2": run.floor,
        "contacts": run.contacts,
        "slam_ate_rmse_m": made.ate,
        "slam_error_from_start_rmse_m": made.from_start,
        "slam_wall_cells_within_5cm": made.cells,
        "slam_surfaces_found": made.found,
        "loop_closures": made.loops,
        "without_loop_closure": asdict(judged["without"]),
        "with_slip": asdict(judged["slip"]),
        "with_slip_without_loop_closure": asdict(judged["slip_without"]),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--apartments", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scene", default="apartment")
    parser.add_argument("--slip", type=float, default=0.15, help="of the falsified odometry, a standard deviation")
    parser.add_argument("--json", action="store_true", help="one JSON document instead of lines")
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    each = []
    for seed in range(arguments.seed, arguments.seed + arguments.apartments):
        each.append(measure(seed, arguments.scene, arguments.slip, arguments.pictures))
        print(json.dumps(each[-1]), file=sys.stderr, flush=True)
    means = ("slam_ate_rmse_m", "slam_wall_cells_within_5cm", "slam_surfaces_found", "exploration_sim_s")
    summary: dict[str, Any] = {"seed": arguments.seed, "apartments": len(each)}
    summary |= {"explored_rate": float(np.mean([one["succeeded"] for one in each]))}
    summary |= {"contacts": sum(len(one["contacts"]) for one in each)}
    summary |= {key: float(np.mean([one[key] for one in each])) for key in means}
    for control in ("without_loop_closure", "with_slip", "with_slip_without_loop_closure"):
        for key, name in (("ate", "slam_ate_rmse_m"), ("cells", "slam_wall_cells_within_5cm")):
            summary[f"{name}_{control}"] = float(np.mean([one[control][key] for one in each]))
    if arguments.json:
        print(json.dumps(summary | {"each": each}))
    else:
        for key, value in summary.items():
            print(f"{key:60} {value:.4f}" if isinstance(value, float) else f"{key:60} {value}")


if __name__ == "__main__":
    main()
