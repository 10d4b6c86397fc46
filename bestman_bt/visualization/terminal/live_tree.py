"""The tree as it runs, for ``rich.live.Live``; it only renders, printing is left to the caller."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING
from bestman_bt.records.events import MAIN_TREE, DescribedNode, StatesEvent, TreeEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import Look, look_of
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.terminal.events import NodeEvent, NodeEvents
from bestman_bt.visualization.terminal.folding import folded_nodes, hidden_count

HEADER_LINES = 2
FEWEST_TREE_LINES = 5


class LiveTree:
    """A rich renderable of a running tree.

    Feed it with ``take`` and ``set_time``. On a terminal show it with ``rich.live.Live``; elsewhere write the
    events that ``take`` returns, one line each. Trees higher than the terminal are folded where nothing runs.
    ``simulated``: whether the robot's clock is a simulation's, which runs apart from real time.
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
        """Take over state changes; returns what is worth a line in a log.

        Of trees that a leaf of this one ticks the events are shown; they are not drawn.
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

    def tell(self, uid: int, message: str) -> None:
        """Replace the message of a node, as when a running leaf reports progress."""
        self._messages[uid] = message

    def set_time(self, robot_time: float, wall_time: float) -> None:
        """Set what has passed on the robot's clock and on the wall's, seconds."""
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
        look = look_of(self._history.states.now, self._tree[0].uid)
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
        look, state = look_of(now, node.uid), now.states[node.uid]
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
    """Rich's style of a look."""
    red, green, blue = look.dark
    return f"rgb({red},{green},{blue})"
