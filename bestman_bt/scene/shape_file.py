"""The shapes in furniture and object files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from bestman_bt.configuration.checked import numbered
from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError, ProblemCollector
from bestman_bt.configuration.quantity import (
    Angle,
    Angles3,
    Color,
    Distance,
    Length,
    Lengths3,
    PositiveLength,
    Size2,
    Size3,
)
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Shape, Sphere
from bestman_bt.scene.generated_shapes import bent_bar, revolved_mesh, revolved_parts, tube_mesh
from bestman_bt.scene.mesh_file import MeshConfig, MeshError, read_convex_parts, read_mesh


@dataclass(frozen=True)
class TubeConfig:
    """A straight vessel, open at the top: outer radius, height, thickness of wall and bottom."""

    radius: PositiveLength
    length: PositiveLength
    wall: PositiveLength
    bottom: PositiveLength


@dataclass(frozen=True)
class RevolveConfig:
    """A body of revolution about z.

    ``profile``: (radius, z) from the bottom on the axis up along the outside and, for a vessel, down along the inside,
    back to the axis.
    """

    profile: tuple[tuple[Distance, Length], ...]


@dataclass(frozen=True)
class ArcConfig:
    """A round bar of radius ``bar``, bent along an arc in the xz plane, from ``start`` (0 is x, 90 deg is z) on."""

    radius: PositiveLength
    bar: PositiveLength
    start: Angle
    sweep: Angle


@dataclass(frozen=True)
class ShapeConfig:
    """One of ``box`` (extents), ``cylinder`` (radius, length, along z), ``sphere`` (radius), ``tube``, ``revolve``,
    ``arc`` and ``mesh``.

    It is placed at ``xyz`` and rotated by ``rpy``; all but meshes and profiles are centred there.
    """

    box: Size3 | None = None
    cylinder: Size2 | None = None
    sphere: PositiveLength | None = None
    tube: TubeConfig | None = None
    revolve: RevolveConfig | None = None
    arc: ArcConfig | None = None
    mesh: MeshConfig | None = None
    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)
    color: Color | None = None


_KINDS = ("box", "cylinder", "sphere", "tube", "revolve", "arc", "mesh")


def placed_shapes(
    configs: tuple[ShapeConfig, ...], document: Document, field: str, folder: Path | None = None
) -> tuple[PlacedShape, ...]:
    """Return the visible shapes of a list in a file, one per entry. Raises ConfigurationError listing every fault.

    ``folder``: for relative mesh paths.
    """
    shapes = _each(configs, document, field, folder, _seen)
    return tuple(placed for (placed,) in shapes)


def convex_shapes(
    configs: tuple[ShapeConfig, ...], document: Document, field: str, folder: Path | None = None
) -> tuple[PlacedShape, ...]:
    """Return the convex parts that the shapes of a list consist of, for physics; raises ConfigurationError."""
    return tuple(placed for parts in _each(configs, document, field, folder, _convex) for placed in parts)


def _each(
    configs: tuple[ShapeConfig, ...],
    document: Document,
    field: str,
    folder: Path | None,
    shapes_of: Callable[[ShapeConfig, Path], tuple[Shape, ...]],
) -> list[tuple[PlacedShape, ...]]:
    made, faults = [], ProblemCollector()
    for index, config in numbered(configs):
        with faults.step():
            written = _written(document, field, index)
            given = [kind for kind in _KINDS if written.get(kind) is not None]
            if not given and not written.keys() <= {one.name for one in fields(ShapeConfig)}:
                continue  # a kind that there is not, which is told
            if len(given) != 1:
                message = f"one of {', '.join(_KINDS[:-1])} and {_KINDS[-1]} should be given, got "
                raise ConfigurationError([document.problem((field, index), message + (", ".join(given) or "none"))])
            if getattr(config, given[0]) is None:
                continue  # it could not be read
            fault = _fault(config)
            if fault is not None:
                raise ConfigurationError([document.problem((field, index, given[0]), fault)])
            pose = Pose.from_xyz_rpy(config.xyz, config.rpy)
            try:
                made.append(tuple(PlacedShape(shape, pose) for shape in shapes_of(config, folder or Path())))
            except MeshError as error:
                raise ConfigurationError([document.problem((field, index, "mesh", "file"), str(error))]) from error
    faults.raise_if_any()
    return made


def _written(document: Document, field: str, index: int) -> dict[str, Any]:
    """Return the entry of a list in a file, or the value that is written there instead of a list of one entry."""
    written = document.data[field]
    entry: dict[str, Any] = written[index] if isinstance(written, list) else written
    return entry


def _fault(config: ShapeConfig) -> str | None:
    if config.tube is not None and (config.tube.wall >= config.tube.radius or config.tube.bottom >= config.tube.length):
        return "the wall should be thinner than the radius, and the bottom than the length"
    if config.arc is not None and not (config.arc.bar < config.arc.radius and 0.0 < abs(config.arc.sweep) < 6.2):
        return "the bar should be thinner than the arc's radius, and the sweep between 0 and 355 deg"
    if config.revolve is not None:
        profile = config.revolve.profile
        if len(profile) < 4 or profile[0][0] or profile[-1][0] or not all(radius for radius, _ in profile[1:-1]):
            return "a profile has four points or more, of which the first and the last, and no others, have radius 0"
        pairs = zip(profile, [*profile[1:], profile[0]], strict=True)
        if sum(r0 * z1 - r1 * z0 for (r0, z0), (r1, z1) in pairs) <= 0.0:
            return "a profile goes from the bottom up along the outside; this one goes the other way round"
    return None


def _seen(config: ShapeConfig, folder: Path) -> tuple[Shape, ...]:
    if config.tube is not None:
        tube = config.tube
        return (tube_mesh(tube.radius, tube.length, tube.wall, tube.bottom),)
    if config.revolve is not None:
        return (revolved_mesh(config.revolve.profile),)
    if config.arc is not None:
        arc = config.arc
        return (bent_bar(arc.radius, arc.bar, arc.start, arc.sweep)[0],)
    if config.mesh is not None:
        return (read_mesh(config.mesh, folder),)
    return _convex(config, folder)


def _convex(config: ShapeConfig, folder: Path) -> tuple[Shape, ...]:
    if config.box is not None:
        return (Box(config.box),)
    if config.cylinder is not None:
        return (Cylinder(*config.cylinder),)
    if config.sphere is not None:
        return (Sphere(config.sphere),)
    if config.tube is not None:
        outer, half = config.tube.radius, config.tube.length / 2
        inner, floor = outer - config.tube.wall, config.tube.bottom - half
        return revolved_parts(
            [(0.0, -half), (outer, -half), (outer, half), (inner, half), (inner, floor), (0.0, floor)]
        )
    if config.revolve is not None:
        return revolved_parts(config.revolve.profile)
    if config.arc is not None:
        return bent_bar(config.arc.radius, config.arc.bar, config.arc.start, config.arc.sweep)[1]
    assert config.mesh is not None
    return read_convex_parts(config.mesh, folder)
