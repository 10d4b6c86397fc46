"""The blackboard: one per SubTree, linked to its parent by remapping that is resolved once, to a slot.

A ``Slot`` is one entry. Nodes and scripts hold slots, never keys, so that a read at tick time is one attribute access.
Entries are locked to the type of their first typed use. Values are mirrored into py_trees' blackboard under
``/<tree>/<subtree path>/<key>`` for its display and activity stream; each tree has a unique name there, and the engine
never reads the mirror. A tree with native behaviours shares its top blackboard with py_trees instead
(``SharedEntries``).
"""

from __future__ import annotations

import gc
import itertools
import uuid
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.blackboard import ActivityItem, ActivityType, Client, KeyMetaData
from py_trees.blackboard import Blackboard as PyTreesBlackboard

from bestman_bt.engine.conversion import UNTYPED, ConverterRegistry, cast, compatible, type_name
from bestman_bt.engine.errors import BlackboardError, ConversionError

Watcher = Callable[["Slot", Any], None]
"""Called after a write with the slot (its new value inside) and the previous value."""


def key_fault(key: str) -> str:
    """Return why the key of an entry is invalid; empty if it is valid."""
    if key and key != "@" and key.count("@") <= 1:
        return ""
    return f"'{key}' is not a key (it must not be empty; '@' is allowed once, at the front)"


@dataclass(frozen=True)
class Entry:
    """A snapshot of one blackboard entry: value, number of writes, clock time of the last write in seconds, type."""

    key: str
    value: Any
    sequence: int
    stamp: float
    type: str


class TreeKey(KeyMetaData):
    """The metadata of py_trees for keys that mirror a tree's entries."""


class Store:
    """State shared by the blackboards of one tree: the time of the current tick, converters, the py_trees mirror.

    ``found``: the keys that had a value before the top blackboard was shared with py_trees; None if it is not shared.
    """

    __slots__ = (
        "__weakref__",
        "client",
        "converters",
        "found",
        "mirror",
        "name",
        "now",
        "observed",
        "paths",
        "watchers",
    )

    def __init__(self, name: str, converters: ConverterRegistry | None = None) -> None:
        self.name = name
        self.now = 0.0
        self.converters = converters or ConverterRegistry()
        self.mirror = PyTreesBlackboard.storage
        self.watchers: list[Watcher] = []
        self.observed = False
        self.client = uuid.uuid4()
        self.paths: dict[str, KeyMetaData] = {}
        self.found: frozenset[str] | None = None
        PyTreesBlackboard.clients[self.client] = name
        weakref.finalize(self, _forget, self.paths, self.client)

    def show(self, path: str) -> None:
        """Register a key with py_trees' blackboard; all keys of a tree belong to one client, the tree."""
        if self.found is not None and not path.startswith(f"/{self.name}/"):
            metadata = PyTreesBlackboard.metadata.setdefault(path, KeyMetaData())
            metadata.read.add(self.client)  # a writer would deny others exclusive access
            if path not in self.found:
                self.paths[path] = metadata
            return
        metadata = next((key for key in self.paths.values() if isinstance(key, TreeKey)), None) or TreeKey()
        metadata.read.add(self.client)
        metadata.write.add(self.client)
        self.paths[path] = PyTreesBlackboard.metadata[path] = metadata

    def hide(self, path: str) -> None:
        """Remove a key from py_trees' blackboard."""
        self.paths.pop(path, None)
        PyTreesBlackboard.metadata.pop(path, None)
        PyTreesBlackboard.storage.pop(path, None)

    def refuse_if_exclusive(self, slot: Slot) -> None:
        """Raise BlackboardError if a native behaviour has exclusive write access to an entry."""
        metadata = PyTreesBlackboard.metadata.get(slot.path)
        if metadata is not None and metadata.exclusive:
            owner = PyTreesBlackboard.clients.get(next(iter(metadata.exclusive)), "unknown")
            raise BlackboardError(
                f"entry '{slot.key}' cannot be set: the py_trees client '{owner}' has exclusive write access to it"
            )

    def look_for_observers(self) -> None:
        """Update whether every write is observed, by a watcher of all keys or py_trees' activity stream."""
        self.observed = bool(self.watchers) or PyTreesBlackboard.activity_stream is not None

    def stream(self, slot: Slot, previous: Any, writer: Any) -> None:
        """Report one write to py_trees' activity stream; the writer is a node, or None for scripts and external
        code.
        """
        kind = ActivityType.INITIALISED if previous is None else ActivityType.WRITE
        name, client = (self.name, self.client) if writer is None else (writer.name, writer.id)
        if PyTreesBlackboard.activity_stream is not None:
            PyTreesBlackboard.activity_stream.push(
                ActivityItem(slot.path, name, client, kind.value, previous, slot.value)
            )


