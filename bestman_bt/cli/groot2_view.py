"""``--groot2-port`` of verbs that run something: Groot2 may look at the tree and hold it up."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import TracebackType

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.engine import Tree
from bestman_bt.monitor.groot2 import Groot2Error, Groot2Publisher, check_servable
from bestman_bt.runtime import Session


class Groot2View:
    """Serves the tree that a run ticks, until the context ends. ConfigurationError where that cannot be."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._publisher: Groot2Publisher | None = None

    def __enter__(self) -> Groot2View:
        try:
            check_servable(self._port)
        except Groot2Error as error:
            where = f"--groot2-port {self._port}"
            raise ConfigurationError([Problem(where, None, "", str(error))]) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._publisher is not None:
            self._publisher.close()

    def watch(self, session: Session, tree: Tree) -> Callable[[], None]:
        """Serve from now on; there is nothing to do after a tick."""
        self._publisher = Groot2Publisher(tree, self._port).open()
        print(f"Groot2: {self._publisher.host}, port {self._port}", file=sys.stderr, flush=True)
        return lambda: None
