"""The robot models that PyBullet's wheel holds, without PyBullet: some shipped robots are described by them."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zipfile
from importlib.util import find_spec
from pathlib import Path

from bestman_bt.configuration import ConfigurationError, Problem, own_pybullet_data

REQUIREMENT = "pybullet==3.2.7"
SHA256 = "5d858abf7c12a21ef3ed351cf81dac1b5e486ec25c9ab59bfc84beb89034edff"
"""Of the wheel for CPython 3.11 on Linux x86-64; the models in it serve any machine."""
FOLDER = "pybullet_data"


def bring_pybullet_data(wheel: Path | None = None) -> Path:
    """Unpack the folder pybullet_data alone into ``own_pybullet_data()``, and return that.

    ``wheel``: a file; by default ``REQUIREMENT`` is downloaded with the settings of pip or uv, and its hash checked.
    Raises ConfigurationError where that fails; then nothing is left.
    """
    target = own_pybullet_data()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".descriptions_") as scratch:
        if wheel is None:
            _download(Path(scratch))
        else:
            _unpack(wheel, Path(scratch))
        (Path(scratch) / FOLDER).rename(target)
    return target


def _unpack(wheel: Path, into: Path) -> None:
    try:
        with zipfile.ZipFile(wheel) as opened:
            members = [name for name in opened.namelist() if name.startswith(f"{FOLDER}/")]
            opened.extractall(into, members)
    except (OSError, zipfile.BadZipFile) as error:
        raise _fault("--wheel", f"{wheel} cannot be read: {error}") from error
    if not members:
        raise _fault("--wheel", f"{wheel} holds no {FOLDER}: a wheel of PyBullet is needed")


def _download(into: Path) -> None:
    """Let pip, else uv, install the wheel into ``into``: they use the user's settings for package indexes."""
    lock = into / "lock.txt"
    lock.write_text(f"{REQUIREMENT} --hash=sha256:{SHA256}\n", encoding="utf-8")
    if find_spec("pip") is not None:
        command = [sys.executable, "-m", "pip", "install", "--platform", "manylinux2014_x86_64"]
    elif (uv := shutil.which("uv")) is not None:
        command = [uv, "pip", "install", "--python-platform", "x86_64-manylinux2014"]
    else:
        raise _fault("descriptions", f"neither pip nor uv is here to download {REQUIREMENT}; --wheel takes a file")
    command += ["--quiet", "--no-deps", "--only-binary=:all:", "--python-version", "3.11"]
    command += ["--target", str(into), "--require-hashes", "-r", str(lock)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise _fault("descriptions", f"{' '.join(command)} failed: {done.stderr.strip()[-500:]}")


def _fault(where: str, message: str) -> ConfigurationError:
    return ConfigurationError([Problem(where, None, "", message)])
