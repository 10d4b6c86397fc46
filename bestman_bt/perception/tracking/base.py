"""Tracking: which seen things are which believed objects, and what has been moved, removed or added."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bestman_bt.perception.view import View
from bestman_bt.world_model import ObjectBelief, ObjectChange


@dataclass(frozen=True, eq=False)
class Tracked:
    """``objects``: everything believed after the view, by identity. ``changes``: what the view revealed.

    ``identities``: the identity of each sighting, in the order given.
    """

    objects: Mapping[str, ObjectBelief]
    changes: tuple[ObjectChange, ...]
    identities: tuple[str, ...]


class Tracker(ABC):
    """Keeps identities over views."""

    @abstractmethod
    def update(
        self,
        beliefs: Mapping[str, ObjectBelief],
        sightings: Sequence[ObjectBelief],
        view: View,
        drift: float = 0.0,
        taken: Sequence[str] = (),
    ) -> Tracked:
        """Explain ``sightings`` of one view by ``beliefs``; both and ``view`` in the map frame.

        A sighting carries its model's name as name. ``drift``: standard deviation of the map's error between views,
        metres. ``taken``: identities that no sighting may have, for example what the hand holds.
        """
