"""The base of every node: a py_trees behaviour with the tick, halt and status rules of BehaviorTree.CPP v4.

There are two statuses. The engine's own is one integer, ``_s``: 1 RUNNING, 2 SUCCESS, 3 FAILURE; an idle node has 0, or
-2/-3 to remember its last result. ``state`` and py_trees' ``status`` are views of it.
A parent calls ``child.run()`` and stores the returned status. Only ``bind`` chooses ``run``: the node's bare tick, the
traced tick if there are listeners, or a tick wrapped in conditions and hooks.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status as PyTreesStatus
from py_trees.ports import PortInformation

from bestman_bt.engine.core.ports import declare_typed_ports, make_reader, make_writer
from bestman_bt.engine.core.py_trees_adapter import PyTreesAdapter
from bestman_bt.engine.core.strict_order import Order, in_order, upwards
from bestman_bt.engine.core.tick_hooks import (
    Conditions,
    Hooks,
    PostTick,
    PreTick,
    Tick,
    with_conditions,
    with_post_hooks,
    with_pre_hooks,
    with_visits,
)
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.own_files import describe_error
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, STATUS_NAMES, SUCCESS, state_code

if TYPE_CHECKING:
    from bestman_bt.engine.blackboard import Blackboard
    from bestman_bt.engine.clock import EngineClock
    from bestman_bt.engine.core.registry import NodeInfo
    from bestman_bt.engine.core.tree import Tree


def describe_bad_status(status: object) -> str:
    """Return the message for the author of a node that returned an invalid status."""
    if isinstance(status, int) and status == IDLE:
        return "its tick returned IDLE; SUCCESS, FAILURE, RUNNING or SKIPPED are accepted"
    if isinstance(status, PyTreesStatus):
        return f"its tick returned py_trees' {status}; return bestman_bt.engine's {status.name} instead"
    return f"its tick returned {status!r}; one of {', '.join(STATUS_NAMES[1:])} is accepted"


def wrapped(error: BaseException, node: Node) -> NodeError:
    """Return a ``NodeError`` that names the node in which ``error`` was raised."""
    if type(error).__module__.startswith("bestman_bt.engine"):
        return node.error(str(error) or type(error).__name__)
    return node.error(describe_error(error))


def invalid_status_error(status: object, child: Node) -> NodeError:
    """Return the error for an invalid status of a child."""
    return child.error(describe_bad_status(status))


def creation_line(node: Behaviour) -> tuple[str, int]:
    """Return file and line of the call that creates a node, outside its own ``__init__`` and of py_trees' idioms."""
    frame = sys._getframe(1)
    while frame.f_back is not None and (_makes(frame, node) or frame.f_globals.get("__package__") == "py_trees"):
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno


def _makes(frame: FrameType, node: Behaviour) -> bool:
    if frame.f_code.co_name not in ("_set_up", "__init__"):
        return False
    return frame.f_code.co_argcount > 0 and frame.f_locals.get(frame.f_code.co_varnames[0]) is node


def split_arguments(
    cls: type[Node], args: tuple[Any, ...], name: str | None, attributes: dict[str, Any]
) -> tuple[str | None, list[Any]]:
    """Split the positional arguments of a node made in Python into its name and its children.

    Raises TypeError for other arguments.
    """
    children: list[Any] = []
    for argument in args:
        if isinstance(argument, str) and name is None:
            name = argument
        elif isinstance(argument, (list, tuple)):
            children.extend(argument)
        else:
            children.append(argument)
    children.extend(attributes.pop("children", ()))
    child = attributes.pop("child", None)
    if child is not None:
        children.append(child)
    return name, [_child(cls, found) for found in children]


def _child(cls: type[Node], found: Any) -> Behaviour:
    """Return a node, or the SubTree that stands for a whole tree."""
    if isinstance(found, Behaviour):
        return found
    if not hasattr(found, "as_subtree"):
        raise TypeError(f"{cls.__name__} takes a name and children but got {found!r}")
    subtree: Behaviour = found.as_subtree()
    return subtree


