"""What is deployed: the files can be read, and name commands, options, extras and folders that there are."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from scripts.system_libraries import DEBIAN_PACKAGES
from tests.packaging.test_page_blocks import fault_of

CHECKOUT = Path(__file__).resolve().parents[2]
DEPLOY = CHECKOUT / "deploy"
DOCKERFILE = (DEPLOY / "Dockerfile").read_text()
COMPOSE: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
CLUSTER: list[Any] = list(yaml.safe_load_all((DEPLOY / "ray.yaml").read_text()))
GROUPS = [CLUSTER[1]["spec"]["headGroupSpec"], *CLUSTER[1]["spec"]["workerGroupSpecs"]]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())


def calls() -> Iterator[str]:
    """Yield the calls of the command line in all files, those of containers with what their image calls."""
    for path in DEPLOY.iterdir():
        text = path.read_text().replace("\\\n#", "")
        yield from re.findall(r"(?<![\w./-])bestman-bt [a-z].*$", text, re.MULTILINE)
    for service in COMPOSE["services"].values():
        yield " ".join(["bestman-bt", *service["command"]])


def test_the_commands_and_their_options_exist() -> None:
    found = list(calls())
    assert len(found) == 6
    assert {call: fault for call in found if (fault := fault_of(call))} == {}


def test_the_image_has_extras_that_there_are_and_the_libraries_that_the_wheels_load() -> None:
    extras = {name for names in re.findall(r"EXTRAS=([\w,]+)", DOCKERFILE) for name in names.split(",")}
    assert {"sim", "ray"} <= extras
    assert extras <= PROJECT["project"]["optional-dependencies"].keys()
    (run_time,) = re.findall(r"apt-get install -y --no-install-recommends (ca-.*?) \\", DOCKERFILE)
    assert set(DEBIAN_PACKAGES.values()) <= set(run_time.split())


def test_the_image_runs_as_a_user_without_rights_and_is_built_of_what_the_wheel_needs() -> None:
    users = re.findall(r"^USER (\w+)", DOCKERFILE, re.MULTILINE)
    assert users
    assert users[-1] != "root"
    ignored = (DEPLOY / "Dockerfile.dockerignore").read_text().split()
    needed = {*PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["only-include"], "pyproject.toml", "README.md"}
    assert needed.isdisjoint(ignored)
    assert ".venv" in ignored


def test_servers_of_the_composition_are_reached_from_this_machine_alone() -> None:
    published = [port for service in COMPOSE["services"].values() for port in service.get("ports", ())]
    assert published == ["127.0.0.1:8750:8750"]
    monitor, executor = COMPOSE["services"]["monitor"], COMPOSE["services"]["executor"]
    assert "--port 8750" in " ".join(monitor["command"])
    assert monitor["environment"]["BESTMAN_BT_MONITOR_TOKEN"].startswith("${BESTMAN_BT_MONITOR_TOKEN:?")
    assert monitor["volumes"] == executor["volumes"]
    (runtime,) = re.findall(r"XDG_RUNTIME_DIR=(\S+)", DOCKERFILE)
    assert f"runtime:{runtime}" in executor["volumes"]
    assert (CHECKOUT / "deploy" / COMPOSE["services"]["executor"]["build"]["context"]).resolve() == CHECKOUT


def test_the_cluster_shares_a_folder_and_runs_without_rights() -> None:
    claim, cluster = CLUSTER
    assert claim["spec"]["accessModes"] == ["ReadWriteMany"]
    for group in GROUPS:
        pod = group["template"]["spec"]
        assert pod["securityContext"]["runAsNonRoot"]
        assert pod["volumes"][0]["persistentVolumeClaim"]["claimName"] == claim["metadata"]["name"]
        (container,) = pod["containers"]
        assert container["image"] == COMPOSE["services"]["executor"]["image"]
        assert container["volumeMounts"] == [{"name": "shared", "mountPath": "/shared"}]
    assert cluster["spec"]["authOptions"] == {"mode": "token"}


def test_the_cluster_names_options_of_ray() -> None:
    ray = Path(sys.executable).with_name("ray")
    if not ray.exists():
        pytest.skip("the extra ray is not installed: make test-cluster")
    told = subprocess.run([ray, "start", "--help"], capture_output=True, text=True, check=True).stdout
    for option in {name for group in GROUPS for name in group["rayStartParams"]}:
        assert f"--{option}" in told


def test_the_script_for_slurm_is_one_that_the_shell_reads() -> None:
    done = subprocess.run(["sh", "-n", DEPLOY / "slurm.sh"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
