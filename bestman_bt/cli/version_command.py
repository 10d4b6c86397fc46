"""Example: bestman-bt version."""

from __future__ import annotations

from bestman_bt.evaluation.versions import versions


def command() -> None:
    """Print the versions of this package and of its dependencies."""
    for name, version in versions().items():
        print(f"{name} {version}")
