"""Operations on clouds, ours beside Open3D's, on rendered views of tables.

    python benchmarks/clouds.py [--seed S] [--frames N] [--json]

Views are 640×480 with the noise of a structured-light camera. Times: processor time of one call, all threads counted,
median over the frames; a ratio above 1 means that Open3D takes longer. ``segmented``: objects that are exactly one
cluster.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.rendered_table import RenderedTable, TrueObject, random_table
from bestman_bt.evaluation.versions import versions
from bestman_bt.perception import clouds
from bestman_bt.perception.segmentation.base import voxel_means
from bestman_bt.perception.segmentation.horizontal_plane import HorizontalPlane
from bestman_bt.perception.segmentation.plane_dbscan import Open3DDbscan, PlaneDbscan, dbscan


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    scenes = [random_table(asked.seed + number) for number in range(asked.frames)]
    report = {
        "machine": {"processor": platform.machine(), "python": platform.python_version()},
        "versions": versions(),
        "seeds": [asked.seed, asked.seed + asked.frames - 1],
        "operations": measured(scenes),
        "segmented": {kind.__name__: separate(kind(), scenes) for kind in (PlaneDbscan, Open3DDbscan)},
    }
    if asked.json:
        print(json.dumps(report, indent=2))
        return
    for name, row in report["operations"].items():
        print(f"{name:12} ours {row['ours_ms']:7.2f} ms   open3d {row['open3d_ms']:7.2f} ms   × {row['ratio']:.2f}")
    for name, (good, total) in report["segmented"].items():
        print(f"{name}: {good} of {total} objects are one cluster")


def measured(scenes: list[RenderedTable]) -> dict[str, dict[str, float]]:
    """Name of an operation → milliseconds of ours and of Open3D's."""
    times: dict[str, list[tuple[float, float]]] = {}
    for scene in scenes:
        for name, (ours, theirs) in operations(scene).items():
            times.setdefault(name, []).append((milliseconds(ours), milliseconds(theirs)))
    table = {}
    for name, rows in times.items():
        ours_ms, open3d_ms = (statistics.median(column) for column in zip(*rows, strict=True))
        table[name] = {"ours_ms": round(ours_ms, 2), "open3d_ms": round(open3d_ms, 2)}
        table[name]["ratio"] = round(open3d_ms / ours_ms, 2)
    return table


def operations(scene: RenderedTable) -> dict[str, tuple[Callable[[], Any], Callable[[], Any]]]:
    """Each operation on a view, ours and Open3D's."""
    p = HorizontalPlane()
    surface_from_frame = scene.region.frame_from_surface.inverse()
    cloud = scene.view.seen_from(surface_from_frame).cloud(surface_from_frame.apply(scene.region.corners()))
    band = cloud.points[np.abs(cloud.points[:, 2]) <= scene.region.tolerance]
    thin = voxel_means(cloud, 0.004).points

    def segment(algorithm: PlaneDbscan) -> Any:
        return algorithm.segment(scene.view, scene.region, np.random.default_rng(0))

    return {
        "voxels": (lambda: voxel_means(cloud, 0.004), lambda: clouds.thinned(cloud, 0.004)),
        "plane": (
            lambda: p.fit_plane(band, np.random.default_rng(0), p.min_plane_points),
            lambda: clouds.largest_plane(band, p.ransac_distance, p.ransac_samples, 0),
        ),
        "dbscan": (lambda: dbscan(thin, 0.015, 4), lambda: clouds.density_clusters(thin, 0.015, 4)),
        "segment": (lambda: segment(PlaneDbscan()), lambda: segment(Open3DDbscan())),
    }


def milliseconds(call: Callable[[], Any]) -> float:
    """Processor time of a call, the second one."""
    call()
    begin = time.process_time()
    call()
    return 1e3 * (time.process_time() - begin)


def separate(segmentation: PlaneDbscan, scenes: list[RenderedTable]) -> tuple[int, int]:
    """How many objects are exactly one cluster, and how many there are."""
    good = total = 0
    for scene in scenes:
        found = segmentation.segment(scene.view, scene.region, np.random.default_rng(0)).clusters
        for item in scene.objects:
            total += 1
            good += sum(share_inside(cluster.points, item) > 0.9 for cluster in found) == 1
    return good, total


def share_inside(points: np.ndarray, item: TrueObject) -> float:
    """The share of points inside an object's bounding box, grown by 1 cm."""
    local = item.pose.inverse().apply(points)
    return float((np.abs(local) < item.model.size / 2 + 0.01).all(axis=1).mean())


if __name__ == "__main__":
    main()
