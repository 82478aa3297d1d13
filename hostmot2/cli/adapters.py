"""hm2 discover --serial: adapters that a remote may hang on."""

from __future__ import annotations

from dataclasses import asdict
from importlib.util import find_spec

import click

from hostmot2.cli.session import Session, rows
from hostmot2.lbp.adapters import adapters

HEADER = ("port", "by", "USB id", "serial number", "description", "")


def report_adapters(context: click.Context, session: Session) -> None:
    """All serial ports and USB adapters; nothing is sent to any. Status 3 when there are none."""
    found = adapters()
    lines = [
        (a.port, a.driver, a.usb_id, a.serial_number, a.description, "FTDI" if a.likely else "")
        for a in found
    ]
    nothing = "no serial port or adapter"
    if find_spec("serial") is None:
        nothing = "listing serial ports needs pyserial: pip install 'hostmot2[serial]'"
    document = [asdict(adapter) | {"likely": adapter.likely} for adapter in found]
    session.report(document, rows(HEADER, lines) if lines else nothing)
    if not found:
        context.exit(3)
