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
        ({"resolution": 0}, r"room\.yaml:9: resolution: should be greater than or equal to 0.0001, got 0"),
        ({"resolution": "fine"}, "resolution: expected a number, got 'fine'"),
        ({"resolution": 10**400}, "resolution: expected a number below 1e308, got one of 401 digits"),
        ({"resolution": None}, "resolution: is missing"),
        ({"resolutoin": 3}, "resolutoin: unknown field; did you mean 'resolution'?"),
        ({"origin": [0.0]}, r"origin: should be \[x, y, yaw\] in metres and radians, got \[0.0\]"),
        ({"origin": [0.0, 0.0, 0.3]}, "should have a yaw of 0"),
        ({"origin": [0.0, 0.0, -0.3]}, "should have a yaw of 0"),
        ({"origin": [0.0, float("nan"), 0.0]}, r"origin\[1\]: expected a finite number, got nan"),
        ({"origin": [1e308, 0.0]}, r"origin\[0\]: should be less than or equal to 10000000"),
        ({"mode": "ternary"}, "mode: should be 'trinary', 'scale' or 'raw', got 'ternary'"),
        ({"negate": 2}, "negate: should be 0, 1, False or True, got 2"),
        ({"free_thresh": 0.7}, "free_thresh: should be less than occupied_thresh, 0.65, got 0.7"),
        ({"free_thresh": None, "occupied_thresh": 0.1}, "occupied_thresh: should be more than free_thresh, 0.196, got"),
        ({"occupied_thresh": 3}, "occupied_thresh: should be less than or equal to 1, got 3"),
        ({"image": "other.pgm"}, "image: should be an image file, got 'other.pgm'; there is no"),
        ({"image": None}, "image: is missing"),
    ],
)
def test_a_wrong_field_is_named_with_what_would_be_right(tmp_path, changes, words):
    with pytest.raises(MapFileError, match=words):
        read_map(map_with(tmp_path, [[254, 0]], **changes))


def test_all_that_is_wrong_is_reported_at_once_with_its_lines(tmp_path):
    path = tmp_path / "room.yaml"
    path.write_text("image: room.pgm\nresolution: 5 cm\norigin: [0, 0, 0]\norigin: [0, 0, 0]\n")
    with pytest.raises(MapFileError, match=r"room\.yaml:4: origin: is given twice"):
        read_map(path)
    path.write_text("image: room.pgm\nresolution: 5 cm\norigin: [0]\n")
    with pytest.raises(MapFileError, match=r"(?s)room\.yaml:2: resolution: .*room\.yaml:3: origin: "):
        read_map(path)
    path.write_text("a: " + "[" * 1000)
    with pytest.raises(MapFileError, match="nested too deeply|is not YAML"):
        read_map(path)


def test_numbers_are_read_as_nav2_writes_them(tmp_path):
    path = map_with(tmp_path, [[254, 0]])
    path.write_text("image: room.pgm\nresolution: 5e-2\norigin: [-1e-05, 2.5e+00, 0]\n")
    grid = read_map(path)
    assert grid.resolution == 0.05
    assert grid.origin.tolist() == [-1e-05, 2.5]


@pytest.mark.parametrize("largest", [256, 65535])
def test_shades_of_more_than_8_bits_are_refused(tmp_path, largest):
    path = map_with(tmp_path, [[254, 0]])
    (tmp_path / "room.pgm").write_bytes(b"P5 2 1 %d\n" % largest + b"\x00\xff\x00\x00")
    with pytest.raises(MapFileError, match=r"image: should have shades of 8 bits, .*room\.pgm has more"):
        read_map(path)


@pytest.mark.parametrize(("width", "words"), [(9000, "has 9000 × 9000 pixels; up to 64,000,000"), (10**5, "too large")])
def test_an_image_larger_than_any_map_is_refused_before_it_is_read(tmp_path, width, words):
    path = map_with(tmp_path, [[254, 0]])
    (tmp_path / "room.pgm").write_bytes(b"P5 %d %d 255\n" % (width, width))
    with pytest.raises(MapFileError, match=words):
        read_map(path)


def test_a_colour_is_as_dark_as_the_mean_of_its_channels(tmp_path):
    path = map_with(tmp_path, [[0]], image="room.png", mode="raw")
    Image.fromarray(np.array([[[10, 20, 31], [10, 20, 32], [255, 255, 255]]], dtype=np.uint8)).save(
        tmp_path / "room.png"
    )
    assert read_map(path).data.tolist() == [[20, 21, -1]]


def test_corrupt_files_are_reported_and_not_guessed_at(tmp_path):
    path = map_with(tmp_path, np.full((40, 40), 254))
    whole = (tmp_path / "room.pgm").read_bytes()
    (tmp_path / "room.pgm").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MapFileError, match=r"room\.pgm is not a readable image, or is truncated"):
        read_map(path)
    path.write_text("image: [room.pgm\n")
    with pytest.raises(MapFileError, match=r"room\.yaml:2: is not YAML"):
        read_map(path)
    path.write_text("just words")
    with pytest.raises(MapFileError, match="should hold fields \\(name: value\\), got str"):
        read_map(path)
    with pytest.raises(MapFileError, match="there is no such file"):
        read_map(tmp_path / "nowhere.yaml")


def test_an_empty_map_and_a_folder_that_cannot_be_made_are_refused(tmp_path):
    with pytest.raises(MapFileError, match="the map is empty"):
        write_map(OccupancyGrid(np.zeros((0, 0), dtype=np.int8), 0.05, np.zeros(2)), tmp_path / "home.yaml")
    (tmp_path / "file").write_text("")
    with pytest.raises(MapFileError, match="cannot be written"):
        write_map(GRID, tmp_path / "file" / "home.yaml")


def test_shades_between_the_thresholds_are_unknown_in_a_trinary_image_and_so_is_what_is_no_occupancy(tmp_path):
    shades = OccupancyGrid(np.array([[-1, 0, 19, 20, 65, 66, 100]], dtype=np.int8), 0.05, np.zeros(2))
    assert read_map(write_map(shades, tmp_path / "home.yaml")).data.tolist() == [[-1, 0, 0, -1, -1, 100, 100]]
    assert read_map(write_map(shades, tmp_path / "raw.yaml", "raw")).data.tolist() == shades.data.tolist()


def test_in_scale_what_is_not_opaque_is_unknown_and_in_trinary_its_shade_counts(tmp_path):
    for mode, values in (("scale", [[-1, -1, 0]]), ("trinary", [[100, 100, 0]])):
        path = map_with(tmp_path, [[0]], image="room.png", mode=mode)
        pixels = np.array([[[0, 0], [0, 254], [255, 255]]], dtype=np.uint8)
        Image.fromarray(pixels, mode="LA").save(tmp_path / "room.png")
        assert read_map(path).data.tolist() == values