class NodePlace:
    """One SubTree instance, shared by all its nodes.

    Attributes:
        tree: the whole tree.
        board: the SubTree's blackboard.
        path: the SubTree's path; empty for the main tree.
        prefix: start of the paths of its nodes.
        ancestors: the IDs of the enclosing trees, outermost first, its own last.
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


NO_PORTS: Final[dict[str, Any]] = {}
"""The readers or writers of a node that has used none of its ports; never filled."""


class Node(PyTreesAdapter):
    """Base of all nodes.

    Derive leaves from ``SyncAction``, ``StatefulAction`` or ``Condition``, parents from ``Control`` or ``Decorator``.
    Create the state of a node in ``on_load``, when ports and context are available.
    """

    __slots__ = (
        "_readers",
        "_writers",
        "attributes",
        "children",
        "conditions",
        "ev",
        "hooks",
        "info",
        "line",
        "log",
        "made_in",
        "name",
        "only",
        "pairs",
        "parent",
        "place",
        "run",
        "uid",
    )

    INPUT_PORTS: ClassVar[Mapping[str, PortInformation]] = {}
    OUTPUT_PORTS: ClassVar[Mapping[str, PortInformation]] = {}
    KIND: ClassVar[str] = "Action"
    SYNCHRONOUS: ClassVar[bool] = False
    """True for leaves that must not return RUNNING."""
    CHECKED_AT_TICK: ClassVar[bool] = False
    """True if a missing port or child is an error only when the node is ticked, as in BehaviorTree.CPP; `validate`
    reports it.
    """
    STOPS_OVER_TICKS: ClassVar[bool] = False
    """True for actions that define ``on_stopping``."""
    STOP_TIMEOUT: ClassVar[float] = 5.0
    """Longest time, seconds of the tree's clock, to wait for such an action to stop."""

    tick_bare: ClassVar[Callable[..., int] | None] = None
    """The tick without listeners, if a class has a faster one than ``on_tick``."""
    tick_traced: ClassVar[Callable[..., int] | None] = None
    """As ``tick_bare``, and log every state change."""

    run: Tick
    log: list[Any] | None
    ev: tuple[int, int, int, int]
    pairs: list[tuple[Tick, Node]]
    only: tuple[Tick, Node]
    conditions: Conditions | None
    order: Order | None = None
    """The request that the node waits for; None for nearly all nodes."""

    uid: int
    place: NodePlace | None
    info: NodeInfo | None
    line: int
    made_in: str
    """The Python file that created the node; set, with ``line``, for nodes that do not come from XML."""
    attributes: dict[str, Any]
    hooks: Hooks | None
    _readers: dict[str, Callable[[], Any]]
    _writers: dict[str, Callable[[Any], None]]

    children: list[Behaviour]
    parent: Behaviour | None

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        declare_typed_ports(cls)
        cls.STOPS_OVER_TICKS = cls.on_stopping is not Node.on_stopping

    def __init__(self, *args: Any, name: str | None = None, **attributes: Any) -> None:
        name, children = split_arguments(type(self), args, name, attributes)
        self._set_up(name or type(self).__name__, attributes, children)

    def _set_up(self, name: str, attributes: dict[str, Any], children: list[Any]) -> None:
        """Set what every node has from the start."""
        self.name = name
        self._s = 0
        self.attributes = attributes
        self.children = children
        self._readers = self._writers = NO_PORTS
        self.conditions = self.hooks = None
        self.parent = self.place = self.info = None
        self.uid = 0
        self.made_in, self.line = creation_line(self)
        for child in children:
            child.parent = self

    def on_load(self) -> None:
        """Prepare the node once before the first tick; ports, blackboard, context and clock are available."""

    def on_tick(self) -> int:
        """Perform one tick and return a status."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_tick()")

    def on_stopping(self) -> int:
        """Return RUNNING while a halted action is still stopping; called at the halt and at each tick after it."""
        return IDLE

    def halt(self) -> None:
        """Halt the node: children first, then itself."""
        for child in self.nodes_below():
            code = child._s
            if code > 0:
                if code == RUNNING:
                    child.halt_node()
                child.reset_status()
        self.reset_status()

    @property
    def tree(self) -> Tree | None:
        """The tree that this node belongs to, once it is loaded."""
        place = self.place
        return None if place is None else place.tree

    @property
    def owner(self) -> Tree:
        """The tree that this node belongs to.

        Raises:
            NodeError: the node is not part of a tree yet.
        """
        return self._place.tree

    @property
    def board(self) -> Blackboard:
        """The blackboard of the enclosing SubTree."""
        return self._place.board

    @property
    def _place(self) -> NodePlace:
        place = self.place
        if place is None:
            raise NodeError("the node is not part of a tree yet; build one with build_tree()", node=self.name)
        return place

    @property
    def context(self) -> Any:
        """The application's object that was passed when the tree was loaded."""
        return self._place.tree.context

    @property
    def clock(self) -> EngineClock:
        """The tree's clock."""
        return self._place.tree.clock

    def wake_up(self) -> None:
        """End the tick loop's sleep: the tree is ticked again immediately. Thread-safe."""
        self.owner.wake_up()

    def get_input(self, port: str) -> Any:
        """Return the value of an input port, converted to the port's type.

        An optional port without a value returns its default, or None.

        Raises:
            NodeError: a required port has no value, or a value has another type.
        """
        reader = self._readers.get(port)
        if reader is None:
            reader = make_reader(self, port)
            self._readers = {**self._readers, port: reader}
        return reader()

    def set_output(self, port: str, value: Any) -> None:
        """Write a value to the blackboard entry that an output port is mapped to; do nothing if it is not mapped.

        Raises:
            NodeError: the node has no such output port, or the value does not fit its type.
        """
        writer = self._writers.get(port)
        if writer is None:
            writer = make_writer(self, port)
            self._writers = {**self._writers, port: writer}
        writer(value)

    def wrong_input(self, message: str) -> Exception:
        """Return the error for a value that an input port does not accept."""
        return self.error(message)

    def error(self, message: str) -> NodeError:
        """Return a ``NodeError`` that names this node and its ancestors."""
        trace = [f"{node.where or node.path} [{node.type_id}]" for node in upwards(self) if isinstance(node, Node)]
        return NodeError(
            message, node=self.path, node_type=self.type_id, where=self.where, backtrace=list(reversed(trace))
        )

    @property
    def where(self) -> str:
        """The node's name with file and line, for messages; empty if the tree does not come from a file."""
        if self.place is None or self.place.file.startswith("<"):
            return ""
        file = Path(self.place.file).name
        return f"{self.name} ({file}:{self.line})" if self.line else f"{self.place.prefix}{self.name} ({file})"

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders of the file that defines the node and of its tree's file; empty if the tree has no file."""
        files = () if self.place is None else (self.place.file, self.place.tree.file)
        return tuple(dict.fromkeys(Path(file).resolve().parent for file in files if not file.startswith("<")))

    @property
    def type_id(self) -> str:
        """The registered name of the node's class."""
        return self.info.name if self.info is not None else type(self).__name__

    def full_path(self) -> str:
        """Return the path: the enclosing SubTrees, then the name (with ``::uid`` if the name is the type's)."""
        suffix = f"::{self.uid}" if self.name == self.type_id and self.uid else ""
        prefix = "" if self.place is None else self.place.prefix
        return prefix + self.name + suffix

    @property
    def state(self) -> int:
        """The engine's status: IDLE, RUNNING, SUCCESS or FAILURE."""
        code = self._s
        return code if code > 0 else IDLE

    @property
    def last_result(self) -> int:
        """The last result of an idle node (IDLE if none, or after a halt), else its state."""
        return abs(self._s)

    def set_state(self, state: int) -> None:
        """Store a status other than IDLE, and log the change. Raises NodeError for another value."""
        if self._s != state:
            if state not in (RUNNING, SUCCESS, FAILURE):
                raise self.error(describe_bad_status(state))
            self._s = state
            if self.log is not None:
                self.log.append(self.ev[state])

    def reset_status(self) -> None:
        """Set the node to idle and log the change."""
        code = self._s
        if code > 0:
            self._s = 0 if code == RUNNING else -code
            if self.log is not None:
                self.log.append(self.ev[0])

    def execute_tick(self) -> int:
        """Tick this node and store the returned status: the general form of what parents do.

        Raises NodeError naming the node if its tick raises or returns an invalid status.
        """
        try:
            status = self.run()
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, self) from error
        if status != SKIPPED:
            if status == RUNNING and self.SYNCHRONOUS:
                self.refuse_running()
            if self._s != status:
                self.set_state(status)
        return status

    def refuse_running(self) -> None:
        """Raise the error for a synchronous leaf that returned RUNNING; its state is RUNNING afterwards."""
        self.set_state(RUNNING)
        raise self.error("it must not return RUNNING; derive it from StatefulAction")

    def begin_running(self) -> None:
        """Set the state to RUNNING without logging it; refuse this for a synchronous leaf."""
        if self.SYNCHRONOUS:
            self.refuse_running()
        self._s = RUNNING

    def halt_node(self) -> None:
        """Halt the node, then run its ``_onHalted`` script.

        Raises NodeError naming the node, which is idle then, if one of them raises.
        """
        order = self.order
        if order is not None:
            order.withheld = None
            if order.waiting:  # it has not started
                order.waiting = False
                self.reset_status()
                return
        try:
            self.halt()
            if self.conditions is not None and self.conditions.on_halted is not None:
                self.conditions.on_halted()
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            self.reset_status()
            raise wrapped(error, self) from error

    def halt_child(self, child: Node) -> None:
        """Halt a child if it is running, and make it idle."""
        code = child._s
        if code > 0:
            if code == RUNNING:
                child.halt_node()
            child.reset_status()

    def reset_children(self) -> None:
        """Halt the running children and make all of them idle, in order."""
        for child in self.children:
            self.halt_child(child)  # type: ignore[arg-type]  # native ones have what it uses

    def nodes_below(self) -> list[Node]:
        """Return the children as engine nodes."""
        return self.children  # type: ignore[return-value]

    def bind(self, log: list[Any] | None, visited: list[Node] | None) -> None:
        """Choose ``run``; children are bound before their parent.

        Args:
            log: receives a ``state_code`` for every state change; None without listeners.
            visited: receives every ticked node, for py_trees' visitors; None without them.
        """
        self.log = log
        order = self.order
        if log is None and visited is None and self.hooks is None and self.conditions is None and order is None:
            self.bind_children(None)
            self.run = self.bound(self.tick_bare or self.on_tick)
            return
        fast = self.tick_bare if log is None else self.tick_traced
        core: Tick = self.on_tick if fast is None else fast
        if log is not None:
            base = state_code(self.uid, IDLE)
            self.ev = (base, base + 1, base + 2, base + 3)
        if order is not None:
            core = in_order(self, core, order)
        hooks = self.hooks
        if hooks is not None and (hooks.pre or hooks.monitor):
            core = with_pre_hooks(self, core, hooks)
        if self.conditions is not None:
            core = with_conditions(self, core, self.conditions)
        if hooks is not None and hooks.post:
            core = with_post_hooks(self, core, hooks)
        self.bind_children(log)
        core = self.bound(core)
        if visited is not None:
            core = with_visits(self, core, visited)
        self.run = core

    def bind_children(self, log: list[Any] | None) -> None:
        """Collect the tick functions of the children."""

    def refuse(self, instead: Tick) -> None:
        """Call ``instead`` wherever this node or one of its children would be ticked, until the next ``bind``."""
        self.run = instead

    def bound(self, core: Tick) -> Tick:
        """Return ``core`` with the wrapper that the node's kind needs, if any."""
        return core

    def add_pre_tick(self, callback: PreTick, *, rebind: bool = True) -> None:
        """Call ``callback(node)`` before each tick; SUCCESS, FAILURE or SKIPPED returned from it replaces the tick.

        With ``rebind=False`` it takes effect at the next ``tree.rebind()``: for callbacks on many nodes.
        """
        self._hooked().pre.append(callback)
        if rebind:
            self.owner.rebind()

    def add_post_tick(self, callback: PostTick, *, rebind: bool = True) -> None:
        """Call ``callback(node, status)`` after each tick; SUCCESS or FAILURE returned from it replaces the status."""
        self._hooked().post.append(callback)
        if rebind:
            self.owner.rebind()

    def add_tick_monitor(self, callback: PostTick, *, rebind: bool = True) -> None:
        """Call ``callback(node, status)`` after each tick that was executed, before the post-tick callbacks."""
        self._hooked().monitor.append(callback)
        if rebind:
            self.owner.rebind()

    def remove_hook(self, callback: Callable[..., Any], *, rebind: bool = True) -> None:
        """Remove a callback from all hooks of this node."""
        hooks = self._hooked()
        for kind in (hooks.pre, hooks.post, hooks.monitor):
            while callback in kind:
                kind.remove(callback)
        if not (hooks.pre or hooks.post or hooks.monitor):
            self.hooks = None
        if rebind:
            self.owner.rebind()

    def _hooked(self) -> Hooks:
        if self.hooks is None:
            self.hooks = Hooks()
        return self.hooks
