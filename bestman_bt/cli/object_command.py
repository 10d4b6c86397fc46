"""Examples: bestman-bt object add mug.stl --name my_mug --scale 1mm; bestman-bt object show my_mug --png mug.png."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from bestman_bt.cli.options import Json, Png, grouped_options, json_output, number, wrong_input
from bestman_bt.configuration.data import data_names, find_data, own_objects
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import ObjectModel
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.scene.object_file import SYMMETRY_ORDERS, read_object

if TYPE_CHECKING:
    from bestman_bt.runtime.object_import import NewObject

ROBOT = "diff_panda"
verbs = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Add, list and show objects.",
    epilog=__doc__,
)
Robot = Annotated[str, typer.Option(help="The robot whose gripper grasps are for.")]


@dataclass(frozen=True)
class ObjectOptions:
    """The properties of a new object, as text."""

    name: Annotated[str, typer.Option(help="What scenes call it.")]
    scale: Annotated[str, typer.Option(metavar="LENGTH", help="Metres per unit of the mesh; also '1 mm'.")] = "1"
    up: Annotated[str, typer.Option(metavar="x|y|z", help="The mesh's axis that points up when it stands.")] = "z"
    mass: Annotated[str | None, typer.Option(help="For example '250 g'; default: by its volume.")] = None
    color: Annotated[str | None, typer.Option(metavar="R,G,B", help="0 to 1 each; default: the mesh's own.")] = None
    friction: Annotated[str, typer.Option(help="Lateral coefficient.")] = "0.7"
    symmetry: Annotated[str, typer.Option(help=f"auto, or of: {', '.join(SYMMETRY_ORDERS)}.")] = "auto"
    open_surface: Annotated[bool, typer.Option("--open", help="Take a mesh with holes.")] = False
    library: Annotated[str, typer.Option(metavar="trimesh|open3d", help="What reads and simplifies the mesh.")] = (
        "trimesh"
    )

    def read(self) -> NewObject:
        """Return the properties as values. Raises ConfigurationError if one is invalid."""
        from bestman_bt.runtime.object_import import NewObject

        return NewObject(
            name=self.name,
            scale=number("--scale", self.scale, "length"),
            up=_one_of("--up", self.up, ("x", "y", "z")),
            mass=None if self.mass is None else number("--mass", self.mass, "mass"),
            color=None if self.color is None else _color(self.color),
            friction=number("--friction", self.friction, allow_zero=True),
            symmetry=_one_of("--symmetry", self.symmetry, ("auto", *SYMMETRY_ORDERS)),
            open_surface=self.open_surface,
            library=_one_of("--library", self.library, ("trimesh", "open3d")),
        )


@verbs.command()
@grouped_options
def add(
    mesh: Annotated[Path, typer.Argument(help="A mesh file: STL, OBJ, PLY, GLB, OFF, 3MF …")],
    described: ObjectOptions,
    into: Annotated[Path | None, typer.Option(metavar="DIR", help="Where its files go.")] = None,
    robot: Robot = ROBOT,
    force: Annotated[bool, typer.Option("--force", help="Replace an object of this name.")] = False,
    as_json: Json = False,
) -> None:
    """Create an object from a mesh: convex parts, symmetry, grasps, a picture and its YAML."""
    from bestman_bt.runtime.object_import import import_object

    with json_output(as_json) as write:
        new = described.read()
        gripper_name, gripper = gripper_of(robot)
        made = import_object(mesh, new, gripper, gripper_name, into or own_objects(), force)
        facts = _facts(made.model, made.files["object"]) | why_no_grasps(made.model, robot, gripper)
        facts |= {
            "triangles": made.triangles,
            "watertight": made.watertight,
            "files": {kind: str(path) for kind, path in made.files.items()},
        }
        write(facts)
        if not as_json:
            _print_text(facts)
            for kind, path in made.files.items():
                print(f"  {kind:<10} {path}")


@verbs.command(name="list")
def list_objects(as_json: Json = False) -> None:
    """List the objects that scenes may use."""
    with json_output(as_json) as write:
        facts: list[dict[str, Any]] = []
        broken: dict[str, str] = {}
        for name in data_names("object"):
            try:
                facts.append(_facts(read_object(name), find_data("object", name)))
            except ConfigurationError as error:
                broken[name] = str(error)
        write({"objects": facts} | ({"unavailable": broken} if broken else {}))
        if not as_json:
            for one in facts:
                _print_text(one)
            for name, why in broken.items():
                print(f"{name}: not available: {why}")
            print("random_000 to random_999: the random shapes of pybullet_data")


@verbs.command()
def show(
    name: Annotated[str, typer.Argument(help="An object's name or YAML file.")],
    png: Png = None,
    robot: Robot = ROBOT,
    as_json: Json = False,
) -> None:
    """Show an object's size, mass, shapes and grasps."""
    with json_output(as_json) as write:
        model = read_object(name)
        facts = _facts(model, None)
        if png is not None:
            from PIL import Image

            from bestman_bt.runtime.pictures import object_picture

            gripper = gripper_of(robot)[1] if model.grasps else None
            Image.fromarray(object_picture(model, gripper)).save(png)
            facts["picture"] = str(png)
        write(facts)
        if not as_json:
            _print_text(facts)
            if png is not None:
                print(f"  picture    {png}")


