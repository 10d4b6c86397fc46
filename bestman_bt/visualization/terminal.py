"""The running tree for ``rich.live.Live``; it only renders, the caller prints."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.records.events import MAIN_TREE, DescribedNode, StatesEvent, TreeEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import LOOKS, WAS, Look, appearance_of
from bestman_bt.records.states import NO, NodeStates
from bestman_bt.visualization.node_labels import node_label


def folded_nodes(tree: NodeList, states: NodeStates, lines: int) -> set[int]:
    """Return the uids of nodes to fold so that at most ``lines`` nodes remain, if possible.

    Running nodes and their ancestors stay visible. Nodes that were never ticked fold first, then succeeded ones, then
    failed ones; the deepest first among equals, so that as little as possible is hidden.
    """
    sizes = _subtree_sizes(tree)
    active = _with_running_below(tree, states)
    foldable = [node for node in tree.depth_first() if sizes[node.uid] > 1 and node.uid not in active]
    foldable.sort(key=lambda node: (_rank(states, node), -tree.depth(node.uid)))
    folded: set[int] = set()
    visible = len(tree)
    hidden_below: dict[int, int] = {}
    for node in foldable:
        if visible <= lines:
            break
        already = _hidden_in(tree, node, folded, hidden_below)
        hidden_below[node.uid] = sizes[node.uid] - 1
        visible -= sizes[node.uid] - 1 - already
        folded.add(node.uid)
    return folded


def hidden_count(tree: NodeList, uid: int) -> int:
    """Return the number of nodes below a node."""
    return _subtree_sizes(tree)[uid] - 1


def _rank(states: NodeStates, node: DescribedNode) -> int:
    look = appearance_of(states, node.uid)
    if look is LOOKS[IDLE]:
        return 0
    return 1 if look in (WAS[SUCCESS], WAS[NO], LOOKS[SUCCESS], LOOKS[NO]) else 2


def _subtree_sizes(tree: NodeList) -> dict[int, int]:
    sizes: dict[int, int] = {}
    for node in reversed(list(tree.depth_first())):
        sizes[node.uid] = 1 + sum(sizes[child.uid] for child in tree.children(node.uid))
    return sizes


def _with_running_below(tree: NodeList, states: NodeStates) -> set[int]:
    """Return nodes with a running node strictly below them."""
    active: set[int] = set()
    for node in reversed(list(tree.depth_first())):
        runs_or_active = states.states[node.uid] == RUNNING or node.uid in active
        if runs_or_active and node.parent is not None:
            active.add(node.parent)
    return active


def _hidden_in(tree: NodeList, top: DescribedNode, folded: set[int], hidden_below: dict[int, int]) -> int:
    """Return how many nodes under ``top`` are hidden already: those below the highest folded nodes."""
    hidden, pending = 0, list(tree.children(top.uid))
    while pending:
        node = pending.pop()
        if node.uid in folded:
            hidden += hidden_below[node.uid]
        else:
            pending.extend(tree.children(node.uid))
    return hidden


@dataclass(frozen=True)
class NodeEvent:
    """A state change: ``node`` changed to ``state`` at ``time``, seconds; ``message``: the reason."""

    time: float
    node: DescribedNode
    state: int
    message: str

    @property
    def look(self) -> Look:
        """Return the style of the event."""
        return LOOKS[self.state]

    def __str__(self) -> str:
        look = self.look
        message = f": {self.message}" if self.message else ""
        return f"[{self.time:7.2f} s] {look.icon} {node_label(self.node)} {look.word}{message}"


class NodeEvents:
    """Turns state changes of leaves into events; a repeated event is reported once."""

    def __init__(self, history: RunHistory) -> None:
        self._history = history
        self._printed: dict[int, tuple[int, str]] = {}

    def of(self, event: StatesEvent) -> list[NodeEvent]:
        """Return the events of a tick's changes, including the result of the tree's root."""
        events = []
        offset, _ = self._history.nodes.range_of(event.tree)
        for change in self._history.shown(event):
            node, state = self._history.nodes.node(change.uid), change.status
            printed = self._printed.get(node.uid)
            if state in (IDLE, SKIPPED):
                if state == IDLE and printed and printed[0] == RUNNING:
                    del self._printed[node.uid]
                continue
            is_result_of_root = node.uid == offset + 1 and state != RUNNING
            if not (node.is_leaf or is_result_of_root):
                continue
            message = event.messages.get(node.uid - offset, "")
            now = (state, message if state != RUNNING else "")
            if now != printed:
                self._printed[node.uid] = now
                events.append(NodeEvent(event.time, node, state, message))
        return events


HEADER_LINES = 2
FEWEST_TREE_LINES = 5


class LiveTree:
    """A rich renderable of a running tree.

    Feed it with ``take`` and ``set_time``. On a terminal show it with ``rich.live.Live``; elsewhere write the events
    that ``take`` returns, one line each. Trees higher than the terminal are folded where nothing runs. ``simulated``:
    whether the robot's clock is simulated and runs apart from real time.
    """

    def __init__(self, tree: TreeEvent, title: str = "", event_lines: int = 6, simulated: bool = True) -> None:
        self._tree = NodeList()
        self._tree.add(tree)
        self._title = title or node_label(self._tree[0])
        self._simulated = simulated
        self._history = RunHistory()
        self._history.take(tree)
        self._messages: dict[int, str] = {}
        self._events = NodeEvents(self._history)
        self._recent: deque[NodeEvent] = deque(maxlen=event_lines)
        self._robot_time = 0.0
        self._wall_time = 0.0

    def take(self, event: StatesEvent | TreeEvent) -> list[NodeEvent]:
        """Store state changes. Returns the events worth a line in a log.

        Events of trees that a leaf of this one ticks are returned too, but those trees are not drawn.
        """
        if isinstance(event, TreeEvent):
            self._history.take(event)
            return []
        events = self._events.of(event)
        self._history.take(event)
        if event.tree == MAIN_TREE:
            self._messages |= {uid: event.messages.get(uid, "") for uid, state in event.changes if state != IDLE}
        self._recent.extend(events)
        return events

    def set_message(self, uid: int, message: str) -> None:
        """Replace the message of a node, as when a running leaf reports progress."""
        self._messages[uid] = message

    def set_time(self, robot_time: float, wall_time: float) -> None:
        """Set the elapsed time of the robot's clock and of the wall clock, seconds."""
        self._robot_time = robot_time
        self._wall_time = wall_time

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        height = options.height or console.height
        room_for_events = max(0, height - HEADER_LINES - FEWEST_TREE_LINES - 1)
        events = list(self._recent)[-room_for_events:] if room_for_events else []
        yield self._header()
        yield Text("")
        for line in self._tree_lines(height - HEADER_LINES - (len(events) + 1 if events else 0)):
            line.truncate(options.max_width, overflow="ellipsis")
            yield line
        if events:
            yield Text("─" * min(options.max_width, 60), style="dim")
            for event in events:
                line = Text(str(event), style=style_of(event.look))
                line.truncate(options.max_width, overflow="ellipsis")
                yield line

    def _header(self) -> Text:
        look = appearance_of(self._history.states.now, self._tree[0].uid)
        header = Text(no_wrap=True, overflow="ellipsis")
        header.append(f"{look.icon} {self._title}", style=f"bold {style_of(look)}")
        if self._simulated:
            factor = self._robot_time / self._wall_time if self._wall_time > 0 else 0.0
            header.append(f"   simulated {self._robot_time:.1f} s", style="bold")
            header.append(f"   wall {self._wall_time:.1f} s   {factor:.1f} × real time", style="dim")
        else:
            header.append(f"   real time {self._robot_time:.1f} s", style="bold")
        return header

    def _tree_lines(self, lines: int) -> list[Text]:
        folded = folded_nodes(self._tree, self._history.states.now, lines)
        rows = list(self._rows(folded))
        lines = max(1, lines)
        if len(rows) <= lines:
            return [text for _, text in rows]
        running = [i for i, (node, _) in enumerate(rows) if self._history.states.now.states[node.uid] == RUNNING]
        last = min(len(rows), max(lines, (running[-1] if running else 0) + lines // 2))
        return [text for _, text in rows[last - lines : last]]

    def _rows(self, folded: set[int]) -> Iterator[tuple[DescribedNode, Text]]:
        pending: list[tuple[DescribedNode, str, str]] = [(self._tree[0], "", "")]
        while pending:
            node, branch, indent = pending.pop()
            yield node, self._row(node, branch, node.uid in folded)
            if node.uid in folded:
                continue
            children = self._tree.children(node.uid)
            for child in reversed(children):
                is_last = child is children[-1]
                pending.append((child, indent + ("└─ " if is_last else "├─ "), indent + ("   " if is_last else "│  ")))

    def _row(self, node: DescribedNode, branch: str, is_folded: bool) -> Text:
        now = self._history.states.now
        look, state = appearance_of(now, node.uid), now.states[node.uid]
        row = Text(no_wrap=True, overflow="ellipsis")
        row.append(branch, style="dim")
        row.append(f"{look.icon} {node_label(node)}", style=style_of(look) + (" bold" if state == RUNNING else ""))
        if is_folded:
            row.append(f"  … {hidden_count(self._tree, node.uid)} nodes", style="dim")
        message = self._messages.get(node.uid, "")
        if message and (state in (RUNNING, FAILURE) or look.word == "failed"):
            row.append(f"  {message}", style=style_of(look))
        return row


def style_of(look: Look) -> str:
    """Return the rich style for an appearance."""
    red, green, blue = look.dark
    return f"rgb({red},{green},{blue})"
