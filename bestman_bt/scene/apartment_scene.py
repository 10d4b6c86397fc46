"""Scenes whose walls and furniture a generator makes: the seed's apartment in the place of what a file would list."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bestman_bt.scene.apartment_generator import generate_apartment
from bestman_bt.scene.scene_config import FurniturePlacement, RegionConfig, WallsConfig

if TYPE_CHECKING:
    from bestman_bt.scene.load import SceneConfig

_MOVED = 0.6  # metres each way


def with_apartment(scene: SceneConfig, seed: int) -> SceneConfig:
    """The scene as if its file had listed the seed's apartment; one without a generator as it is.

    The robot may start anywhere where there is room, unless the file says where. Raises ApartmentError.
    """
    if scene.file.generator is None:
        return scene
    options = scene.file.generator.apartment
    apartment = generate_apartment(options, seed if options.seed is None else options.seed, scene.file.passage)
    rng = np.random.default_rng([seed, 6])
    corners = [room.x + room.y for room in apartment.rooms]
    whole = RegionConfig(
        x=(min(c[0] for c in corners), max(c[1] for c in corners)),
        y=(min(c[2] for c in corners), max(c[3] for c in corners)),
    )
    file = replace(
        scene.file,
        walls=WallsConfig(options.wall_height, options.wall_thickness, apartment.walls),
        furniture={
            piece.name: FurniturePlacement(
                piece.model.name,
                (piece.at.x, piece.at.y, piece.at.theta),
                moved=_MOVED if piece.model.name == "chair" and rng.random() < options.moved_chairs else 0.0,
            )
            for piece in apartment.furniture
        }
        | {
            # built into walls, which are exact
            door.name: FurniturePlacement(
                door.model.name,
                (door.at.x, door.at.y, door.at.theta),
                offset=0.0,
                turn=0.0,
                open=now.open,
                mapped_open=door.open,
            )
            for door, now in zip(apartment.doors, apartment.doors_now, strict=True)
        },
        robot_start=scene.file.robot_start or whole,
    )
    pieces = (*apartment.furniture, *apartment.doors)
    return replace(scene, file=file, furniture={piece.name: piece.model for piece in pieces})
