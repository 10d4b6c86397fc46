"""A small arm with a two-finger hand as URDF and SRDF, for reading and importing; shapes are boxes."""

from __future__ import annotations

from pathlib import Path

JOINTS = ("j1", "j2", "j3", "j4", "j5")


def arm_urdf(hand: bool = True, extra: str = "") -> str:
    """Five joints in a row, and, on the last link, two fingers that slide apart along y."""
    links = [_link("foot", (0.1, 0.1, 0.1), (0, 0, 0.05))]
    joints = []
    for number, name in enumerate(JOINTS):
        parent = "foot" if number == 0 else f"l{number}"
        axis = "0 0 1" if number % 2 == 0 else "0 1 0"
        links.append(_link(f"l{number + 1}", (0.05, 0.05, 0.16), (0, 0, 0.1)))
        joints.append(
            _joint(name, "revolute", parent, f"l{number + 1}", (0, 0, 0.2 if number else 0.1), axis, -2.5, 2.5)
        )
    if hand:
        links.append(_link("palm", (0.04, 0.12, 0.04), (0, 0, 0.02)))
        joints.append(_joint("wrist", "fixed", "l5", "palm", (0, 0, 0.2)))
        for side, sign in (("left", 1), ("right", -1)):
            mimic = "" if side == "left" else '<mimic joint="left_joint"/>'
            links.append(_link(f"{side}_finger", (0.02, 0.01, 0.06), (0, sign * 0.005, 0.03)))
            joints.append(
                _joint(
                    f"{side}_joint", "prismatic", "palm", f"{side}_finger", (0, 0, 0.04), f"0 {sign} 0", 0, 0.03, mimic
                )
            )
    return f'<robot name="small">{"".join(links)}{"".join(joints)}{extra}</robot>'


SRDF = """<robot name="small">
  <group name="arm"><chain base_link="foot" tip_link="l5"/></group>
  <group name="hand"><joint name="left_joint"/><joint name="right_joint"/></group>
  <group_state name="ready" group="arm">
    <joint name="j1" value="0"/><joint name="j2" value="0.5"/><joint name="j3" value="0"/>
    <joint name="j4" value="1.0"/><joint name="j5" value="0"/>
  </group_state>
  <group_state name="impossible" group="arm">
    <joint name="j1" value="9"/><joint name="j2" value="0"/><joint name="j3" value="0"/>
    <joint name="j4" value="0"/><joint name="j5" value="0"/>
  </group_state>
  <disable_collisions link1="foot" link2="l2" reason="Never"/>
  <disable_collisions link1="l4" link2="palm" reason="Never"/>
</robot>"""


def written(folder: Path, text: str, name: str = "small.urdf") -> Path:
    """A file in ``folder`` that holds ``text``."""
    path = folder / name
    path.write_text(text)
    return path


def _link(name: str, size: tuple[float, ...], at: tuple[float, ...]) -> str:
    x, y, z = at
    shape = f'<origin xyz="{x} {y} {z}"/><geometry><box size="{" ".join(map(str, size))}"/></geometry>'
    return f'<link name="{name}"><visual>{shape}</visual><collision>{shape}</collision></link>'


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    at: tuple[float, ...],
    axis: str = "0 0 1",
    lower: float = 0.0,
    upper: float = 0.0,
    more: str = "",
) -> str:
    limit = "" if kind == "fixed" else f'<limit lower="{lower}" upper="{upper}" velocity="2" effort="30"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{" ".join(map(str, at))}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )
