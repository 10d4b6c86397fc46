"""Materials: paint, wood, plaster, plastic and metal, from a colour and a kind."""

from __future__ import annotations

import colorsys
from typing import Any

import bpy

FLOOR_WOOD = ((0.36, 0.225, 0.13), (0.28, 0.165, 0.092))
"""Linear colours of the floor's planks."""


class Finishes:
    """Creates materials, each only once."""

    def __init__(self) -> None:
        self._made: dict[tuple[Any, ...], Any] = {}

    def of_body(self, finish: str, color: list[float], shape: dict[str, Any]) -> Any:
        """Return the finish of a part of the scene."""
        if finish == "wall":
            return self._once(("wall",), plaster)
        if finish == "furniture" and is_wooden(color):
            along = longest_axis(shape)
            return self._once(("wood", *color, along), lambda: wood(linear(color), along))
        roughness, coat = {"furniture": (0.42, 0.15), "object": (0.28, 0.5)}.get(finish, (0.75, 0.0))
        return self._once((finish, *color), lambda: paint(finish, color, roughness, coat))

    def of_robot(self, color: list[float]) -> Any:
        """Return the material of a robot part: rubber for dark colours, metal for grey ones, else paint."""
        _, saturation, value = colorsys.rgb_to_hsv(*color[:3])
        if value < 0.2:
            return self._once(("rubber", *color), lambda: paint("rubber", color, 0.6, 0.0))
        if saturation < 0.12 and 0.5 < value < 0.8:
            return self._once(("metal", *color), lambda: paint("metal", color, 0.34, 0.0, metallic=0.85))
        return self._once(("shell", *color), lambda: paint("shell", color, 0.36, 0.35))

    def of_mesh_file(self, thing: Any, color: list[float] | None) -> None:
        """Keep the materials of the mesh file, unless the robot's description sets a colour."""
        is_white = color is not None and min(color[:3]) > 0.98
        own = [slot.material for slot in thing.material_slots if slot.material is not None]
        if own and (color is None or is_white):
            for material in own:
                polish(material)
            return
        thing.data.materials.clear()
        thing.data.materials.append(self.of_robot(color or [0.75, 0.76, 0.78, 1.0]))

    def floor(self) -> Any:
        """Return the material of the floor: oak planks."""
        return self._once(("floor",), planks)

    def ground(self) -> Any:
        """Return the ground outside: bright, without features."""
        return self._once(("ground",), lambda: paint("ground", [0.82, 0.83, 0.84, 1.0], 0.9, 0.0))

    def _once(self, key: tuple[Any, ...], make: Any) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]


def linear(color: list[float]) -> tuple[float, float, float]:
    """Return an sRGB colour in linear light."""
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color[:3])
    return r, g, b


def is_wooden(color: list[float]) -> bool:
    """Return whether a colour is a brown or beige of wooden furniture."""
    hue, saturation, value = colorsys.rgb_to_hsv(*color[:3])
    return 0.04 < hue < 0.15 and 0.18 < saturation < 0.75 and value > 0.25


def longest_axis(shape: dict[str, Any]) -> int:
    """Return the longest axis of a shape, along which the wood grain runs: 0, 1 or 2."""
    size = shape.get("size", (0.0, 0.0, 1.0))
    return max(range(3), key=lambda axis: size[axis])


def shader(name: str) -> tuple[Any, Any, Any]:
    """Return a new material, its nodes and its principled shader."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    if tree is None:
        material.use_nodes = True
        tree = material.node_tree
    return material, tree, tree.nodes["Principled BSDF"]


def paint(name: str, color: list[float], roughness: float, coat: float, metallic: float = 0.0) -> Any:
    """Return a plain surface; a transparent colour gives glass."""
    material, _, surface = shader(name)
    surface.inputs["Base Color"].default_value = (*linear(color), 1.0)
    surface.inputs["Roughness"].default_value = roughness
    surface.inputs["Metallic"].default_value = metallic
    surface.inputs["Coat Weight"].default_value = coat
    surface.inputs["Coat Roughness"].default_value = 0.12
    if len(color) > 3 and color[3] < 0.99:
        surface.inputs["Transmission Weight"].default_value = 1.0 - color[3]
        surface.inputs["Roughness"].default_value = 0.05
    return material


def polish(material: Any) -> None:
    """Give the material of a mesh file the gloss of a robot's shell."""
    surface = material.node_tree.nodes.get("Principled BSDF") if material.node_tree is not None else None
    if surface is not None:
        surface.inputs["Roughness"].default_value = 0.36
        surface.inputs["Coat Weight"].default_value = 0.3
        surface.inputs["Coat Roughness"].default_value = 0.15


