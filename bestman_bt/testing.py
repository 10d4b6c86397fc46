"""Test trees without a robot, in simulated time: ``from bestman_bt.testing import TreeTester``.

With ``pytest_plugins = ["bestman_bt.testing"]`` in a ``conftest.py``, tests also have the fixture ``tree_tester``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.engine.coverage import Coverage
from bestman_bt.engine.models.package import Package
from bestman_bt.engine.models.scenario import Scenario
from bestman_bt.engine.simulation import LIMIT, SimulatedRun, simulate
from bestman_bt.runtime.plugins import node_registry


class TreeTester:
    """Runs one tree repeatedly with scripted leaves and accumulates the coverage of its nodes."""

    def __init__(
        self,
        tree: str | Path,
        *,
        main_tree: str | None = None,
        plugins: Iterable[str | Path] = (),
        search: Iterable[str | Path] = (),
    ) -> None:
        self.tree = find_data("tree", tree)
        self.main_tree = main_tree
        self.registry = node_registry([str(plugin) for plugin in plugins])
        self.package = Package.open(search, shipped_trees())
        self.coverage: Coverage | None = None

    def run(
        self,
        nodes: Mapping[str, Any] | None = None,
        default: Any = "SUCCESS",
        *,
        entries: Mapping[str, Any] | None = None,
        seed: int = 0,
        limit: float = LIMIT,
    ) -> SimulatedRun:
        """Run the tree to its end.

        ``nodes``: path, name or type → scripted behaviour of the leaf, as in a scenario file: ``{"Grasp": {"results":
        ["FAILURE", "SUCCESS"], "duration": 2.0}}``. ``default``: the same for all other leaves; None: random, from
        ``seed``. ``entries``: of the root's blackboard.

        Raises:
            ScenarioError: the scenario is invalid.
            TreeLoadError: listing every fault of the tree.
        """
        given = {"nodes": dict(nodes or {}), "entries": dict(entries or {})}
        scenario = Scenario.from_mapping(given if default is None else {**given, "default": default})
        run = simulate(
            self.tree, self.registry, scenario=scenario, seed=seed, limit=limit, package=self.package,
            search_path=shipped_trees(), main_tree=self.main_tree,
        )  # fmt: skip
        self.coverage = self.coverage or Coverage(run.tree)
        self.coverage.add(run.transitions)
        return run

    def assert_coverage(self, at_least: float) -> None:
        """Raise AssertionError, naming the missed nodes, if a smaller fraction of the nodes has been ticked in all runs
        so far.
        """
        share = 0.0 if self.coverage is None else self.coverage.share
        missed = [] if self.coverage is None else [node.path for node in self.coverage.never_ticked]
        assert share >= at_least, f"{share:.0%} of the nodes began, never: {', '.join(missed) or 'any'}"


def assert_order(run: SimulatedRun, *paths: str) -> None:
    """Raise AssertionError unless nodes with these paths or names started in this order; others may start in
    between."""
    order = run.order
    position = 0
    for wanted in paths:
        found = [
            index for index in range(position, len(order)) if wanted in (order[index], order[index].rpartition("/")[2])
        ]
        assert found, f"'{wanted}' did not begin after {order[:position][-1:] or 'the start'}; these began: {order}"
        position = found[0] + 1


def assert_halted(run: SimulatedRun, path: str) -> None:
    """Raise AssertionError unless the node with this path or name was halted while it was running."""
    halted = run.halted
    assert any(path in (found, found.rpartition("/")[2]) for found in halted), f"'{path}' was not halted, but {halted}"


@pytest.fixture
def tree_tester() -> Callable[..., TreeTester]:
    """Provide the ``TreeTester`` class."""
    return TreeTester
