"""Light and floor: a large soft lamp over the scene, a warm one from the side, and the sky of a bright day."""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Vector

FLOOR_SIZE = 30.0
SKY = (0.78, 0.86, 1.0)


def light_the_room(finishes: Any, places: list[list[float]]) -> None:
    """``places``: where furniture stands, metres."""
    middle = Vector((*(sum(axis) / len(places) for axis in zip(*places, strict=True)), 0.0)) if places else Vector()
    lay_floor(finishes.floor())
    sky()
    lamp("key", middle + Vector((-2.2, -2.6, 4.2)), middle, 330.0, 2.4, (1.0, 0.95, 0.88))
    lamp("rim", middle + Vector((3.0, 2.8, 3.4)), middle, 220.0, 1.8, (0.85, 0.92, 1.0))


def lay_floor(material: Any) -> None:
    """A floor whose top is z = 0."""
    bpy.ops.mesh.primitive_plane_add(size=FLOOR_SIZE)
    bpy.context.object.data.materials.append(material)


def sky() -> None:
    """Even light from all around, a little blue."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*SKY, 1.0)
    background.inputs["Strength"].default_value = 0.42


def lamp(name: str, place: Vector, target: Vector, watts: float, size: float, color: tuple[float, ...]) -> None:
    """An area light that looks at a place."""
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.size, data.color = watts, size, color
    data.spread = math.radians(150.0)
    thing = bpy.data.objects.new(name, data)
    thing.location = place
    thing.rotation_mode = "QUATERNION"
    thing.rotation_quaternion = (target - place).to_track_quat("-Z", "Y")
    bpy.context.scene.collection.objects.link(thing)