def plaster() -> Any:
    """Return a white wall with a fine grain."""
    material, tree, surface = shader("plaster")
    surface.inputs["Base Color"].default_value = (0.80, 0.785, 0.75, 1.0)
    surface.inputs["Roughness"].default_value = 0.9
    noise, bump = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeBump")
    noise.inputs["Scale"].default_value = 90.0
    bump.inputs["Strength"].default_value = 0.06
    bump.inputs["Distance"].default_value = 0.002
    place = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(place.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Fac"], bump.inputs["Height"])
    tree.links.new(bump.outputs["Normal"], surface.inputs["Normal"])
    return material


def wood(color: tuple[float, float, float], along: int) -> Any:
    """Return a grain along an axis: noise that is stretched, between the colour and a darker one."""
    material, tree, surface = shader("wood")
    surface.inputs["Roughness"].default_value = 0.45
    surface.inputs["Coat Weight"].default_value = 0.12
    place, stretch = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    scale = [14.0, 14.0, 14.0]
    scale[along] = 0.8
    stretch.inputs["Scale"].default_value = scale
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    noise.inputs["Scale"].default_value = 3.0
    noise.inputs["Detail"].default_value = 6.0
    noise.inputs["Distortion"].default_value = 0.8
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.35, 0.65
    ramp.color_ramp.elements[0].color = (*(0.78 * c for c in color), 1.0)
    ramp.color_ramp.elements[1].color = (*(min(1.0, 1.08 * c) for c in color), 1.0)
    tree.links.new(place.outputs["Object"], stretch.inputs["Vector"])
    tree.links.new(stretch.outputs["Vector"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], surface.inputs["Base Color"])
    return material


def planks() -> Any:
    """Return boards of 12 cm in a bond, each in a different tone."""
    material, tree, surface = shader("planks")
    surface.inputs["Roughness"].default_value = 0.5
    place, bricks = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexBrick")
    bricks.inputs["Scale"].default_value = 1.0
    bricks.inputs["Brick Width"].default_value = 1.2
    bricks.inputs["Row Height"].default_value = 0.12
    bricks.inputs["Mortar Size"].default_value = 0.0012
    bricks.inputs["Color1"].default_value = (*FLOOR_WOOD[0], 1.0)
    bricks.inputs["Color2"].default_value = (*FLOOR_WOOD[1], 1.0)
    bricks.inputs["Mortar"].default_value = (0.12, 0.075, 0.045, 1.0)
    bricks.offset = 0.37
    stretch, noise = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexNoise")
    stretch.inputs["Scale"].default_value = (1.2, 26.0, 1.0)
    noise.inputs["Scale"].default_value = 2.5
    noise.inputs["Detail"].default_value = 5.0
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "OVERLAY"
    mix.inputs[0].default_value = 0.35
    tree.links.new(place.outputs["Object"], bricks.inputs["Vector"])
    tree.links.new(place.outputs["Object"], stretch.inputs["Vector"])
    tree.links.new(stretch.outputs["Vector"], noise.inputs["Vector"])
    first, second = (socket for socket in mix.inputs if socket.type == "RGBA")  # its sockets share their names
    result = next(socket for socket in mix.outputs if socket.type == "RGBA")
    tree.links.new(bricks.outputs["Color"], first)
    tree.links.new(noise.outputs["Color"], second)
    tree.links.new(result, surface.inputs["Base Color"])
    return material
