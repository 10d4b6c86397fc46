"""The scenes of the long tasks: every seed gives a world, and things lie where the scene says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from bestman_bt.messages import ObjectModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.placing import planar_radius
from bestman_bt.scene.plane_geometry import polygons_overlap, rectangle
from bestman_bt.scene.scene_config import SceneConfig

SCENES = (
    "chest_room",
    "cup_in_drawer",
    "cup_in_fridge",
    "fridge_room",
    "microwave_room",
    "pick_place_table",
    "put_away",
    "set_table",
    "untidy_table",
)
SEEDS = range(20)


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("name", SCENES)
def test_twenty_seeds_give_worlds_whose_things_lie_on_their_surfaces(name: str) -> None:
    scene = load_scene(name)
    starts = set()
    for seed in SEEDS:
        world = draw_world(scene, seed)
        starts.add(world.robot_start.x)
        assert set(world.goals) == set(scene.file.goals)
        pieces = {piece.name: piece for piece in world.furniture}
        outlines = [rectangle(p.actual, p.model.footprint) for p in world.furniture if p.on is None]
        assert not any(polygons_overlap(a, b) for i, a in enumerate(outlines) for b in outlines[:i])
        for thing in world.objects:
            piece, surface = scene.surface(scene.file.objects[thing.name].surface)
            local = (pieces[piece].pose @ surface.pose).inverse().apply(thing.pose.position[None])[0]
            assert np.all(np.abs(local[:2]) <= np.array(surface.size) / 2 - planar_radius(thing.model) + 1e-9)
            assert local[2] == pytest.approx(-float(thing.model.bounds()[0, 2]))
    assert len(starts) == len(SEEDS)


@pytest.mark.parametrize("name", ["cup_in_drawer", "cup_in_fridge"])
def test_what_is_in_a_drawer_or_fridge_fits_below_what_is_above_it(name: str) -> None:
    scene = load_scene(name)
    (cup,) = draw_world(scene, 0).objects
    piece, surface = scene.surface(scene.file.objects["cup"].surface)
    above = [s.pose.position[2] - surface.pose.position[2] for s in scene.furniture[piece].all_surfaces]
    assert float(cup.model.size[2]) + 0.05 < min(rise for rise in above if rise > 0.0)


def test_a_goal_in_a_drawer_is_that_of_the_closed_drawer() -> None:
    scene = load_scene("put_away")
    for seed in SEEDS:
        world = draw_world(scene, seed)
        chest = next(piece for piece in world.furniture if piece.name == "drawer_chest")
        goal = chest.pose.inverse().apply(world.goals["place"].position[None])[0]
        assert np.all(np.abs(goal[:2]) < np.array(chest.model.footprint) / 2)
        drawer = next(s for s in chest.model.all_surfaces if s.name == "drawer_3")
        assert goal[2] == pytest.approx(drawer.pose.position[2] + 0.05, abs=1e-6)


def test_the_rim_of_the_plate_is_30_mm_high_and_at_most_6_mm_thick() -> None:
    plate = read_object("plate")
    assert plate.size[2] == pytest.approx(0.030)
    vertices = np.vstack([part.pose.apply(part.shape.vertices) for part in plate.collision])
    radii, heights = np.hypot(vertices[:, 0], vertices[:, 1]), vertices[:, 2] + 0.015
    assert heights.max() == pytest.approx(0.030, abs=1e-6)
    rim = radii[heights > 0.029]
    assert rim.max() - rim.min() <= 0.006
    for height in (0.012, 0.020, 0.028):
        assert thickness_at(plate, height - 0.015) <= 0.006


def thickness_at(plate: ObjectModel, z: float) -> float:
    """How thick the rim is along a radius, metres: of the convex parts, with which physics works."""
    angle = 0.1
    samples = np.linspace(0.060, 0.100, 801)
    points = np.column_stack([samples * np.cos(angle), samples * np.sin(angle), np.full(801, z)])
    solid = np.zeros(len(points), dtype=bool)
    for part in plate.collision:
        faces = ConvexHull(part.pose.apply(part.shape.vertices)).equations
        solid |= np.all(points @ faces[:, :3].T + faces[:, 3] <= 1e-9, axis=1)
    thickness = float(solid.sum()) * float(samples[1] - samples[0])
    assert thickness > 0.003
    return thickness


def test_objects_in_an_open_drawer_have_moved_with_it_and_the_map_does_not_show_it() -> None:
    closed = draw_world(load_scene("cup_in_drawer"), 3)
    pulled = draw_world(load_scene("cup_in_drawer", {"furniture.drawer_chest.open": {"drawer_3": "20 cm"}}), 3)
    way = pulled.objects[0].pose.position - closed.objects[0].pose.position
    (chest,) = (piece for piece in pulled.furniture if piece.name == "drawer_chest")
    np.testing.assert_allclose(way, chest.pose.rotation @ [-0.2, 0.0, 0.0], atol=1e-9)
    in_maps = [semantic_map(world).furniture["drawer_chest"].articulations for world in (closed, pulled)]
    for before, after in zip(*in_maps, strict=True):
        assert [shape.pose.position.tolist() for shape in before.shapes] == [
            shape.pose.position.tolist() for shape in after.shapes
        ]


def test_the_robot_does_not_start_where_an_open_door_stands() -> None:
    scene = load_scene("fridge_room", {"furniture.fridge.open": {"lower_door": "85 deg"}, "robot_start.x": [0.0, 0.7]})
    closed = load_scene("fridge_room", {"robot_start.x": [0.0, 0.7]})

    def nearest(scene: SceneConfig, seed: int) -> float:
        """Metres from the start to the middle of the door that stands open."""
        world = draw_world(scene, seed)
        (fridge,) = world.furniture
        (door,) = (door for door in fridge.model.articulations if door.name == "lower_door")
        middle = (fridge.pose @ door.moved(np.radians(85)) @ door.parts[0].pose).position[:2]
        return float(np.linalg.norm(middle - world.robot_start.xy))

    assert min(nearest(scene, seed) for seed in SEEDS) > scene.file.start_clearance
    assert min(nearest(closed, seed) for seed in SEEDS) < scene.file.start_clearance
