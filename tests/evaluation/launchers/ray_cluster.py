"""Several real raylets on loopback, as a cluster that a driver finds by its address; each can be killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from types import TracebackType

OPTIONS = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "disabled"}
"""Loopback only, nothing sent home, and no token to be shared between the processes."""
PROGRAM = """
import json, sys
from ray.cluster_utils import Cluster

def pids(node):
    return {kind: processes[0].process.pid for kind, processes in node.all_processes.items() if processes}

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
print(json.dumps({"address": cluster.address, "head": pids(cluster.head_node), "nodes": [pids(n) for n in nodes]}))
sys.stdout.flush()
for line in sys.stdin:
    print(json.dumps(pids(cluster.add_node(num_cpus=1))), flush=True)
cluster.shutdown()
"""


class RayCluster:
    """A head without room for episodes, and two nodes with room for one each."""

    def __enter__(self) -> RayCluster:
        environment = {**os.environ, **OPTIONS}
        self._process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            text=True,
        )
        told = self._answer()
        self.address: str = told["address"]
        self.head: dict[str, int] = told["head"]
        self.nodes: list[dict[str, int]] = told["nodes"]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate(timeout=60)

    def kill_node(self) -> None:
        """End a raylet, and with it its workers, and put a new one in its place."""
        os.kill(self.nodes.pop(0)["raylet"], signal.SIGKILL)
        assert self._process.stdin is not None
        self._process.stdin.write("another\n")
        self._process.stdin.flush()
        self.nodes.append(self._answer())

    def kill_head(self) -> None:
        for kind in ("gcs_server", "raylet"):
            os.kill(self.head[kind], signal.SIGKILL)

    def _answer(self) -> dict:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())
