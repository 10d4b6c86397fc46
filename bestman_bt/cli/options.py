"""Options that several verbs share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer


def writable_file(path: Path | None) -> Path | None:
    """Told before the work whose result goes there."""
    if path is None:
        return None
    if path.is_dir() or not path.parent.is_dir():
        raise typer.BadParameter(f"'{path}' is a folder" if path.is_dir() else f"there is no folder '{path.parent}'")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise typer.BadParameter(f"'{path}' may not be written")
    return path


def refuse_unwritable_folder(path: Path, option: str) -> None:
    """BadParameter where a folder, which may have to be made, cannot be written to."""
    there = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    if not there.is_dir():
        raise typer.BadParameter(f"'{there}' is no folder", param_hint=option)
    if not os.access(there, os.W_OK):
        raise typer.BadParameter(f"'{there}' may not be written", param_hint=option)


def _writable_png(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".png":
        raise typer.BadParameter(f"pictures are PNG files: FILE.png, got '{path}'")
    return writable_file(path)


Seed = Annotated[int, typer.Option(min=0, help="Decides the scene, the noise and every sample.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a setting: scene.…, robot.… or a field of the task."),
]
Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", metavar="FILE.py", help="Load skills, algorithms and planners of yours."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output, all else elsewhere.")]
Driver = Annotated[
    str, typer.Option(help="Which robot: pybullet, hardware for the controllers in the robot's YAML, or replay.")
]
Scene = Annotated[str | None, typer.Option(help="A shipped scene or a YAML file.")]
Png = Annotated[
    Path | None, typer.Option(metavar="FILE.png", help="Write a picture.", callback=_writable_png, show_default=False)
]
Robot = Annotated[str | None, typer.Option(help="A shipped robot or a YAML file.")]
SavedWorld = Annotated[
    Path | None,
    typer.Option("--world", metavar="FILE", help="What is believed, as a run writes it: world.yaml in its folder."),
]
Groot2Port = Annotated[
    int | None,
    typer.Option(min=1, max=65534, help="Let Groot2 connect there and to the next port; its own default is 1667."),
]
Live = Annotated[bool, typer.Option("--live", help="Show it live in the Rerun viewer.")]
Monitor = Annotated[
    bool, typer.Option("--monitor", help="Show it live in the browser; the address is printed, the page stays on.")
]
MonitorPort = Annotated[int, typer.Option(min=1, max=65535, help="With --monitor: the port of the page.")]
MONITOR_PORT = 8750