def _forget(paths: dict[str, KeyMetaData], client: uuid.UUID) -> None:
    """Remove a discarded tree's values from py_trees' blackboard."""
    for path, metadata in paths.items():
        if PyTreesBlackboard.metadata.get(path) is metadata:
            metadata.read.discard(client)
            if isinstance(metadata, TreeKey) or not (metadata.read or metadata.write or metadata.exclusive):
                PyTreesBlackboard.metadata.pop(path)
            PyTreesBlackboard.storage.pop(path, None)
    PyTreesBlackboard.clients.pop(client, None)


_names = itertools.count(2)


def _unique_name(name: str) -> str:
    """Return ``name``, or ``name#N`` where another living tree already mirrors its values under ``name``."""
    if name in PyTreesBlackboard.clients.values():
        return f"{name}#{next(_names)}"
    return name


class Slot:
    """One entry. ``value`` is None while it is empty; ``exists`` is False until it is declared or written."""

    __slots__ = ("exists", "key", "kind", "path", "sequence", "stamp", "store", "value", "watchers")

    def __init__(self, key: str, path: str, store: Store) -> None:
        self.key = key
        self.path = path
        self.store = store
        self.value: Any = None
        self.sequence = 0
        self.stamp = 0.0
        self.kind: Any = None
        self.exists = False
        self.watchers: tuple[Watcher, ...] = ()

    def write(self, value: Any, writer: Any = None) -> None:
        """Store a value that already has the right type, and notify the watchers."""
        previous = self.value
        store = self.store
        self.value = value
        self.exists = True
        self.sequence += 1
        self.stamp = store.now
        store.mirror[self.path] = value
        if self.watchers or store.observed:
            self.notify(previous, writer)

    def notify(self, previous: Any, writer: Any = None) -> None:
        """Call the watchers after a write."""
        if PyTreesBlackboard.activity_stream is not None:
            self.store.stream(self, previous, writer)
        for watcher in (*self.watchers, *self.store.watchers):
            watcher(self, previous)

    def declare(self, data_type: Any) -> None:
        """Make the entry exist, as a port that uses it does at load; the first port decides its type.

        Raises:
            BlackboardError: the entry has another type and does not hold a string that can be converted.
        """
        untyped = data_type in UNTYPED
        if not self.exists:
            self.exists = True
            self.kind = None if untyped else data_type
        elif not (untyped or self.kind is None or self.kind is str or compatible(self.kind, data_type)):
            raise BlackboardError(
                f"entry '{self.key}' is used as {type_name(data_type)} but was declared as {type_name(self.kind)}"
            )

    def assign(self, value: Any, writer: Any = None) -> None:
        """Store a value from outside the scripts: the first typed value locks the type, later ones must fit.

        Raises:
            BlackboardError: the value does not fit the type that the entry is locked to.
        """
        if value is None:
            self.write(None, writer)
            return
        if self.kind is None:
            if self.exists or not isinstance(value, str):
                self.kind = type(value)
        elif type(value) is not self.kind:
            value = self._fit(value)
        self.write(value, writer)

    def take(self, value: Any, kind: Any) -> None:
        """Store the value that a native py_trees behaviour wrote under this entry's key, and notify the watchers.

        ``kind``: the type that a port declares, which the value must fit, also after the entry was cleared; None: any.

        Raises:
            BlackboardError: the value does not fit.
        """
        self.kind = kind
        if kind is not None and value is not None and type(value) is not kind:
            value = self.store.mirror[self.path] = self._fit(value)
        previous, self.value = self.value, value
        self.exists = True
        self.sequence += 1
        self.stamp = self.store.now
        for watcher in (*self.watchers, *self.store.watchers):
            watcher(self, previous)

    def _fit(self, value: Any) -> Any:
        if self.kind is str and not isinstance(value, str):
            raise BlackboardError(
                f"entry '{self.key}' is locked to str and cannot take {value!r} ({type(value).__name__})"
            )
        try:
            return cast(value, self.kind, self.store.converters)
        except ConversionError as error:
            raise BlackboardError(f"entry '{self.key}' is locked to {type_name(self.kind)}: {error}") from error

    def clear(self) -> None:
        """Remove the entry: it no longer exists, and its type is free again."""
        self.value = None
        self.exists = False
        self.kind = None
        self.sequence = 0
        self.store.mirror.pop(self.path, None)


