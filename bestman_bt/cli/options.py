"""Options that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Seed = Annotated[int, typer.Option(min=0, help="Decides the scene, the noise and every sample; a whole number.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a setting: scene.…, robot.… or a field of the task."),
]
Plugins = Annotated[
    list[Path] | None, typer.Option("--plugin", metavar="FILE.py", help="Load leaves and algorithms from a file.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on standard output, all else elsewhere.")]
Driver = Annotated[
    str, typer.Option(help="Which robot: pybullet, hardware for the controllers in the robot's YAML, or replay.")
]
Scene = Annotated[str | None, typer.Option(help="A shipped scene or a YAML file.")]
Robot = Annotated[str | None, typer.Option(help="A shipped robot or a YAML file.")]
