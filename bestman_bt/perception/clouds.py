"""Operations on clouds by Open3D (extra ``open3d``): files, voxels, outliers, normals, planes, clusters, pictures.

Zhou, Park and Koltun, "Open3D: A Modern Library for 3D Data Processing", 2018. Each function gives the same result for
the same input. Open3D's registration (ICP) does not, so it is not used. All raise MissingExtraError without the extra.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import open3d
from bestman_bt.messages import CameraIntrinsics, PointCloud, Pose
from bestman_bt.perception.errors import PerceptionError

CLOUD_FILES = (".ply", ".pcd", ".xyz", ".pts")


def read_cloud(path: Path) -> PointCloud:
    """Return the cloud in a file, metres, with colours if the file has them. Raises PerceptionError if it cannot be
    read.
    """
    _check_suffix(path)
    if not path.is_file():
        raise PerceptionError(f"{path}: no such file")
    library = open3d()
    with path.open("rb") as file:
        if path.suffix.lower() == ".ply" and file.read(3) != b"ply":  # of which Open3D would print words of its own
            raise PerceptionError(f"{path}: is not a PLY file, which begins with the line 'ply'")
    with library.utility.VerbosityContextManager(library.utility.VerbosityLevel.Error):
        cloud = library.io.read_point_cloud(str(path), remove_nan_points=True, remove_infinite_points=True)
    if cloud.is_empty():
        raise PerceptionError(f"{path}: no points can be read")
    return _ours(cloud)


def write_cloud(path: Path, cloud: PointCloud, normals: NDArray[np.float64] | None = None) -> None:
    """Write a cloud, binary, in the format of the file's suffix. ``normals``: (N, 3) unit vectors. Raises
    PerceptionError.
    """
    _check_suffix(path)
    library, written = open3d(), _theirs(cloud)
    if normals is not None:
        written.normals = library.utility.Vector3dVector(normals)
    if not path.parent.is_dir() or not library.io.write_point_cloud(str(path), written):
        raise PerceptionError(f"{path} cannot be written")


def thinned(cloud: PointCloud, edge: float) -> PointCloud:
    """Return the mean of position and colour in each cube of ``edge`` metres."""
    return _ours(_theirs(cloud).voxel_down_sample(edge))


def without_outliers(cloud: PointCloud, neighbours: int = 8, ratio: float = 6.0) -> PointCloud:
    """Return the cloud without points whose mean distance to ``neighbours`` is ``ratio`` standard deviations above the
    mean.
    """
    if len(cloud) <= neighbours:
        return cloud
    _, kept = _theirs(cloud).remove_statistical_outlier(neighbours, ratio)
    return cloud.selected(np.sort(np.asarray(kept, dtype=np.intp)))


def estimated_normals(points: NDArray[np.float64], towards: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Return unit normals (N, 3) of points (N, 3) from at most 30 neighbours within ``radius`` metres, facing
    ``towards``.
    """
    library, cloud = open3d(), _theirs(PointCloud(points))
    cloud.estimate_normals(library.geometry.KDTreeSearchParamHybrid(radius=radius, max_nn=30))
    cloud.orient_normals_towards_camera_location(np.asarray(towards, dtype=np.float64))
    return np.asarray(cloud.normals).copy()


def largest_plane(points: NDArray[np.float64], distance: float, samples: int, seed: int) -> NDArray[np.float64]:
    """Return (a, b, c, d) of the plane a x + b y + c z + d = 0 with most of the points (N, 3) within ``distance``
    metres.

    By RANSAC with ``samples`` triples (Fischler and Bolles, 1981).
    """
    library = open3d()
    library.utility.random.seed(seed)
    plane, _ = _theirs(PointCloud(points)).segment_plane(distance, ransac_n=3, num_iterations=samples, probability=1.0)
    return np.asarray(plane)


def density_clusters(points: NDArray[np.float64], distance: float, core_points: int) -> NDArray[np.int64]:
    """Return DBSCAN labels (N,) from 0, -1 for noise; a core has ``core_points``, itself included, within
    ``distance``.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=np.int64)
    return np.asarray(_theirs(PointCloud(points)).cluster_dbscan(distance, core_points), dtype=np.int64)


def cloud_picture(cloud: PointCloud, intrinsics: CameraIntrinsics, camera_from_frame: Pose) -> NDArray[np.uint8]:
    """Return the pinhole image of the points, (height, width, 3), on white; without colours they are grey."""
    library = open3d()
    k, tensor = intrinsics, library.core.Tensor
    seen = library.t.geometry.PointCloud(tensor(cloud.points.astype(np.float32)))
    colors = np.full((len(cloud), 3), 96, np.uint8) if cloud.colors is None else cloud.colors
    seen.point.colors = tensor(np.maximum(colors, 1))
    matrix = np.array([[k.fx, 0.0, k.cx], [0.0, k.fy, k.cy], [0.0, 0.0, 1.0]])
    image = seen.project_to_rgbd_image(
        k.width, k.height, tensor(matrix), tensor(camera_from_frame.matrix.copy()), depth_scale=1.0, depth_max=1e3
    )
    picture = np.rint(255.0 * np.asarray(image.color)).astype(np.uint8)
    picture[np.asarray(image.depth)[..., 0] == 0.0] = 255
    return picture


def _check_suffix(path: Path) -> None:
    if path.suffix.lower() not in CLOUD_FILES:
        raise PerceptionError(
            f"{path}: a cloud's file ends in {', '.join(CLOUD_FILES)}, not {path.suffix or 'nothing'}"
        )


def _theirs(cloud: PointCloud) -> Any:
    library = open3d()
    made = library.geometry.PointCloud(library.utility.Vector3dVector(cloud.points.copy()))
    if cloud.colors is not None:
        made.colors = library.utility.Vector3dVector(cloud.colors / 255.0)
    return made


def _ours(cloud: Any) -> PointCloud:
    colors = np.rint(255.0 * np.asarray(cloud.colors)).astype(np.uint8) if cloud.has_colors() else None
    return PointCloud(np.asarray(cloud.points).copy(), colors)
