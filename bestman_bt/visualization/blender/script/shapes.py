"""Shapes as Blender meshes, with rounded edges as on real objects."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bmesh
import bpy

SEGMENTS = 64


def made_shape(shape: dict[str, Any], bevel: float) -> Any:
    """Return a box, cylinder, ball or mesh as an object of the scene."""
    mesh = bpy.data.meshes.new(shape["kind"])
    built = bmesh.new()
    match shape["kind"]:
        case "box":
            bmesh.ops.create_cube(built, size=1.0)
            bmesh.ops.scale(built, vec=shape["size"], verts=built.verts)
        case "cylinder":
            radius = shape["radius"]
            bmesh.ops.create_cone(
                built, cap_ends=True, segments=SEGMENTS, radius1=radius, radius2=radius, depth=shape["length"]
            )
        case "sphere":
            bmesh.ops.create_icosphere(built, subdivisions=5, radius=shape["radius"])
        case "mesh":
            mesh.from_pydata(shape["vertices"], [], shape["faces"])
            built.from_mesh(mesh)
            bmesh.ops.remove_doubles(built, verts=built.verts, dist=1e-6)
    built.to_mesh(mesh)
    built.free()
    thing = bpy.data.objects.new(shape["kind"], mesh)
    bpy.context.scene.collection.objects.link(thing)
    mesh.shade_smooth()
    if shape["kind"] == "box":
        round_edges(thing, min(bevel, 0.2 * min(shape["size"])))
    elif shape["kind"] == "cylinder":
        round_edges(thing, min(0.4 * bevel, 0.1 * min(shape["radius"], shape["length"])))
    else:
        sharp_where_bent(mesh)
    return thing


def round_edges(thing: Any, width: float) -> None:
    """Add a bevel of ``width`` that keeps flat faces flat."""
    bevel = thing.modifiers.new("bevel", "BEVEL")
    bevel.width, bevel.segments = width, 3
    bevel.limit_method, bevel.angle_limit = "ANGLE", math.radians(40.0)
    bevel.harden_normals = True


def sharp_where_bent(mesh: Any) -> None:
    """Shade the mesh smooth, except across edges of more than 40 degrees."""
    mesh.set_sharp_from_angle(angle=math.radians(40.0))


def imported_file(shape: dict[str, Any]) -> list[Any]:
    """Return the objects of a mesh file, in its axes, with its materials."""
    before = set(bpy.data.objects)
    path = shape["path"]
    importer = {".obj": bpy.ops.wm.obj_import, ".stl": bpy.ops.wm.stl_import, ".ply": bpy.ops.wm.ply_import}
    importer[Path(path).suffix.lower()](filepath=path, forward_axis="Y", up_axis="Z")
    found = [thing for thing in bpy.data.objects if thing not in before and thing.type == "MESH"]
    for thing in found:
        thing.scale = [own * asked for own, asked in zip(thing.scale, shape["scale"], strict=True)]
        thing.data.shade_smooth()
        sharp_where_bent(thing.data)
    bpy.context.view_layer.update()
    return found
