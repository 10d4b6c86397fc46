"""requirements.lock pins, with hashes, what pyproject.toml asks for, and names no place to fetch it from."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CHECKOUT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())
LOCK = (CHECKOUT / "requirements.lock").read_text()
ENTRY = re.compile(
    r"^(?P<requirement>[A-Za-z0-9].*?)\s*\\\n(?P<hashes>(?:\s+--hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", re.M
)


def direct_requirements() -> list[str]:
    groups = PROJECT["dependency-groups"]
    grouped = [item for group in groups.values() for item in group if isinstance(item, str)]
    extras = PROJECT["project"]["optional-dependencies"]
    in_a_checkout = [item for extra in sorted(Requirement(extras["all"][0]).extras) for item in extras[extra]]
    return [*PROJECT["project"]["dependencies"], *in_a_checkout, *grouped]


def locked() -> list[Requirement]:
    return [Requirement(match["requirement"]) for match in ENTRY.finditer(LOCK)]


def test_every_entry_has_a_hash() -> None:
    entries = [line for line in LOCK.splitlines() if re.match(r"[A-Za-z0-9]", line)]
    assert len(entries) == len(locked())


def test_no_address_is_written_into_the_lock() -> None:
    assert not re.search(r"://|--index|--find-links|--extra| @ ", LOCK)


@pytest.mark.parametrize("text", direct_requirements())
def test_the_lock_satisfies_the_range_in_pyproject(text: str) -> None:
    wanted = Requirement(text)
    pins = [pin for pin in locked() if canonicalize_name(pin.name) == canonicalize_name(wanted.name)]
    assert pins, f"{wanted.name} is not locked; run make lock"
    for pin in pins:
        (specifier,) = pin.specifier
        assert wanted.specifier.contains(specifier.version), f"{pin} is outside {wanted}; run make lock"


def test_no_machine_learning_framework_comes_in() -> None:
    names = {canonicalize_name(pin.name) for pin in locked()}
    assert not {name for name in names if re.match(r"(torch|tensorflow|jax|nvidia|cuda|triton)", name)}
