"""Clouds and meshes by Open3D: what is written is read again, and every operation does what it says, twice alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from bestman_bt.cli.main import main
from bestman_bt.messages import CameraIntrinsics, Mesh, PointCloud, Pose
from bestman_bt.perception import clouds
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.object_models.convex_parts import simplified
from bestman_bt.scene.mesh_file import MeshError, read_triangles

pytestmark = pytest.mark.usefixtures("needs_open3d")

RNG = np.random.default_rng(5)
SHEET = np.column_stack([RNG.uniform(-0.3, 0.3, (4000, 2)), RNG.normal(0.7, 0.001, 4000)])


@pytest.fixture
def cloud() -> PointCloud:
    return PointCloud(SHEET, RNG.integers(0, 256, SHEET.shape).astype(np.uint8))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
@pytest.mark.parametrize("coloured", [True, False])
def test_a_cloud_is_read_as_it_was_written(cloud: PointCloud, tmp_path: Path, suffix: str, coloured: bool) -> None:
    written = cloud if coloured else PointCloud(cloud.points)
    clouds.write_cloud(tmp_path / f"cloud{suffix}", written)
    read = clouds.read_cloud(tmp_path / f"cloud{suffix}")
    np.testing.assert_allclose(read.points, cloud.points, atol=1e-7)
    assert (read.colors is None) is not coloured
    if coloured:
        np.testing.assert_array_equal(read.colors, cloud.colors)


def test_a_file_that_is_no_cloud_is_reported_in_words(tmp_path: Path, cloud: PointCloud) -> None:
    (tmp_path / "text.ply").write_text("nothing of the kind")
    for path, words in (
        ("text.ply", "is not a PLY file"),
        ("gone.ply", "no such file"),
        ("picture.png", "ends in .ply"),
    ):
        with pytest.raises(PerceptionError, match=words):
            clouds.read_cloud(tmp_path / path)
    with pytest.raises(PerceptionError, match="cannot be written"):
        clouds.write_cloud(tmp_path / "gone" / "cloud.ply", cloud)


def test_a_voxel_keeps_the_mean_and_a_lone_point_is_dropped(cloud: PointCloud) -> None:
    two = PointCloud(
        np.array([[0.001, 0.001, 0.0], [0.003, 0.003, 0.0]]), np.array([[0, 0, 0], [200, 100, 0]], np.uint8)
    )
    np.testing.assert_allclose(clouds.thinned(two, 0.01).points, [[0.002, 0.002, 0.0]])
    np.testing.assert_array_equal(clouds.thinned(two, 0.01).colors, [[100, 50, 0]])
    with_lone = PointCloud(np.vstack([[[0.0, 0.0, 1.5]], cloud.points]))
    np.testing.assert_array_equal(clouds.without_outliers(with_lone).points, cloud.points)


def test_normals_face_the_viewpoint() -> None:
    for height, up in ((2.0, 1.0), (-2.0, -1.0)):
        normals = clouds.estimated_normals(SHEET, np.array([0.0, 0.0, height]), 0.05)
        assert float(np.median(normals[:, 2] * up)) > 0.995


def test_a_plane_is_found_among_other_points_and_twice_alike() -> None:
    tilted = Pose.from_xyz_rpy((0.1, 0.2, 0.3), (0.2, -0.3, 0.4))
    points = np.vstack([tilted.apply(SHEET - (0.0, 0.0, 0.7)), RNG.uniform(-0.5, 0.5, (1500, 3))])
    plane = clouds.largest_plane(points, 0.004, 200, seed=7)
    assert abs(float(plane[:3] @ tilted.rotation[:, 2])) > np.cos(np.radians(0.5))
    assert abs(float(plane[:3] @ tilted.position + plane[3])) < 0.002
    np.testing.assert_array_equal(plane, clouds.largest_plane(points, 0.004, 200, seed=7))


def test_clusters_are_parted_by_distance_and_noise_is_reported() -> None:
    blob = RNG.uniform(0.0, 0.03, (400, 3))
    points = np.vstack([blob, blob + np.array([0.06, 0.0, 0.0]), [[0.5, 0.5, 0.5]]])
    labels = clouds.density_clusters(points, 0.015, 4)
    assert [set(labels[:400]), set(labels[400:800]), labels[800]] == [{0}, {1}, -1]
    assert len(clouds.density_clusters(np.zeros((0, 3)), 0.015, 4)) == 0


def test_a_picture_shows_the_nearer_point_on_white() -> None:
    points = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.4, 0.0, 2.0]])
    seen = PointCloud(points, np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]], np.uint8))
    picture = clouds.cloud_picture(seen, CameraIntrinsics(64, 48, 50.0, 50.0, 32.0, 24.0), Pose())
    assert picture[24, 32].tolist() == [255, 1, 1]
    assert picture[24, 42].tolist() == [1, 1, 255]
    assert (picture.reshape(-1, 3) == 255).all(axis=1).sum() == 64 * 48 - 2


def test_all_groups_of_a_mesh_are_read_and_a_broken_one_is_reported(tmp_path: Path) -> None:
    two = [
        trimesh.creation.box((0.1, 0.1, 0.1)),
        trimesh.creation.icosphere(2, 0.05).apply_translation((0.3, 0.0, 0.0)),
    ]
    scene = trimesh.Scene(dict(zip(("box", "ball"), two, strict=True)))
    scene.export(tmp_path / "two.obj")
    ours, theirs = (read_triangles(tmp_path / "two.obj", library) for library in ("trimesh", "open3d"))
    assert theirs.volume == pytest.approx(ours.volume, rel=1e-6)
    assert len(theirs.faces) == len(ours.faces)
    (tmp_path / "bad.stl").write_text("x")
    with pytest.raises(MeshError, match="open3d read no triangles from bad.stl"):
        read_triangles(tmp_path / "bad.stl", "open3d")


def test_a_fine_mesh_is_thinned_out_and_keeps_its_shape() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.04)
    fewer = simplified(Mesh(np.asarray(ball.vertices), np.asarray(ball.faces)), 4_000, "open3d")
    assert 3_000 < len(fewer.faces) <= 4_000
    np.testing.assert_allclose(np.linalg.norm(fewer.vertices, axis=1), 0.04, atol=3e-4)


def test_the_command_thins_converts_and_draws(
    cloud: PointCloud, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clouds.write_cloud(tmp_path / "cloud.ply", cloud)
    monkeypatch.chdir(tmp_path)
    arguments = ["cloud", "cloud.ply", "--voxel", "2cm", "--clean", "-o", "thin.pcd", "--png", "thin.png", "--json"]
    monkeypatch.setattr("sys.argv", ["bestman-bt", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    assert not end.value.code
    facts = json.loads(capsys.readouterr().out)
    assert facts["points_read"] == 4000
    assert facts["points"] == len(clouds.read_cloud(tmp_path / "thin.pcd")) < 1000
    assert (tmp_path / "thin.png").stat().st_size > 1000
