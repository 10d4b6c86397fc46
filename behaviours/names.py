"""Ports that name things: a literal is compared with scene, map and robot before anything moves."""

from __future__ import annotations

from typing import Annotated

from bestman_bt.engine.bounds import Named

ObjectName = Annotated[str, Named("object")]
SurfaceName = Annotated[str, Named("surface")]
FurnitureName = Annotated[str, Named("furniture")]
ArticulationName = Annotated[str, Named("articulation")]
ArmName = Annotated[str, Named("arm")]
PostureName = Annotated[str, Named("posture")]
