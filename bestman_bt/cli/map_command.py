"""Examples: bestman-bt map show apartment.yaml; bestman-bt map show apartment.yaml --png apartment.png."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bestman_bt.cli.options import Json, Png, json_output
from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN
from bestman_bt.navigation.map_file import read_map

_AROUND = 0.5
"""Margin of a picture around the known cells, metres."""
_UNKNOWN_COLOUR = (204, 214, 224)

verbs = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="Show maps of ROS: a YAML file and its image.",
    epilog=__doc__,
)


@verbs.callback()
def root() -> None:
    """Show maps of ROS: a YAML file and its image."""


@verbs.command()
def show(
    file: Annotated[Path, typer.Argument(help="A map's YAML file, as ExploreAndMap and nav2 write it.")],
    png: Png = None,
    as_json: Json = False,
) -> None:
    """Show the contents of a map file: size, resolution, and fractions of free, occupied and unknown cells."""
    with json_output(as_json) as write:
        grid = read_map(file)
        facts = _facts(grid)
        if png is not None:
            _picture(grid, png, file.stem)
            facts["picture"] = str(png)
        write(facts)
        if not as_json:
            rows, columns = facts["cells"]
            print(f"{file}: {rows} × {columns} cells of {facts['resolution_m']:g} m, {_metres(facts['size_m'])}")
            print(f"  origin     {facts['origin_m'][0]:.2f}, {facts['origin_m'][1]:.2f} m")
            print(f"  free       {facts['free_m2']:.1f} m²")
            print(f"  occupied   {facts['occupied_m2']:.1f} m²")
            print(f"  unknown    {facts['unknown_m2']:.1f} m²")
            if png is not None:
                print(f"  picture    {png}")


def _metres(size: list[float]) -> str:
    return " × ".join(f"{extent:.1f}" for extent in size) + " m"


def _facts(grid: OccupancyGrid) -> dict[str, Any]:
    rows, columns = grid.data.shape
    cell = grid.resolution**2
    free, unknown = int((grid.data == FREE).sum()), int((grid.data == UNKNOWN).sum())
    return {
        "cells": [rows, columns],
        "resolution_m": grid.resolution,
        "size_m": [columns * grid.resolution, rows * grid.resolution],
        "origin_m": grid.origin.tolist(),
        "free_m2": free * cell,
        "occupied_m2": (grid.data.size - free - unknown) * cell,
        "unknown_m2": unknown * cell,
    }


def _picture(grid: OccupancyGrid, path: Path, title: str) -> None:
    """Show the known part of a map with a border around it, since maps often lie in a far larger unseen area."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows, columns = grid.data.shape
    x, y = grid.origin.tolist()
    extent = (x, x + columns * grid.resolution, y, y + rows * grid.resolution)
    greys = np.rint(np.linspace(255, 0, OCCUPIED - FREE + 1))
    colours = np.vstack([np.repeat(greys[:, None], 3, axis=1), _UNKNOWN_COLOUR]).astype(np.uint8)  # UNKNOWN is -1
    known = grid.data != UNKNOWN
    shown = known if known.any() else ~known
    of_rows, of_columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    left, bottom = grid.to_points(np.array([of_rows[0], of_columns[0]])) - _AROUND
    right, top = grid.to_points(np.array([of_rows[-1], of_columns[-1]])) + _AROUND
    figure, axes = plt.subplots(figsize=(8.0, 0.8 + 7.2 * (top - bottom) / (right - left)), dpi=110)
    axes.imshow(colours[grid.data], origin="lower", extent=extent, interpolation="nearest")
    axes.set(xlim=(left, right), ylim=(bottom, top), facecolor=tuple(channel / 255 for channel in _UNKNOWN_COLOUR))
    axes.set_title(title)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)
