from __future__ import annotations

import numpy as np
import pytest
import yaml
from PIL import Image

from bestman_bt.messages import OccupancyGrid
from bestman_bt.navigation.map_file import MapFileError, read_map, write_map

GRID = OccupancyGrid(np.array([[0, 100, -1], [0, 0, 100]], dtype=np.int8), 0.05, np.array([-1.5, 2.0]))


def map_with(folder, pixels, **changes):
    """A map file as a user of nav2 may have it."""
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(folder / "room.pgm")
    facts = {"image": "room.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0}
    facts |= {"occupied_thresh": 0.65, "free_thresh": 0.25} | changes
    path = folder / "room.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in facts.items() if value is not None}))
    return path


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_what_is_written_is_read_again(tmp_path, mode):
    path = write_map(GRID, tmp_path / "maps" / "home", mode)
    read = read_map(path)
    assert path.name == "home.yaml"
    assert np.array_equal(read.data, GRID.data)
    assert read.resolution == GRID.resolution
    assert np.array_equal(read.origin, GRID.origin)


@pytest.mark.parametrize("mode", ["scale", "raw"])
def test_shades_of_occupancy_are_kept_to_a_percent_in_scale_and_exactly_in_raw(tmp_path, mode):
    shades = OccupancyGrid(np.array([[-1, 1, 37, 50, 99]], dtype=np.int8), 0.05, np.zeros(2))
    read = read_map(write_map(shades, tmp_path / "home.yaml", mode)).data
    assert read[0, 0] == -1
    assert np.abs(read.astype(int) - shades.data).max() <= (1 if mode == "scale" else 0)


def test_the_image_is_what_nav2_writes_and_its_first_row_is_the_north(tmp_path):
    write_map(GRID, tmp_path / "home.yaml")
    assert (tmp_path / "home.pgm").read_bytes().startswith(b"P5\n")
    assert np.asarray(Image.open(tmp_path / "home.pgm")).tolist() == [[254, 254, 0], [254, 0, 205]]


def test_thresholds_divide_the_shades_as_in_nav2(tmp_path):
    # Black by (255 - x) / 255: 0.0, 0.24, 0.26, 0.64, 0.66, 1.0.
    path = map_with(tmp_path, [[255, 194, 189, 92, 87, 0]])
    assert read_map(path).data.tolist() == [[0, 0, -1, -1, 100, 100]]


def test_scale_spreads_the_shades_between_the_thresholds(tmp_path):
    path = map_with(tmp_path, [[255, 140, 0]], mode="scale")
    assert read_map(path).data.tolist() == [[0, 50, 100]]


def test_negate_takes_white_for_occupied(tmp_path):
    assert read_map(map_with(tmp_path, [[255, 0]], negate=1)).data.tolist() == [[100, 0]]


def test_a_plain_map_of_an_older_ros_is_read(tmp_path):
    (tmp_path / "old.pgm").write_text("P2\n# CREATOR: map_generator.cpp 0.050 m/pix\n3 1\n255\n254 205 0\n")
    (tmp_path / "old.yaml").write_text(
        "image: old.pgm\nresolution: 0.050000\norigin: [-1.0, -2.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    grid = read_map(tmp_path / "old.yaml")
    assert grid.data.tolist() == [[0, -1, 100]]
    assert grid.origin.tolist() == [-1.0, -2.0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"resolution": 0}, "resolution: got 0.0, expected metres per pixel"),
        ({"resolution": "fine"}, "resolution: got 'fine', expected a finite number"),
        ({"resolution": None}, "resolution: got None"),
        ({"origin": [0.0]}, r"origin: got \[0.0\], expected"),
        ({"origin": [0.0, 0.0, 0.3]}, "expected a yaw of 0"),
        ({"origin": [0.0, float("nan"), 0.0]}, "origin: got"),
        ({"mode": "ternary"}, "mode: got 'ternary', expected one of trinary, scale, raw"),
        ({"negate": 2}, "negate: got 2"),
        ({"free_thresh": 0.7}, "free_thresh: got 0.7, expected 0 to 1 and less than occupied_thresh"),
        ({"image": "other.pgm"}, "image: got 'other.pgm', expected an image file; there is no"),
        ({"image": None}, "image: got None"),
    ],
)
def test_a_wrong_field_is_named_with_what_would_be_right(tmp_path, changes, words):
    with pytest.raises(MapFileError, match=words):
        read_map(map_with(tmp_path, [[254, 0]], **changes))


def test_corrupt_files_are_told_and_not_guessed_at(tmp_path):
    path = map_with(tmp_path, np.full((40, 40), 254))
    whole = (tmp_path / "room.pgm").read_bytes()
    (tmp_path / "room.pgm").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MapFileError, match=r"room\.pgm is no image that can be read, or is cut off"):
        read_map(path)
    path.write_text("image: [room.pgm\n")
    with pytest.raises(MapFileError, match="cannot be read as a map's YAML"):
        read_map(path)
    path.write_text("just words")
    with pytest.raises(MapFileError, match="should hold image, resolution and origin, got str"):
        read_map(path)
    with pytest.raises(MapFileError, match="there is no such file"):
        read_map(tmp_path / "nowhere.yaml")


def test_an_empty_map_and_a_folder_that_cannot_be_made_are_refused(tmp_path):
    with pytest.raises(MapFileError, match="the map is empty"):
        write_map(OccupancyGrid(np.zeros((0, 0), dtype=np.int8), 0.05, np.zeros(2)), tmp_path / "home.yaml")
    (tmp_path / "file").write_text("")
    with pytest.raises(MapFileError, match="cannot be written"):
        write_map(GRID, tmp_path / "file" / "home.yaml")
