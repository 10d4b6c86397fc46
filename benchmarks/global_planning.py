"""Global planners side by side on equal questions: prints one JSON document, draws a picture where asked.

Questions: random poses in generated apartments whose doors stand open or half open, and on a grid of 400 × 400 cells
of four rooms. Times are CPU times of this one thread, so that a loaded machine gives nearly the figures of an idle one.
``length_ratio``: to the shortest way over the cells for a disc around the base, turns of the ends included;
``clearance_m``: of the footprint along the path, the smallest. ``search``: the search over the cells alone, and that of
the peer pyastar2d on the same costs, where it is installed (``pip install pyastar2d``).
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.navigation_measures.grid_pictures import draw_base, draw_costmap
from bestman_bt.facts.goals.at_goal import base_footprint
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, cheapest_path, shortest_length
from bestman_bt.registry import ALGORITHMS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.openness import articulation_obstacles
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import WorldModel
from examples.plugins.sampled_roads import PRM, RRTStar

PLANNERS = {
    **{name: ALGORITHMS.resolve(f"global_planning/{name}") for name in ("grid_astar", "theta_star", "hybrid_astar")},
    "prm": PRM,
    "rrt_star": RRTStar,
}
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple")
Question = tuple[Costmap, Pose2D, Pose2D]


def apartment(seed: int, footprint: Footprint) -> Costmap:
    known = WorldModel(map=semantic_map(draw_world(load_scene("apartment_doors"), seed)))
    return Costmap.from_map(known.map, footprint, articulation_obstacles(known))


def four_rooms(footprint: Footprint) -> Costmap:
    """400 × 400 cells of 5 cm: two walls that cross, each half with a doorway of 90 cm."""
    size, half = 18.8, 9.4
    walls = [(0, 0, size, 0), (size, 0, size, size), (size, size, 0, size), (0, size, 0, 0)]
    for low, high, doorway in ((0.0, half, 3.0), (half, size, 15.0)):
        for side in (half - 0.05, half + 0.05):
            for begin, end in ((low, doorway - 0.45), (doorway + 0.45, high)):
                walls += [(side, begin, side, end), (begin, side, end, side)]
    return Costmap.from_map(SemanticMap(np.array(walls, dtype=float), {}), footprint)


def questions(costmap: Costmap, count: int, rng: np.random.Generator) -> list[Question]:
    """Pairs of poses at least 2 m apart at which the base can turn, in the largest area."""
    areas = areas_of_disc(costmap, costmap.footprint.circumscribed_radius + 0.01)
    inner = areas[2:-2, 2:-2]
    labels = np.bincount(inner[inner > 0])
    points = costmap.grid_points(np.argwhere(areas == labels.argmax()))
    asked: list[Question] = []
    while len(asked) < count:
        ends = points[rng.integers(len(points), size=2)]
        if np.linalg.norm(ends[0] - ends[1]) > 2.0:
            poses = [Pose2D(float(x), float(y), float(rng.uniform(-np.pi, np.pi))) for x, y in ends]
            asked.append((costmap, poses[0], poses[1]))
    return asked


def clearance(path: Path2D, costmap: Costmap) -> float:
    """Metres between the footprint and the next obstacle along straight pieces, the smallest."""
    deltas = np.diff(path.points, axis=0)
    headings = np.arctan2(deltas[:, 1], deltas[:, 0]) + np.where(path.reverse, np.pi, 0.0)
    poses = [
        np.column_stack([begin + np.linspace(0.0, 1.0, 40)[:, None] * delta, np.full(40, heading)])
        for begin, delta, heading in zip(path.points, deltas, headings, strict=False)
    ]
    return float(costmap.footprint_clearance(np.vstack(poses)).min())


def figures(planner: GlobalPlanner, asked: list[Question]) -> dict:
    times, ratios, rooms = [], [], []
    for costmap, start, goal in asked:
        begin = time.process_time()
        path = planner.plan(start, goal, costmap)
        times.append(1e3 * (time.process_time() - begin))
        if isinstance(path, Path2D):
            radius = costmap.footprint.circumscribed_radius
            ratios.append(path.length / shortest_length(start.xy, goal.xy, costmap, radius))
            rooms.append(clearance(path, costmap))
    return {
        "solved": len(ratios),
        "plan_ms_median": round(float(np.median(times)), 1),
        "plan_ms_p95": round(float(np.percentile(times, 95)), 1),
        "length_ratio_median": round(float(np.median(ratios)), 3) if ratios else None,
        "clearance_m_median": round(float(np.median(rooms)), 3) if rooms else None,
        "clearance_m_min": round(min(rooms), 3) if rooms else None,
    }


def search_figures(asked: list[Question]) -> dict:
    """CPU time of the search over cells and of pyastar2d's on the same costs, and what both ways cost."""
    peer = importlib.import_module("pyastar2d") if importlib.util.find_spec("pyastar2d") else None
    ours, theirs, ratios = [], [], []
    for costmap, start, goal in asked:
        lethal = costmap.footprint.circumscribed_radius
        begin = time.process_time()
        way = cheapest_path(start.xy, goal.xy, costmap, lethal)
        ours.append(1e3 * (time.process_time() - begin))
        if peer is None or way is None:
            continue
        weights = costmap.cost(costmap.distance, lethal).astype(np.float32)
        ends = [tuple(int(k[0]) for k in costmap.cells(point[None])) for point in (way[0], way[-1])]
        begin = time.process_time()
        cells = peer.astar_path(weights, *ends, allow_diagonal=True)
        theirs.append(1e3 * (time.process_time() - begin))
        ratios.append(_cost(way, costmap, lethal) / _cost(costmap.grid_points(cells), costmap, lethal))
    return {
        "ms_median": round(float(np.median(ours)), 2),
        "pyastar2d_ms_median": round(float(np.median(theirs)), 2) if theirs else "not installed: pip install pyastar2d",
        "time_ratio_to_pyastar2d": round(float(np.median(np.divide(ours, theirs))), 2) if theirs else None,
        "cost_ratio_to_pyastar2d": round(float(np.median(ratios)), 4) if ratios else None,
    }


