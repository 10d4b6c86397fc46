"""Apartments mapped by exploration, one after the other: the figures of their maps, with and without loop closures."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.navigation_measures.exploration import again, apartment, explore
from benchmarks.navigation_measures.map_pictures import map_picture, stages_picture
from benchmarks.navigation_measures.map_quality import map_quality
from benchmarks.navigation_measures.report import mean
from bestman_bt.navigation.map_file import write_map

AREA = 100.0
"""Square metres of an apartment."""
SLIP = 0.10
"""Mean share by which wheels turn without driving."""


def measure(
    seed: int,
    apartments: int,
    area: float = AREA,
    slip: float = SLIP,
    settings: list[str] | None = None,
    pictures: Path | None = None,
) -> dict[str, Any]:
    """So many apartments from ``seed`` on; each is told on standard error when it is done."""
    each: list[dict[str, Any]] = []
    for one in range(seed, seed + apartments):
        each.append(_measure_one(one, area, slip, settings or [], pictures))
        print(json.dumps(each[-1]), file=sys.stderr, flush=True)
    made, control = ([one[key] for one in each] for key in ("with_loop_closure", "without_loop_closure"))
    return {
        "seed": seed,
        "apartments": len(each),
        "explored_rate": mean([one["succeeded"] for one in each]),
        "contacts": sum(len(one["contacts"]) for one in each),
        "slam_ate_rmse_m": mean([one["ate"] for one in made]),
        "slam_ate_rmse_m_max": max(one["ate"] for one in made),
        "slam_wall_cells_within_5cm": mean([one["cells"] for one in made]),
        "slam_surfaces_found": mean([one["found"] for one in made]),
        "slam_floor_mapped": mean([one["floor"] for one in made]),
        "exploration_sim_s": mean([one["exploration_sim_s"] for one in each]),
        "exploration_sim_s_max": max(one["exploration_sim_s"] for one in each),
        "real_time_factor": mean([one["real_time_factor"] for one in each]),
        "real_time_factor_of_processor": mean([one["real_time_factor_of_processor"] for one in each]),
        "slam_ate_rmse_m_without_loop_closure": mean([one["ate"] for one in control]),
        "slam_wall_cells_within_5cm_without_loop_closure": mean([one["cells"] for one in control]),
        "each": each,
    }


def _measure_one(seed: int, area: float, slip: float, settings: list[str], pictures: Path | None) -> dict[str, Any]:
    """One apartment."""
    run = explore(apartment(seed, area, settings), slip)
    without_closures = again(run, loop_closure=False)
    made, control = map_quality(run, run.slam), map_quality(run, without_closures)
    if pictures is not None:
        for name, slam, what in (("map", run.slam, made), ("no_closure", without_closures, control)):
            title = f"seed {seed}, {name}: ATE {1e3 * what.ate:.1f} mm, {what.loops} loop closures"
            map_picture(run, slam, pictures / f"slam_{seed}_{name}.png", title)
        stages_picture(run, pictures / f"slam_{seed}_stages.png")
        write_map(run.slam.grid, pictures / f"slam_{seed}.yaml")
    return {
        "seed": seed,
        "succeeded": run.succeeded,
        "why": run.why,
        "exploration_sim_s": run.sim_s,
        "real_time_factor": run.sim_s / run.wall_s,
        "real_time_factor_of_processor": run.sim_s / run.processor_s,
        "contacts": run.contacts,
        "with_loop_closure": asdict(made),
        "without_loop_closure": asdict(control),
    }
