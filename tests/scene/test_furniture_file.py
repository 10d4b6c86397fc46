"""Furniture files: generated and hand-written ones, and what is said about bad ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.scene import FurnitureModel

SHIPPED = ("counter", "cupboard", "dishwasher", "drawer_chest", "fridge", "microwave", "room_door", "shelf", "table")

CABINET = """\
footprint: [40 cm, 50 cm]
parts:
  - {box: [40 cm, 50 cm, 2 cm], xyz: [0, 0, 79 cm], color: [0.9, 0.9, 0.9]}
surfaces:
  top: {xyz: [0, 0, 80 cm], size: [40 cm, 50 cm]}
articulations:
  door:
    joint: revolute
    origin: [-20 cm, 25 cm, 40 cm]
    axis: [0, 0, -2]
    upper: 100 deg
    mass: 3 kg
    friction: 2 N m
    parts:
      - {box: [2 cm, 50 cm, 76 cm], xyz: [-21 cm, 0, 40 cm], color: [0.2, 0.3, 0.4]}
      - {cylinder: [6 mm, 20 cm], xyz: [-26 cm, -20 cm, 40 cm]}
    handle:
      kind: bar
      direction: vertical
      xyz: [-26 cm, -20 cm, 40 cm]
      radius: 6 mm
      length: 20 cm
      panel: [-22 cm, 0, 40 cm]
      panel_size: [50 cm, 76 cm]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "piece.yaml"
    path.write_text(text)
    return path


def read(folder: Path, text: str) -> FurnitureModel:
    return read_furniture(written(folder, text))


def problem(folder: Path, text: str) -> str:
    with pytest.raises(ConfigurationError) as error:
        read(folder, text)
    (only,) = error.value.problems
    return str(only).removeprefix(str(folder)).rpartition("piece.yaml")[2]


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_furniture_is_within_its_footprint_but_for_handles_and_knobs(name: str) -> None:
    model = read_furniture(name)
    half = np.array(model.footprint) / 2
    for part in model.parts:
        assert np.all(np.abs(part.pose.position[:2]) <= half + 0.01)  # the knobs of the microwave
    assert all(np.all(np.abs(surface.pose.position[:2]) <= half) for surface in model.surfaces)
    assert len({surface.name for surface in model.surfaces}) == len(model.surfaces) > 0


def test_the_shipped_chest_is_what_its_file_says() -> None:
    chest = read_furniture("drawer_chest")
    assert chest.name == "drawer_chest"
    assert chest.footprint == (0.48, 0.80)
    assert [a.name for a in chest.articulations] == ["drawer_1", "drawer_2", "drawer_3"]
    for drawer in chest.articulations:
        assert (drawer.kind, drawer.friction) == ("prismatic", 15.0)
        assert (drawer.handle.kind, drawer.handle.radius, drawer.handle.length) == ("bar", 0.007, 0.22)


def test_a_seed_decides_what_is_not_given(tmp_path: Path) -> None:
    first, same, other = (
        read(tmp_path, f"seed: {seed}\ngenerate: {{kind: fridge, height: 1.5 m}}\n") for seed in (3, 3, 4)
    )
    assert first.footprint == same.footprint != other.footprint
    assert {round(s.pose.position[2], 9) for piece in (first, other) for s in piece.surfaces if s.name == "top"} == {
        1.5
    }


def test_a_hand_written_door_knows_its_true_handle(tmp_path: Path) -> None:
    (door,) = read(tmp_path, CABINET).articulations
    handle = door.handle
    assert door.axis == (0.0, 0.0, -1.0)
    assert door.upper == pytest.approx(np.radians(100))
    assert door.colors[1] == (0.7, 0.7, 0.7, 1.0)
    assert (handle.hinge_side, handle.joint) == ("left", "revolute")
    np.testing.assert_allclose(handle.axis, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(handle.outward, [-1.0, 0.0, 0.0], atol=1e-12)
    assert handle.standoff == pytest.approx(0.04)
    arm = np.array([-0.06, -0.45])  # from the hinge to the handle
    np.testing.assert_allclose(handle.opening_direction, np.array([arm[1], -arm[0], 0]) / np.hypot(*arm), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("generate: {kind: wardrobe}\n", ":1: generate.kind: unknown kind of furniture 'wardrobe'; "),
        ("generate: {drawers: 3}\n", ":1: generate.kind: is missing"),
        ("generate:\n  kind: shelf\n  boards: 1\n", ":3: generate.boards: should be from 2 to 8, got 1"),
        ("generate:\n  kind: shelf\n  bords: 3\n", ":3: generate.bords: unknown field; did you mean 'boards'?"),
        (
            "generate:\n  kind: shelf\n  width: 3 kg\n",
            ":3: generate.width: expected a length in m (m, cm, mm), got '3 kg'",
        ),
        (
            "generate:\n  kind: drawer_chest\n  width: 50 cm\n  handle:\n    kind: bar\n    length: 60 cm\n",
            ":6: generate.handle.length: should be at most 0.446 m",
        ),
        (
            "generate:\n  kind: fridge\n  handle:\n    kind: hook\n",
            ":4: generate.handle.kind: should be 'bar', 'knob' or 'edge', got 'hook'",
        ),
        ("seed: -1\ngenerate: {kind: shelf}\n", ":1: seed: "),
        ("generate: {kind: shelf}\nparts: []\n", ":2: parts: unknown field"),
        (CABINET.replace("[0, 0, -2]", "[0, 0, 2]"), ":10: articulations.door.axis: the joint opens inwards"),
        (CABINET.replace("[0, 0, -2]", "[0, 0, 0]"), ":10: articulations.door.axis: should not be zero"),
        (CABINET.replace("100 deg", "-1"), ":11: articulations.door.upper: should be more than 0, got -1"),
        (CABINET.replace("3 kg", "0"), ":12: articulations.door.mass: should be greater than 0, got 0"),
        (CABINET.replace("2 N m", "2 kg"), ":13: articulations.door.friction: expected a torque in N m"),
        (CABINET.replace("cylinder", "cone"), ":16: articulations.door.parts[1].cone: unknown field"),
        (
            CABINET.replace("cylinder: [6 mm, 20 cm], ", ""),
            ":16: articulations.door.parts[1]: one of box, cylinder",
        ),
        (
            CABINET.replace("[-20 cm, 25 cm, 40 cm]", "[-26 cm, -20 cm, 40 cm]"),
            ":9: articulations.door.origin: the handle lies on the axis",
        ),
    ],
)
def test_a_fault_is_reported_with_line_field_and_value(tmp_path: Path, text: str, expected: str) -> None:
    assert problem(tmp_path, text).startswith(expected)
