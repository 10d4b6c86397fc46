from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest

from bestman_bt.messages import Box, CameraIntrinsics, Cylinder, PlacedShape, Pose
from bestman_bt.visualization.rerun.open_recording import RecordedCamera, RecordingSetup
from bestman_bt.visualization.rerun.recorder import RerunRecorder
from bestman_bt.visualization.snapshot import RecordedBody

INTRINSICS = CameraIntrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
UNREAD = ("rerun.controls.RowId", "log_time", "log_tick")


@pytest.fixture(autouse=True)
def _rerun_raises_instead_of_warning() -> Iterator[None]:
    import rerun as rr

    before = rr.strict_mode()
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(before)


@pytest.fixture
def scene_bodies() -> list[RecordedBody]:
    return [
        RecordedBody(
            "table top",
            (PlacedShape(Box((1.2, 0.8, 0.04)), Pose()),),
            ((0.7, 0.5, 0.3, 1.0),),
            Pose.from_xyz_rpy((1.5, 0.5, 0.7)),
        ),
        RecordedBody(
            "cup",
            (PlacedShape(Cylinder(0.04, 0.1), Pose()),),
            ((0.8, 0.2, 0.2, 1.0),),
            Pose.from_xyz_rpy((1.4, 0.4, 0.77)),
        ),
    ]


@pytest.fixture
def record(tmp_path, robot_urdf, fetch_tree, scene_bodies):
    """A context manager that yields an open recorder; ``recorded`` reads what it wrote."""

    @contextmanager
    def recording(**changes: Any) -> Iterator[RerunRecorder]:
        arguments: dict[str, Any] = {
            "urdf": robot_urdf,
            "base_frame": "floor_point",
            "bodies": scene_bodies,
            "tree": fetch_tree,
            "cameras": {"head": RecordedCamera(INTRINSICS, "eye")},
            "plotted_joints": ("arm_shoulder",),
            "grippers": {"hand": ("arm_slide",)},
            **changes,
        }
        with RerunRecorder(tmp_path / "run.rrd", RecordingSetup(**arguments)) as recorder:
            yield recorder

    return recording


class Recorded:
    """Rows of a recording: ``rows(entity)`` gives dictionaries of timelines (seconds) and components."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        self.reader = RrdReader(path)
        self._chunks: dict[str, list[Any]] = {}
        for chunk in self.reader.stream():
            self._chunks.setdefault(chunk.entity_path, []).append(chunk)

    @property
    def entities(self) -> set[str]:
        return set(self._chunks)

    def rows(self, entity: str, *, static: bool = False) -> list[dict[str, Any]]:
        rows = []
        for chunk in self._chunks.get(entity, []):
            if chunk.is_static == static:
                batch = chunk.to_record_batch()
                kept = [name for name in batch.schema.names if name not in UNREAD]
                if "sim_time" in kept:
                    seconds = pc.divide(batch.column("sim_time").cast("int64").cast("float64"), 1e9)
                    batch = batch.set_column(batch.schema.get_field_index("sim_time"), "sim_time", seconds)
                rows += batch.select(kept).to_pylist()
        return sorted(rows, key=lambda row: row.get("sim_time", 0.0))

    def column(self, entity: str, component: str, *, static: bool = False) -> list[Any]:
        return [row[component] for row in self.rows(entity, static=static) if row.get(component) is not None]


@pytest.fixture
def recorded(tmp_path):
    return lambda: Recorded(tmp_path / "run.rrd")


@pytest.fixture
def intrinsics() -> CameraIntrinsics:
    return INTRINSICS


@pytest.fixture
def picture() -> np.ndarray:
    """A smooth colour image (48, 64, 3)."""
    rows, columns = np.mgrid[0:48, 0:64]
    return np.stack([rows * 5, columns * 3, 128 + 0 * rows], axis=-1).astype(np.uint8)
