"""Examples: bestman-bt cloud table_0.ply --png table.png; bestman-bt cloud scan.pcd --voxel 5mm --clean -o thin.ply."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bestman_bt.cli.options import Json, Png, json_output, number, wrong_input
from bestman_bt.messages import CameraIntrinsics, PointCloud, Pose
from bestman_bt.perception.clouds import (
    cloud_picture,
    estimated_normals,
    read_cloud,
    thinned,
    without_outliers,
    write_cloud,
)
from bestman_bt.perception.errors import PerceptionError

_WIDTH, _HEIGHT, _FOCAL_LENGTH = 960, 720, 900.0


def command(
    file: Annotated[Path, typer.Argument(help="A cloud: .ply, .pcd, .xyz or .pts, in metres, z up.")],
    voxel: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Keep one point per cube of this edge length, such as 5mm.")
    ] = None,
    clean: Annotated[bool, typer.Option("--clean", help="Remove outliers.")] = False,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Write the points, with normals, in any of these formats."),
    ] = None,
    png: Png = None,
    as_json: Json = False,
) -> None:
    """Show the size and extent of a point cloud; optionally downsample, filter, convert or draw it."""
    with json_output(as_json) as write:
        edge = None if voxel is None else number("--voxel", voxel, "length")
        try:
            read = cloud = read_cloud(file)
            if edge is not None:
                cloud = thinned(cloud, edge)
            if clean:
                cloud = without_outliers(cloud)
            lower, upper = cloud.points.min(axis=0), cloud.points.max(axis=0)
            if out is not None:
                above = np.array([*(lower + upper)[:2] / 2, upper[2] + 10.0 * max(np.ptp(cloud.points, axis=0))])
                write_cloud(out, cloud, estimated_normals(cloud.points, above, (edge or 0.005) * 4))
        except PerceptionError as error:
            raise wrong_input(str(file), str(error).removeprefix(f"{file}: ")) from error
        facts: dict[str, Any] = {
            "points_read": len(read),
            "points": len(cloud),
            "colors": cloud.colors is not None,
            "lower_m": np.round(lower, 4).tolist(),
            "upper_m": np.round(upper, 4).tolist(),
            "files": [str(path) for path in (out, png) if path is not None],
        }
        if png is not None:
            from PIL import Image

            Image.fromarray(_picture(cloud)).save(png)
        write(facts)
        if not as_json:
            colours = "with colours" if facts["colors"] else "without colours"
            print(f"{file}: {len(read):,} points, {len(cloud):,} of them left, {colours}")
            for axis, low, high in zip("xyz", lower, upper, strict=True):
                print(f"  {axis}  {low:8.3f} to {high:.3f} m")
            for path in facts["files"]:
                print(f"  {path}")


def _picture(cloud: PointCloud) -> np.ndarray:
    """Return the whole cloud, from 35° above and 30° to the side."""
    lower, upper = cloud.points.min(axis=0), cloud.points.max(axis=0)
    middle, radius = (lower + upper) / 2, max(float(np.linalg.norm(upper - lower)) / 2, 1e-3)
    yaw, pitch = math.radians(150.0), math.radians(35.0)
    towards = -np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)])
    right = np.cross(towards, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(towards, right), towards], axis=1)
    matrix[:3, 3] = middle - towards * radius * _FOCAL_LENGTH / (_HEIGHT / 2) * 1.05
    camera = CameraIntrinsics(_WIDTH, _HEIGHT, _FOCAL_LENGTH, _FOCAL_LENGTH, _WIDTH / 2, _HEIGHT / 2)
    return cloud_picture(cloud, camera, Pose.from_matrix(matrix).inverse())
