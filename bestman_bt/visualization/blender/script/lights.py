"""Light and floor: a large soft lamp over the scene, a warm one from the side, and the sky of a bright day."""

from __future__ import annotations

import math
from typing import Any

import bpy
from mathutils import Matrix, Vector

FLOOR_SIZE = 30.0
GROUND = -0.02
"""Height of the ground outside, metres."""
SKY = (0.78, 0.86, 1.0)


def light_the_room(finishes: Any, bodies: list[dict[str, Any]]) -> None:
    """Light the scene. ``bodies``: of the scene; the free-standing ones decide the lamps' targets."""
    places = [body["pose"][:2] for body in bodies if body["finish"] == "furniture"]
    middle = Vector((*(sum(axis) / len(places) for axis in zip(*places, strict=True)), 0.0)) if places else Vector()
    lay_floors(finishes, [body["pose"][:2] for body in bodies if body["finish"] == "wall"])
    sky()
    lamp("key", middle + Vector((-2.2, -2.6, 4.2)), middle, 330.0, 2.4, (1.0, 0.95, 0.88))
    lamp("rim", middle + Vector((3.0, 2.8, 3.4)), middle, 220.0, 1.8, (0.85, 0.92, 1.0))


def lay_floors(finishes: Any, walls: list[list[float]]) -> None:
    """Add a plank floor with its top at z = 0 between the walls, and a light ground around it."""
    low, high = [-0.5 * FLOOR_SIZE] * 2, [0.5 * FLOOR_SIZE] * 2
    if walls:
        low, high = ([choose(axis) for axis in zip(*walls, strict=True)] for choose in (min, max))
    middle = [0.5 * (a + b) for a, b in zip(low, high, strict=True)]
    bpy.ops.mesh.primitive_plane_add(size=1.0, location=(*middle, 0.0))
    planks = bpy.context.object
    planks.data.transform(Matrix.Diagonal((*(b - a for a, b in zip(low, high, strict=True)), 1.0, 1.0)))
    planks.data.materials.append(finishes.floor())
    bpy.ops.mesh.primitive_plane_add(size=4.0 * FLOOR_SIZE, location=(*middle, GROUND))
    bpy.context.object.data.materials.append(finishes.ground())


def sky() -> None:
    """Add uniform, slightly blue light from all directions."""
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*SKY, 1.0)
    background.inputs["Strength"].default_value = 0.42


def lamp(name: str, place: Vector, target: Vector, watts: float, size: float, color: tuple[float, ...]) -> None:
    """Add a square area light of edge ``size``, metres, aimed at ``target``."""
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.size, data.color = watts, size, color
    data.spread = math.radians(150.0)
    thing = bpy.data.objects.new(name, data)
    thing.location = place
    thing.rotation_mode = "QUATERNION"
    thing.rotation_quaternion = (target - place).to_track_quat("-Z", "Y")
    bpy.context.scene.collection.objects.link(thing)