def _cost(way: np.ndarray, costmap: Costmap, lethal: float) -> float:
    cost = costmap.cost(costmap.distance[costmap.cells(way)], lethal)
    return float((np.linalg.norm(np.diff(way, axis=0), axis=1) * (cost[1:] + cost[:-1]) / 2).sum())


def draw(asked: Question, planners: dict[str, GlobalPlanner], file: Path) -> None:
    costmap, start, goal = asked
    rows, columns = costmap.distance.shape
    figure = Figure(figsize=(9, 9 * rows / columns), dpi=90, layout="constrained")
    axes = figure.subplots()
    draw_costmap(axes, costmap)
    draw_base(axes, costmap.footprint, start, "gold")
    draw_base(axes, costmap.footprint, goal, "limegreen")
    for (name, planner), colour in zip(planners.items(), COLOURS, strict=False):
        path = planner.plan(start, goal, costmap)
        if isinstance(path, Path2D):
            axes.plot(*path.points.T, color=colour, label=f"{name}, {path.length:.1f} m", lw=1.8, zorder=8)
    figure.legend(loc="outside lower center", ncols=len(planners), fontsize=8, frameon=False)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    FigureCanvasAgg(figure)
    figure.savefig(file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0, help="of the first apartment and of the questions")
    parser.add_argument("--apartments", type=int, default=5)
    parser.add_argument("--questions", type=int, default=6, help="on each map")
    parser.add_argument("--planners", nargs="+", default=list(PLANNERS), choices=PLANNERS)
    parser.add_argument("--png", type=Path, help="draw all paths of one question in the first apartment here")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON (they always are)")
    arguments = parser.parse_args()
    footprint = base_footprint(load_robot_model("diff_panda"))
    rng = np.random.default_rng(arguments.seed)
    planners = {name: PLANNERS[name]() for name in arguments.planners}
    seeds = range(arguments.seed, arguments.seed + arguments.apartments)
    maps = [apartment(seed, footprint) for seed in seeds]
    asked = {
        "apartments": [question for costmap in maps for question in questions(costmap, arguments.questions, rng)],
        "grid_400": questions(four_rooms(footprint), 2 * arguments.questions, rng),
    }
    if arguments.png:
        far = max(asked["apartments"][: arguments.questions], key=lambda question: question[1].distance_to(question[2]))
        draw(far, planners, arguments.png)
    packages = {name: version(name) for name in ("numpy", "scipy", "ompl")}
    document = {
        "seed": arguments.seed,
        "apartment_seeds": [seeds[0], seeds[-1]],
        "maps": {
            name: {
                "questions": len(problems),
                "cells": [
                    int(np.min([q[0].distance.size for q in problems])),
                    max(q[0].distance.size for q in problems),
                ],
                "search": search_figures(problems),
                "planners": {planner: figures(made, problems) for planner, made in planners.items()},
            }
            for name, problems in asked.items()
        },
        "machine": {"platform": platform.platform(), "cpus": os.cpu_count(), "load": round(os.getloadavg()[0], 2)},
        "versions": {"python": platform.python_version(), **packages},
    }
    json.dump(document, sys.stdout, indent=2)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
