"""Addresses and tokens appear in no message, whatever else is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest

from bestman_bt.configuration.checked import check, override
from bestman_bt.configuration.document import parse_document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import dump_run, load_run, parse_settings
from bestman_bt.configuration.secret import Secret, shown_setting


@dataclass(frozen=True)
class Wire:
    """One connection."""

    address: Secret = ""
    port: int = 0


@dataclass(frozen=True)
class Machine:
    """What has connections. ``first``: one that may be missing; ``all``: those without names."""

    connections: Mapping[str, Wire] = field(default_factory=dict)
    first: Wire | None = None
    all: tuple[Wire, ...] = ()


@pytest.mark.parametrize(
    "written", ["{a: {address: [HIDDEN]}}", "{a: {address: {k: HIDDEN}}}", "{a: HIDDEN}", "HIDDEN"]
)
def test_a_secret_of_the_wrong_kind_is_not_shown(written: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        check(parse_document(f"connections: {written}", "m.yaml"), Machine)
    assert "HIDDEN" not in str(error.value)
    assert "its value is not shown" in str(error.value)


@pytest.mark.parametrize("written", ["first: {address: [HIDDEN]}", "first: HIDDEN", "all: [{address: [HIDDEN]}]"])
def test_a_secret_in_a_list_or_in_what_may_be_missing_is_not_shown(written: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        check(parse_document(written, "m.yaml"), Machine)
    assert "HIDDEN" not in str(error.value)


def test_a_wrong_secret_of_a_setting_is_reported_with_neither_old_nor_new_value() -> None:
    document = parse_document("connections: {a: {address: OLD}}", "m.yaml")
    changed = override(document, Machine, {"connections.a.address": ["HIDDEN"]}, prefix="robot.")
    with pytest.raises(ConfigurationError) as error:
        check(changed, Machine)
    assert str(error.value).startswith("--set robot.connections.a.address=…: connections.a.address: should be text")
    assert "HIDDEN" not in str(error.value)
    assert "OLD" not in str(error.value)


def test_a_dumped_run_has_no_address_and_no_token_and_the_rest_of_its_settings() -> None:
    settings = {
        "connections": "{a: {address: HIDDEN}}",
        "connections.b": "{token: HIDDEN}",
        "connections.c.address": "HIDDEN",
        "connections.c.token": "HIDDEN",
        "connections.c.port": "17",
        "parts.lidar.set.beams": "90",
    }
    run = load_run("fetch_cup", settings=[f"robot.{key}={value}" for key, value in settings.items()])
    assert run.robot_settings["connections.c.address"] == "HIDDEN"
    text = dump_run(run)
    assert "HIDDEN" not in text
    assert "connections.c.port: 17" in text
    assert "parts.lidar.set.beams: 90" in text


def test_what_is_no_secret_beside_it_is_shown() -> None:
    with pytest.raises(ConfigurationError, match="port: .*, got .many."):
        check(parse_document("connections: {a: {address: x, port: many}}", "m.yaml"), Machine)


@pytest.mark.parametrize("key", ["connections.b.address", "conections.a.address", "connections.a.adress", "a.token"])
def test_a_wrong_key_of_a_setting_does_not_show_its_value(key: str) -> None:
    document = parse_document("connections: {a: {}}", "m.yaml")
    with pytest.raises(ConfigurationError) as error:
        override(document, Machine, {key: "10.20.30.40"}, prefix="robot.")
    assert f"--set robot.{key}=…" in str(error.value)
    assert "10.20.30.40" not in str(error.value)


def test_a_setting_that_is_no_yaml_is_one_fault_without_its_value() -> None:
    with pytest.raises(ConfigurationError) as error:
        parse_settings(["robot.connections.a.token=[HIDDEN"])
    assert len(str(error.value).splitlines()) == 1
    assert "HIDDEN" not in str(error.value)


def test_only_keys_that_may_tell_a_secret_are_shortened() -> None:
    assert shown_setting("tick_rate=5") == "--set tick_rate=5"
    assert shown_setting("robot.connections.a.token:HIDDEN") == "--set robot.connect…"
    for key in ("ADDRESS", "password", "my_secret", "robot.connections.a", "ip_addr", "Token"):
        assert shown_setting(f"{key}=HIDDEN=HIDDEN") == f"--set {key}=…"
