"""Which controllers have answered: model, serial number, firmware."""

from __future__ import annotations

from collections.abc import Iterator

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable


def identity(subject: BroughtUpRobot) -> Iterator[Finding]:
    """The same as in an earlier part of this bring-up, where there is one."""
    for name, told in subject.identities().items():
        owed = subject.signed_serials.get(name, "")
        firmware = subject.signed_firmware.get(name, "")
        driver = subject.model.connections[name].driver
        if not told.serial_number and not owed:
            yield not_applicable(name, f"a controller behind {driver} tells no serial number")
            continue
        text = f"{told.model or driver}, serial number {told.serial_number or 'not told'}, firmware {told.firmware}"
        if owed and told.serial_number != owed:
            text += f"; the bring-up was begun with {owed}: begin it anew (--again)"
        elif firmware and told.firmware != firmware:
            text += f"; the bring-up was begun with firmware {firmware}: begin it anew (--again)"
        same = told.serial_number == (owed or told.serial_number) and told.firmware == (firmware or told.firmware)
        yield judged(name, same, text, model=told.model, serial_number=told.serial_number, firmware=told.firmware)