class Blackboard:
    """The blackboard of one SubTree.

    Keys that the SubTree remaps refer to the parent's entry; with ``autoremap`` this applies to all keys that do not
    start with ``_``. ``@key`` refers to the topmost blackboard.
    """

    __slots__ = ("_resolved", "_slots", "autoremap", "parent", "path", "remapping", "store")

    def __init__(
        self,
        name: str = "blackboard",
        parent: Blackboard | None = None,
        *,
        converters: ConverterRegistry | None = None,
    ) -> None:
        self.parent = parent
        self.store = Store(_unique_name(name), converters)
        self.path = ""
        self.remapping: dict[str, str] = {}
        self.autoremap = False
        self._slots: dict[str, Slot] = {}
        self._resolved: dict[str, Slot] = {}

    def child(self, path: str, remapping: dict[str, str], *, autoremap: bool = False) -> Blackboard:
        """Return a new blackboard for the SubTree at ``path``; ``remapping``: its keys → keys of this blackboard."""
        board = object.__new__(Blackboard)
        board.parent = self
        board.store = self.store
        board.path = path
        board.remapping = remapping
        board.autoremap = autoremap
        board._slots = {}
        board._resolved = {}
        return board

    @property
    def root(self) -> Blackboard:
        """The topmost blackboard, which holds the entries of ``@key``."""
        board = self
        while board.parent is not None:
            board = board.parent
        return board

    def slot(self, key: str) -> Slot:
        """Return the slot that ``key`` refers to from here; for an unknown key, create a slot without a value."""
        slot = self._resolved.get(key) or self._slots.get(key)
        if slot is None:
            slot = self._resolve(key)
        return slot

    def _resolve(self, key: str) -> Slot:
        if fault := key_fault(key):
            raise BlackboardError(fault)
        if key[0] == "@":
            slot = self.root.slot(key[1:])
        elif self.parent is not None and key in self.remapping:
            slot = self.parent.slot(self.remapping[key])
        elif self.parent is not None and self.autoremap and key[0] != "_":
            slot = self.parent.slot(key)
        else:
            return self.local_slot(key)
        self._resolved[key] = slot
        return slot

    def slot_to_write(self, key: str) -> Slot:
        """Return the slot for a port that declares or writes ``key``.

        It is the slot that is read, except where a SubTree maps a key to ``@outer``: as in BehaviorTree.CPP, writing
        then creates an entry named ``@outer`` in the enclosing tree.
        """
        return self.root._made(key[1:]) if key[:1] == "@" else self._made(key)

    def _made(self, key: str) -> Slot:
        slot = self._slots.get(key)
        if slot is not None and slot.exists:
            return slot
        if self.parent is not None:
            outer = self.remapping.get(key)
            if outer is None and self.autoremap and key[:1] != "_":
                outer = key
            if outer is not None:
                return self.parent._made(outer)
        self.slot(key)  # a key with '@' is read at the root, whatever is made here
        return self.local_slot(key)

    def local_slot(self, key: str) -> Slot:
        """Return this blackboard's own slot for ``key``, ignoring the remapping (for SubTree literals)."""
        slot = self._slots.get(key)
        if slot is None:
            path = self.local_path(key)
            slot = self._slots[key] = Slot(key, path, self.store)
            self.store.show(path)
        return slot

    def local_path(self, key: str) -> str:
        """Return the name of this blackboard's own entry ``key`` on py_trees' blackboard."""
        if self.store.found is not None and not self.path:
            return f"/{key}"
        middle = f"{self.path}/" if self.path else ""
        return f"/{self.store.name}/{middle}{key}"

    def shared_key(self, key: str) -> str:
        """Return the local name of an entry of a blackboard that is shared with py_trees: ``steps`` for ``/steps``."""
        return key.lstrip("/") if self.store.found is not None and not self.path else key

    def is_registered(self, key: str) -> bool:
        """Return whether a client of py_trees has registered an entry, which may have no value yet."""
        metadata = PyTreesBlackboard.metadata.get(self.local_path(key))
        return metadata is not None and not isinstance(metadata, TreeKey)

    def registered(self) -> list[str]:
        """Return the entries of a shared blackboard that clients of py_trees have registered."""
        if self.store.found is None or self.path:
            return []
        return [path.lstrip("/") for path, one in PyTreesBlackboard.metadata.items() if not isinstance(one, TreeKey)]

    def share(self) -> None:
        """Share the entries of this root blackboard with py_trees' blackboard."""
        store = self.store
        store.found = frozenset(PyTreesBlackboard.storage)
        for key, slot in self._slots.items():
            store.hide(slot.path)
            slot.path = self.local_path(key)
            store.show(slot.path)
            if slot.value is not None:
                store.mirror[slot.path] = slot.value

    def get(self, key: str, default: Any = None) -> Any:
        """Return the value of ``key``, or ``default`` while it is missing or empty."""
        value = self.slot(key).value
        return default if value is None else value

    def __getitem__(self, key: str) -> Any:
        value = self.slot(key).value
        if value is None:
            known = ", ".join(sorted(self.keys())) or "none"
            raise BlackboardError(f"entry '{key}' has no value (entries here: {known})")
        return value

    def set(self, key: str, value: Any) -> None:
        """Store a value.

        Raises:
            BlackboardError: the value does not fit the locked type of the entry, or a native py_trees behaviour has
                exclusive write access.
        """
        slot = self.slot(key)
        if self.store.found is not None:
            self.store.refuse_if_exclusive(slot)
        self.store.look_for_observers()
        slot.assign(value)

    __setitem__ = set

    def unset(self, key: str) -> None:
        """Remove one of this blackboard's own entries; remapped keys are left alone, as in BehaviorTree.CPP."""
        slot = self._slots.get(key)
        if slot is not None:
            slot.clear()

    def slots(self) -> list[Slot]:
        """Return this blackboard's own slots, including those that do not exist yet."""
        return list(self._slots.values())

    def keys(self) -> list[str]:
        """Return the keys of this blackboard's own entries, in the order of creation."""
        return [key for key, slot in self._slots.items() if slot.exists]

    def __contains__(self, key: str) -> bool:
        return self.slot(key).exists

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def items(self) -> list[tuple[str, Any]]:
        """Return key and value of this blackboard's own entries; empty ones have the value None."""
        return [(key, slot.value) for key, slot in self._slots.items() if slot.exists]

    def entry(self, key: str) -> Entry:
        """Return the snapshot of an entry.

        Raises:
            BlackboardError: there is no such entry.
        """
        slot = self.slot(key)
        if not slot.exists:
            raise BlackboardError(f"there is no entry '{key}' (entries here: {', '.join(sorted(self.keys()))})")
        kind = "any" if slot.kind is None else type_name(slot.kind)
        return Entry(key, slot.value, slot.sequence, slot.stamp, kind)

    def subscribe(self, key: str | None, watcher: Watcher) -> Callable[[], None]:
        """Call ``watcher(slot, previous)`` after each write of ``key`` (None: of any key of the whole tree).

        Returns a function that ends the subscription.
        """
        if key is None:
            self.store.watchers.append(watcher)
            self.store.look_for_observers()
            return lambda: self.store.watchers.remove(watcher)
        slot = self.slot(key)
        slot.watchers = (*slot.watchers, watcher)

        def unsubscribe() -> None:
            slot.watchers = tuple(w for w in slot.watchers if w is not watcher)

        return unsubscribe


