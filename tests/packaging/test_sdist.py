"""The source archive: small, all sources and tests, no pictures, and a wheel comes out of it as out of a checkout."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
LARGEST = 6_000_000
"""Bytes of the archive."""
PICTURES = ("docs/gallery", "docs/images")
"""Folders that stay in the repository."""


def built(kind: str, source: Path, folder: Path) -> Path:
    command = [sys.executable, "-m", "build", f"--{kind}", "--no-isolation", "--outdir", str(folder), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    (file,) = folder.iterdir()
    return file


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("sdist", CHECKOUT, tmp_path_factory.mktemp("archive"))


@pytest.fixture(scope="module")
def unpacked(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    (root,) = folder.iterdir()
    return root


def files_below(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def wheel_contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


@pytest.mark.slow
def test_the_archive_is_small(archive: Path) -> None:
    assert archive.stat().st_size <= LARGEST


@pytest.mark.slow
def test_neither_pictures_nor_films_nor_packages_of_the_page_are_in_it(unpacked: Path) -> None:
    names = files_below(unpacked)
    assert not {name for name in names if name.endswith((".png", ".jpg", ".webp", ".gif", ".mp4", ".rrd"))}
    assert not {name for name in names if "node_modules" in Path(name).parts or "__pycache__" in Path(name).parts}


def test_every_file_of_the_repository_but_the_pictures_of_the_docs_is_in_it(unpacked: Path) -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=CHECKOUT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("git does not know this folder: it may be an unpacked source archive itself")
    tracked = {name for name in listed.stdout.split("\0") if name and (CHECKOUT / name).is_file()}
    expected = {name for name in tracked if not name.startswith(PICTURES)}
    assert len(expected) > 1000
    assert expected - files_below(unpacked) == set()


@pytest.mark.slow
def test_the_wheel_from_the_archive_is_the_wheel_from_the_checkout(unpacked: Path, tmp_path: Path) -> None:
    from_archive, from_checkout = tmp_path / "from_archive", tmp_path / "from_checkout"
    contents = wheel_contents(built("wheel", unpacked, from_archive))
    assert contents == wheel_contents(built("wheel", CHECKOUT, from_checkout))
    assert "bestman_bt/_data/trees/fetch_cup.xml" in contents


@pytest.mark.slow
def test_a_test_runs_in_the_unpacked_archive(unpacked: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/messages"]
    done = subprocess.run(command, cwd=unpacked, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout
