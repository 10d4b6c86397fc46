"""Which code and data an episode was run with, told by their contents: commits and paths do not matter."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import yaml

from bestman_bt.configuration import RunConfig, data_root, dump_run
from bestman_bt.evaluation.named_files import named_files
from bestman_bt.evaluation.versions import versions

_PACKAGES = ("bestman_bt", "behaviours", "hal")
_DATA = ("assets", "configs", "trees")
_NO_MATTER = ("bestman_bt/cli/", "bestman_bt/_data/", "configs/evaluations/", "configs/tasks/")
"""What decides no episode; a task is part of the run's own configuration."""


def code_fingerprint() -> str:
    """Twelve hexadecimal digits over the sources, the shipped data and the versions of packages that decide a run."""
    digest = hashlib.sha256(yaml.safe_dump(versions()).encode())
    for name, path in sorted(_files()):
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def config_fingerprint(config: RunConfig) -> str:
    """Twelve hexadecimal digits over a run's configuration but its seed and entry, and the files of a user it names.

    Also over what those files name: furniture, objects, parts, meshes, included trees, policies.
    """
    task = config.task
    plain = replace(
        task,
        tree=Path(task.tree).name,
        scene=Path(task.scene).name,
        robot=Path(task.robot).name,
        plugins=tuple(Path(plugin).name for plugin in task.plugins),
    )
    config = replace(config, seed=0, entry="")
    digest = hashlib.sha256(dump_run(replace(config, task=plain)).encode())
    for path in named_files(yaml.safe_load(dump_run(config))):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def commit() -> str:
    """The commit of the checkout, with ``+changes`` where files differ from it; "" outside a checkout."""
    root = data_root()
    if not (root / ".git").exists():
        return ""
    try:
        head = _git(root, "rev-parse", "--short=12", "HEAD").strip()
        changed = _git(root, "status", "--porcelain", "--", *_PACKAGES, *_DATA)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{head}+changes" if changed else head


def _git(root: Path, *arguments: str) -> str:
    return subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True).stdout


def _files() -> Iterator[tuple[str, Path]]:
    packages = Path(__file__).resolve().parents[2]
    for root, folders, pattern in ((packages, _PACKAGES, "*.py"), (data_root(), _DATA, "*")):
        for folder in folders:
            for path in (root / folder).rglob(pattern):
                name = path.relative_to(root).as_posix()
                if path.is_file() and path.suffix != ".pyc" and not name.startswith(_NO_MATTER):
                    yield name, path
