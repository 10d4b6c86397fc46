"""A Slurm of this machine on loopback, of Debian's packages slurmctld, slurmd, slurm-client and munge; needs root."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sinfo", "sbatch", "squeue", "scancel")
PORTS = (20817, 20818)
"""Of the controller and the node: below those that the system gives to outgoing connections."""
START = 30.0
"""Seconds after which its node is taken not to become ready."""
CONFIGURATION = """
ClusterName=tests
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge/socket
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def answers() -> bool:
    """Return whether a Slurm answers, and its nodes take jobs."""
    if shutil.which("sinfo") is None:
        return False
    told = subprocess.run(["sinfo", "--noheader", "--format=%T"], capture_output=True, text=True, check=False)
    return told.returncode == 0 and "idle" in told.stdout


def why_none() -> str:
    """Return why none can be started here, empty if one can."""
    missing = [name for name in PROGRAMS if shutil.which(name) is None]
    if missing:
        return f"{', '.join(missing)} not found: apt-get install slurmctld slurmd slurm-client munge"
    return "" if os.geteuid() == 0 else "a Slurm is started by root alone"


@contextmanager
def one_machine_slurm(folder: Path) -> Iterator[Path]:
    """Run one with its files in ``folder``, which all users may enter; yield its configuration, for SLURM_CONF."""
    for name in ("munge", "state", "spool"):
        (folder / name).mkdir()
    (folder / "munge").chmod(0o711)
    (folder / "munge/key").touch(0o600)
    (folder / "munge/key").write_bytes(secrets.token_bytes(128))
    configuration = folder / "slurm.conf"
    host = socket.gethostname().partition(".")[0]
    configuration.write_text(CONFIGURATION.format(host=host, ports=PORTS, folder=folder, cores=os.cpu_count()))
    munge = [f"--{name}-file={folder}/munge/{name}" for name in ("key", "pid", "log", "seed")]
    with ExitStack() as stack:
        for command in (
            ["munged", "--foreground", f"--socket={folder}/munge/socket", *munge],
            ["slurmctld", "-D", "-f", str(configuration)],
            ["slurmd", "-D", "-f", str(configuration)],
        ):
            process = stack.enter_context(subprocess.Popen(command, stderr=subprocess.DEVNULL))
            stack.callback(process.terminate)
            while command[0] == "munged" and not (folder / "munge/socket").exists():
                assert process.poll() is None, (folder / "munge/log").read_text()
                time.sleep(0.05)
        stack.enter_context(_environment(configuration))
        deadline = time.monotonic() + START
        while not answers():
            logs = [path.read_text() for path in folder.glob("*.log")]
            assert time.monotonic() < deadline, "\n".join(logs)
            time.sleep(0.2)
        yield configuration


@contextmanager
def _environment(configuration: Path) -> Iterator[None]:
    """Let the programs of Slurm that this process starts find it."""
    before = os.environ.get("SLURM_CONF")
    os.environ["SLURM_CONF"] = str(configuration)
    try:
        yield
    finally:
        if before is None:
            del os.environ["SLURM_CONF"]
        else:
            os.environ["SLURM_CONF"] = before
