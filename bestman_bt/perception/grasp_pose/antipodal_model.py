"""Antipodal grasps on a model's surface, found once per object.

Two contacts are antipodal where the line between them lies in both friction cones (Nguyen, "Constructing
Force-Closure Grasps", 1988). Contacts are sampled, rays through the solid give their opposites, and each pair is tried
with hands turned about the closing axis. The pads are then closed on the samples: thin walls (rims, handles) need no
case of their own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectGrasp, ObjectModel
from bestman_bt.perception.grasp_pose.contact_quality import ContactQuality
from bestman_bt.perception.grasp_pose.hand_placement import HandPlacement
from bestman_bt.perception.grasp_pose.hand_poses import different_hands, hands_about
from bestman_bt.perception.grasp_pose.hand_shape import HandShape, HandSize
from bestman_bt.perception.grasp_pose.pad_contact import close_pads
from bestman_bt.perception.grasp_pose.solid_surface import SolidSurface, solid_surface
from bestman_bt.robot_model import GripperModel


@dataclass(frozen=True)
class AntipodalModel:
    """Finds grasps on the model of an object.

    Metres, radians.

    ``samples``: about how many points the surface gets; ``contacts``: how many of them are tried as a first contact;
    ``pairs``: how many of the pairs that they make are looked at.
    ``friction``: of the cones, tangent of the half angle. ``turn``: between hands about one closing axis.
    ``bulge``: by how much the object may be wider between the fingers above the pads. ``patch_depth``: how far the pads
    give way.
    ``surface_clearance``: between open hand and object; the palm keeps what ``hand`` says besides.
    ``apart``, ``apart_angle``: two grasps nearer than both count as one.
    """

    samples: int = 2200
    contacts: int = 350
    pairs: int = 300
    friction: float = 0.5
    bulge: float = 0.004
    turn: float = math.radians(30.0)
    patch_depth: float = 0.0012
    surface_clearance: float = 0.002
    apart: float = 0.012
    apart_angle: float = math.radians(25.0)
    quality: ContactQuality = field(default_factory=ContactQuality)
    hand: HandPlacement = field(default_factory=HandPlacement)
    shape: HandSize = field(default_factory=HandSize)

    def grasps(
        self, model: ObjectModel, gripper: GripperModel, rng: np.random.Generator, count: int = 64
    ) -> tuple[ObjectGrasp, ...]:
        """Up to ``count`` different grasps of ``model``, best first; from all sides, since it may come to lie on any.

        Empty where the gripper cannot take it. Raises PerceptionError for a model without collision shapes.
        """
        rough = solid_surface(model, 0.010)
        spacing = 0.010 * math.sqrt(max(len(rough.points), 1) / self.samples)
        surface = solid_surface(model, spacing)
        starts, closing, widths = self._pairs(surface, gripper, rng)
        angles = np.arange(0.0, 2 * math.pi - 1e-9, self.turn)
        hands = hands_about(starts + closing * widths[:, None] / 2, closing, angles)
        contacts = close_pads(
            surface.points,
            surface.normals,
            hands,
            self.hand.openings(np.repeat(widths, len(angles)), gripper),
            gripper.part.pad_size,
            gripper.part.finger_depth,
            self.patch_depth,
        )
        widest = self.hand.widest(gripper)
        quality = self.quality.judge(
            hands, contacts, surface.centre_of_mass, gripper, widest=widest, friction=self.friction, bulge=self.bulge
        )
        # The pads decide where the middle is: the hand closes there, and both fingers have the same room.
        hands = hands.shifted(contacts.centre[:, 1], 1)
        tried = np.argsort(-quality, kind="stable")
        tried = tried[quality[tried] > 0.0]
        # The palm begins where the hand may reach no further over an object, a little before its true place.
        reach = self.hand.reach(gripper) + self.surface_clearance
        shape = HandShape(gripper, self.shape, reach)
        openings = self.hand.openings(contacts.width[tried], gripper)
        clear = shape.clearances(hands.selected(tried), openings, surface.points, 1.0)
        chosen = different_hands(hands, tried[clear > self.surface_clearance], count, self.apart, self.apart_angle)
        return tuple(
            ObjectGrasp(hands.pose(index), float(contacts.width[index]), float(quality[index])) for index in chosen
        )

    def _pairs(
        self, surface: SolidSurface, gripper: GripperModel, rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], ...]:
        """First contacts (P, 3), unit closing directions (P, 3) and distances (P,) of antipodal pairs."""
        chosen = rng.permutation(len(surface.points))[: self.contacts]
        points, inward = surface.points[chosen], -surface.normals[chosen]
        found = [(points, inward, inward, *surface.opposite(points, inward, last)) for last in (False, True)]
        for last in (False, True):
            _, _, _, ends, leaving = found[int(last)]
            # Where the faces are not parallel, the line half way between their normals lies deepest in both cones.
            between = inward + leaving
            length = np.linalg.norm(between, axis=1)
            usable = np.isfinite(ends).all(axis=1) & (length > 1.0)
            line = between[usable] / length[usable, None]
            found.append((points[usable], inward[usable], line, *surface.opposite(points[usable], line, last)))
        starts, starting, lines, ends, leaving = (np.concatenate(parts) for parts in zip(*found, strict=True))
        widths = np.linalg.norm(ends - starts, axis=1)
        cone = math.cos(math.atan(self.friction))
        with np.errstate(invalid="ignore"):
            antipodal = (np.einsum("ij,ij->i", lines, starting) >= cone) & (
                np.einsum("ij,ij->i", lines, leaving) >= cone
            )
            antipodal &= (widths > gripper.part.min_width) & (widths <= self.hand.widest(gripper))
        # First and last exit are often the same.
        _, once = np.unique(np.round(np.column_stack([starts, lines, widths]), 6), axis=0, return_index=True)
        kept = np.sort(once[antipodal[once]])
        kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), self.pairs)).astype(np.intp)]
        return starts[kept], lines[kept], widths[kept]
