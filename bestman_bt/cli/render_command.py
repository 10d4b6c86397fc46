"""Examples: bestman-bt render runs/<run> --film; bestman-bt render runs/<run> --blender --at 12.5."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer


def _size(text: str) -> str:
    if re.fullmatch("[0-9]{1,5}x[0-9]{1,5}", text) is None:
        raise typer.BadParameter(f"a size is WIDTHxHEIGHT, such as 960x720, got '{text}'")
    return text


def command(
    run: Annotated[Path | None, typer.Argument(help="The folder of a simulated run.", show_default=False)] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Where the pictures go; 'render' in the run folder.")
    ] = None,
    at: Annotated[
        list[float] | None,
        typer.Option(metavar="SECONDS", help="Time of a still; may be repeated. Default: the best moment."),
    ] = None,
    film: Annotated[bool, typer.Option("--film", help="An mp4 of the whole run too; needs the extra 'video'.")] = False,
    blender: Annotated[bool, typer.Option("--blender", help="Let Blender paint: slower, and handsomer.")] = False,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.", callback=_size)] = "960x720",
    samples: Annotated[int, typer.Option(min=1, max=4096, help="Blender's light paths per pixel.")] = 32,
    install_blender: Annotated[
        bool, typer.Option("--install-blender", help="Install Blender (GPL-3.0, about 1 GB) beside bestman-bt first.")
    ] = False,
) -> None:
    """Make pictures and a film of a run that has ended."""
    from bestman_bt.cli.run_view import CONSOLE, RESULTS
    from bestman_bt.evaluation.film.filmed_run import read_filmed_run
    from bestman_bt.evaluation.film.rendering import RenderOptions, render
    from bestman_bt.visualization.blender.painting import install_blender as make_installation

    if run is None and not install_blender:
        raise typer.BadParameter("name a run folder, or give --install-blender")
    if install_blender:
        with CONSOLE.status("installing Blender") as status:
            python = make_installation(lambda what: status.update(f"installing Blender: {what}"))
        RESULTS.print(f"installed: {python}", highlight=False, soft_wrap=True)
    if run is None:
        return
    width, height = (int(pixels) for pixels in size.split("x"))
    options = RenderOptions(tuple(at or ()), film, blender, (width, height), samples)
    filmed = read_filmed_run(run)
    with CONSOLE.status("reading the run") as status:
        written = render(filmed, out or run / "render", options, status.update)
    for path in written:
        print(path)