@verbs.command()
def grasps(
    name: Annotated[str, typer.Argument(help="An object's name or YAML file.")],
    robot: Robot = ROBOT,
    as_json: Json = False,
) -> None:
    """Recompute an object's grasps, for example for another gripper, and save them beside its file."""
    from bestman_bt.runtime.object_import import write_grasps

    with json_output(as_json) as write:
        path = find_data("object", name)
        gripper_name, gripper = gripper_of(robot)
        found = write_grasps(path, gripper, gripper_name)
        facts = _facts(found, path) | why_no_grasps(found, robot, gripper)
        write(facts)
        if not as_json:
            _print_text(facts)


def _facts(model: ObjectModel, path: Path | None) -> dict[str, Any]:
    symmetry = next(name for name, order in SYMMETRY_ORDERS.items() if order == model.symmetry_order)
    return {
        "name": model.name,
        "size_m": [round(float(extent), 5) for extent in model.size],
        "mass_kg": model.mass,
        "color": list(model.color),
        "friction": model.friction,
        "symmetry": symmetry,
        "convex_parts": len(model.collision),
        "grasps": len(model.grasps),
    } | ({} if path is None else {"file": str(path)})


def why_no_grasps(model: ObjectModel, robot: str, gripper: GripperModel) -> dict[str, str]:
    """Return the reason why the gripper cannot grasp the object, as an entry of the document; empty if it can."""
    if model.grasps:
        return {}
    narrowest, opening = 1e3 * float(min(model.size)), 1e3 * gripper.max_width
    reason = (
        "no two faces that it can hold face each other"
        if narrowest < opening
        else f"its sides are {narrowest:.0f} mm or more"
    )
    return {"why_no_grasps": f"no grasp was found: the gripper of {robot} opens to {opening:.0f} mm, {reason}"}


def _print_text(facts: dict[str, Any]) -> None:
    size = " × ".join(f"{extent * 1e3:.0f}" for extent in facts["size_m"])
    print(
        f"{facts['name']}: {size} mm, {facts['mass_kg'] * 1e3:.0f} g, symmetry: {facts['symmetry']}, "
        f"convex parts: {facts['convex_parts']}, grasps: {facts['grasps']}"
    )
    if "why_no_grasps" in facts:
        print(f"  {facts['why_no_grasps']}")


def gripper_of(robot: str) -> tuple[str, GripperModel]:
    """Return the name and the model of the robot's gripper."""
    model = load_robot_model(robot)
    for name, gripper in model.of(GripperModel).items():
        return f"{robot}/{name}", gripper
    raise wrong_input("--robot", f"{robot} has no gripper")


def _one_of(option: str, text: str, allowed: tuple[str, ...]) -> Any:
    if text not in allowed:
        raise wrong_input(option, f"should be one of {', '.join(allowed)}, got {text!r}")
    return text


def _color(text: str) -> tuple[float, float, float]:
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError as error:
        raise wrong_input("--color", f"should be three numbers R,G,B, got {text!r}") from error
    if values.shape != (3,) or not ((values >= 0.0) & (values <= 1.0)).all():
        raise wrong_input("--color", f"should be three numbers of 0 to 1, got {text!r}")
    red, green, blue = (float(value) for value in values)
    return (red, green, blue)
