"""Where a node of a loaded tree belongs: its tree, its blackboard and the SubTrees around it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bestman_bt.engine.blackboard import Blackboard
    from bestman_bt.engine.tree import Tree


class Place:
    """One SubTree instance, shared by all its nodes.

    Attributes:
        tree: the whole tree.
        board: the SubTree's blackboard.
        path: the SubTree's path; empty for the main tree.
        prefix: what the paths of its nodes begin with.
        ancestors: the IDs of the trees around it, outermost first, its own last.
        file: the file that defines it.
    """

    __slots__ = ("ancestors", "board", "file", "path", "prefix", "tree")

    def __init__(self, tree: Tree, board: Blackboard, path: str, ancestors: tuple[str, ...], file: str) -> None:
        self.tree = tree
        self.board = board
        self.path = path
        self.prefix = f"{path}/" if path else ""
        self.ancestors = ancestors
        self.file = file