_MISSING: Final = object()


class SharedEntries:
    """Entries shared with py_trees: ``steps`` of the top blackboard is its key ``/steps``, ``ns/steps`` is
    ``/ns/steps``.

    Writes of nodes, scripts and external code reach py_trees immediately; ``take_over`` imports the writes of native
    behaviours. The type that a port declares also binds native writers; other types may change freely. Construct it
    from a shared blackboard after the tree's ports have declared their entries. The clients of ``behaviours`` lose
    their keys when the tree is garbage-collected, so that the next tree of the same kind can get exclusive access
    again.
    """

    def __init__(self, board: Blackboard, behaviours: Iterable[Behaviour]) -> None:
        weakref.finalize(board.store, _unregister, [behaviour.blackboards for behaviour in behaviours])
        self._board = board
        self._slots: dict[str, Slot | None] = {}
        self._kinds = {slot: slot.kind for slot in board.slots()}
        self.take_over()

    def take_over(self) -> None:
        """Import the values of py_trees' keys into the entries.

        Raises:
            BlackboardError: a value does not fit the type that a port declares.
        """
        storage, slots = PyTreesBlackboard.storage, self._slots
        for path in storage.keys() - slots.keys():
            slots[path] = self._slot_of(path)
        for path, slot in slots.items():
            if slot is None:
                continue
            value = storage.get(path, _MISSING)
            if value is _MISSING:
                if slot.sequence:
                    slot.clear()
            elif value is not slot.value:
                slot.take(value, self._kinds.get(slot))

    def _slot_of(self, path: str) -> Slot | None:
        """Return the entry that is py_trees' key, or None if it is one of another blackboard of a tree."""
        if isinstance(PyTreesBlackboard.metadata.get(path), TreeKey):
            return None
        try:
            return self._board.slot(path.lstrip("/"))
        except BlackboardError:  # no name of an entry
            return None


def _unregister(clients: list[list[Client]]) -> None:
    for client in (one for attached in clients for one in attached):
        with suppress(KeyError):  # py_trees' blackboard has been cleared
            client.unregister(clear=False)


def forget_dropped_trees() -> None:
    """Remove the keys of trees that are no longer referenced, before their behaviours are created again.

    Otherwise values of an earlier run would be read, and exclusive access would be refused.
    """
    if any(not isinstance(metadata, TreeKey) for metadata in PyTreesBlackboard.metadata.values()):
        gc.collect()
