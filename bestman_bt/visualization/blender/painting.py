"""Runs Blender on a job, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from bestman_bt.visualization.blender.installation import BlenderError, last_lines
from bestman_bt.visualization.blender.job import PaintJob

SCRIPT = Path(__file__).parent / "script" / "paint_scene.py"
"""Run by Blender's Python, never imported here."""
FRAME_DONE = "bestman-bt: painted "


def paint(job: PaintJob, python: Path, on_frame: Callable[[Path], None]) -> None:
    """Paint all frames; ``python``: one that has Blender. Raises BlenderError with what Blender said last."""
    with TemporaryDirectory() as name:
        file, errors = Path(name) / "job.json", Path(name) / "errors.txt"
        file.write_text(json.dumps(job.document(), allow_nan=False), encoding="utf-8")
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        with (
            errors.open("w", encoding="utf-8") as log,
            subprocess.Popen(
                [str(python), "-I", str(SCRIPT), str(file)], stdout=subprocess.PIPE, stderr=log, text=True,
                env=environment,
            ) as blender,
        ):  # fmt: skip
            assert blender.stdout is not None
            try:
                said = ""
                for line in blender.stdout:
                    said = (said + line)[-4000:]
                    if line.startswith(FRAME_DONE):
                        on_frame(Path(line.removeprefix(FRAME_DONE).rstrip("\n")))
            except BaseException:
                blender.kill()
                raise
        if blender.returncode != 0:
            told = last_lines(errors.read_text(encoding="utf-8", errors="replace") or said)
            raise BlenderError(f"Blender has failed ({blender.returncode}):\n{told}")
    missing = [frame.file for frame in job.frames if not frame.file.is_file()]
    if missing:
        raise BlenderError(f"Blender has not painted {missing[0]}")
