"""Examples: bestman-bt look --scene kitchen --seed 3 --save out/; bestman-bt look --at table --views 3."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from PIL import Image

from bestman_bt.cli.options import Json, Robot, Scene, Seed, Settings, grouped_options, json_output
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunRequest
from bestman_bt.extras import is_installed, require_extra
from bestman_bt.perception.clouds import write_cloud
from bestman_bt.registry import suggestion
from bestman_bt.runtime.perception_preview import LookResult, furniture_to_look_at, look_at, run_in_front_of, unseen
from bestman_bt.runtime.resolved_config import ResolvedConfig, prepare
from bestman_bt.scene.draw import SceneError
from bestman_bt.visualization.annotated_image import annotated_image
from bestman_bt.visualization.rerun.look import RecordedLook, write_look
from bestman_bt.world_model.semantic_map import MapFurniture


@dataclass(frozen=True)
class WhereToLook:
    """The scene and the robot."""

    scene: Scene = None
    robot: Robot = None
    seed: Seed = 0
    settings: Settings = None


@grouped_options
def command(
    where: WhereToLook = WhereToLook(),
    at: Annotated[
        list[str] | None, typer.Option("--at", metavar="FURNITURE", help="What to look at; all furniture by default.")
    ] = None,
    views: Annotated[int, typer.Option(min=1, max=9, help="Views of each surface.")] = 1,
    save: Annotated[Path, typer.Option(metavar="DIR", help="Where pictures and recordings go.")] = Path("looks"),
    clouds: Annotated[
        bool, typer.Option("--clouds", help="Write the points of each view, too, as .ply files.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Place the robot in front of furniture and show its perception: objects, poses, handles, grasps."""
    scene = where.scene or "kitchen"
    asked = RunRequest(scene=scene, robot=where.robot or "diff_panda", seed=where.seed, settings=where.settings)
    if clouds:
        require_extra("--clouds", "open3d")
    with json_output(as_json) as print_json:
        known = furniture_to_look_at(asked)
        stands = _stands(known, at or [], asked)
        _make_folder(save)
        found = []
        for name, stand in stands.items():
            look = (
                look_at(known[name], stand, views)
                if isinstance(stand, ResolvedConfig)
                else unseen(name, "no_room", stand)
            )
            files = _save(look, save, clouds) if look.views else []
            found.append(_document(look, files))
            if not as_json:
                _print(look, files)
        print_json({"scene": scene, "seed": where.seed, "looks": found})


def _stands(
    known: Mapping[str, MapFurniture], at: Sequence[str], asked: RunRequest
) -> dict[str, ResolvedConfig | SceneError]:
    """Return the robot before each piece, everything checked; a SceneError in its place if there is no room
    in front of the piece.
    """
    problems = [
        Problem("--at", None, "", f"the map has no furniture {name!r}; {suggestion(name, list(known))}")
        for name in at
        if name not in known
    ]
    if problems:
        raise ConfigurationError(problems)
    stands: dict[str, ResolvedConfig | SceneError] = {}
    for name in at or known:
        try:
            stands[name] = prepare(run_in_front_of(known[name], asked))
        except SceneError as error:
            if at:
                raise
            stands[name] = error
    return stands


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{path} cannot be created as a folder: {error.strerror or error}"
        raise ConfigurationError([Problem("--save", None, "", message)]) from error


def _save(look: LookResult, folder: Path, clouds: bool) -> list[Path]:
    """Return an annotated picture of each view, its cloud if requested, and one recording of all if rerun is
    installed.
    """
    files = []
    for number, view in enumerate(look.views):
        picture = annotated_image(view.image, view.in_map.frame_from_camera, look.marks)
        files.append(folder / f"{look.furniture}_{number}.png")
        Image.fromarray(picture).save(files[-1])
        if clouds:
            files.append(files[-1].with_suffix(".ply"))
            write_cloud(files[-1], view.in_map.cloud())
    if not is_installed("rerun"):
        return files
    files.append(folder / f"{look.furniture}.rrd")
    looks = [
        RecordedLook("head_camera", view.image, view.in_map.frame_from_camera, view.in_map.cloud())
        for view in look.views
    ]
    write_look(files[-1], looks, look.marks)
    return files


def _print(look: LookResult, files: list[Path]) -> None:
    print(f"{look.furniture}:")
    for found in look.marks.objects:
        x, y, z = found.pose.position
        yaw = f", yaw open by {found.yaw_set.width:.2f} rad" if found.yaw_set.arcs else ""
        place = f"{x:.3f} {y:.3f} {z:.3f} ±{1e3 * found.position_std:.1f} mm"
        print(f"  {found.name:14} {found.confidence:.2f}  at {place}{yaw}")
    for mark in look.marks.handles:
        x, y, z = mark.handle.pose.position
        joint = mark.handle.joint or "unknown joint"
        print(f"  {mark.name:14} {mark.handle.confidence:.2f}  {mark.handle.kind} at {x:.3f} {y:.3f} {z:.3f}, {joint}")
    for failure in look.failures:
        print(f"  {failure.why}")
    for file in files:
        print(f"  {file}")


def _document(look: LookResult, files: list[Path]) -> dict[str, Any]:
    return {
        "furniture": look.furniture,
        "objects": [
            {
                "name": found.name,
                "recognised": found.recognised,
                "position": _rounded(found.pose.position),
                "yaw": round(found.pose.yaw, 4),
                "confidence": round(found.confidence, 4),
                "position_std": round(found.position_std, 5),
                "yaw_set": [_rounded(arc) for arc in found.yaw_set.arcs],
            }
            for found in look.marks.objects
        ],
        "handles": [
            {
                "name": mark.name,
                "kind": mark.handle.kind,
                "position": _rounded(mark.handle.pose.position),
                "axis": _rounded(mark.handle.axis),
                "radius": round(mark.handle.radius, 4),
                "length": round(mark.handle.length, 4),
                "opening_direction": _rounded(mark.handle.opening_direction),
                "joint": mark.handle.joint,
                "joint_confidence": round(mark.handle.joint_confidence, 4),
                "hinge_side": mark.handle.hinge_side,
                "confidence": round(mark.handle.confidence, 4),
            }
            for mark in look.marks.handles
        ],
        "grasps": [
            {
                "target": grasp.target,
                "position": _rounded(grasp.pose.position),
                "quaternion": _rounded(grasp.pose.quaternion),
                "width": round(grasp.width, 4),
                "quality": round(grasp.quality, 4),
            }
            for grasp in look.marks.grasps
        ],
        "surfaces": [
            {"name": surface.name, "height": round(float(surface.pose.position[2]), 4), "size": _rounded(surface.size)}
            for surface in look.marks.surfaces
        ],
        "failures": [{"node": f.node, "code": f.error_code, "why": f.why} for f in look.failures],
        "files": [str(file) for file in files],
    }


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), 4) for value in values]
