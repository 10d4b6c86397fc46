"""The options of commands that run many episodes: on which machines, and how many at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bestman_bt.configuration.errors import Problem

if TYPE_CHECKING:
    from bestman_bt.evaluation.launchers.launcher import Launcher


@dataclass(frozen=True)
class LauncherOptions:
    """The number of processes, and the machines."""

    jobs: Annotated[
        int | None,
        typer.Option(
            min=1, help="Episodes at the same time; 1, or all that the cluster has room for.", show_default=False
        ),
    ] = None
    launcher: Annotated[str, typer.Option(help="What runs the episodes: local, slurm, ray, or one of yours.")] = "local"
    address: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Of the launcher's cluster.", show_default=False)
    ] = None

    def made(self, folder: Path, monitor: bool = False) -> Launcher:
        """Return the launcher of episodes kept in ``folder``. Raises ConfigurationError, UnknownNameError."""
        from bestman_bt.evaluation.launchers.launcher import LaunchOptions
        from bestman_bt.registry import LAUNCHERS

        launcher: Launcher = LAUNCHERS.resolve(self.launcher)(
            LaunchOptions(self.jobs, self.address or "", folder, monitor)
        )
        return launcher

    def problems(self) -> list[Problem]:
        """Return what contradicts itself."""
        if self.address and self.launcher == "local":
            return [Problem("--address", None, "", "is of a cluster; name its --launcher")]
        return []
