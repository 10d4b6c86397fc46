"""What an installed bestman-bt has to do; runs with the Python of that environment, outside of the checkout."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import bestman_bt as bt

ARM_TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><MoveArm posture="home"/></BehaviorTree></root>'


def main(expected: str) -> None:
    """Import, load, call the command, and move an arm in simulation; AssertionError or an exit code otherwise."""
    assert version("bestman-bt") == expected, f"the version is {version('bestman-bt')}, not {expected}"
    home = Path(bt.__file__).resolve()
    assert Path(sys.prefix).resolve() in home.parents, f"bestman_bt is imported from {home}"
    assert bt.load_tree("fetch_cup").nodes
    command = Path(sys.executable).with_name("bestman-bt")
    for arguments in (["version"], ["nodes", "Grasp"], ["robots"], ["validate", "fetch_cup"]):
        subprocess.run([command, *arguments], check=True, stdout=subprocess.DEVNULL)
    with bt.Session(robot="diff_panda", scene="kitchen", seed=1) as session:
        result = session.run(ARM_TREE)
    assert result.success, result.failure
    print(f"bestman-bt {expected}: imports, commands and a simulated arm work", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1])
