"""hm2 uflbp: new firmware for a remote, through an adapter or through the card."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import FrameType
from typing import Any

import click

from hostmot2.cli.progress import stages
from hostmot2.cli.remote_place import place_options, remote_in_place
from hostmot2.cli.serial_remote import port_options
from hostmot2.cli.session import Session, reports
from hostmot2.lbp.errors import UpdateFailed
from hostmot2.lbp.firmware import Firmware, Plan, plan, read_firmware, update


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--dry-run", is_flag=True, help="Check file and remote, say what would be done, change nothing."
)
@click.option("--resume", is_flag=True, help="Go on behind the last block of an interrupted update.")
@place_options
@port_options
@reports
def uflbp(
    session: Session,
    file: Path,
    dry_run: bool,
    resume: bool,
    channel: tuple[int, int] | None,
    port: str | None,
    baud: int | None,
) -> None:
    """Write firmware FILE.BIN into a remote's flash.

    The remote must be in set-up mode, motor power off. Its name must be in the file's. Erase block 0 with
    the boot loader is never touched, so that an update that failed can be repeated; leave the power on until
    one is through. Then cycle the power and check the revision.

    \b
    Examples:
      hm2 uflbp 8I20_A50.BIN -p /dev/ttyUSB0 --dry-run
      hm2 uflbp 8I20_A50.BIN -p emu:8i20
      hm2 --board "emu://5i25+7i77?setup=1" uflbp 7I77_A15.BIN -c 0.1
    """
    firmware = read_firmware(file)
    with remote_in_place(session, channel, port, baud, flash=True) as remote:
        todo = plan(remote, firmware)
        facts = _facts(firmware, todo)
        said = (
            f"{todo.name} unit 0x{todo.unit_number:08X}: {len(todo.blocks)} blocks of "
            f"{todo.erase_size} bytes, {todo.skipped} without content left alone, block 0 untouched"
        )
        if dry_run:
            session.report(facts | {"written": 0}, f"would write {said}")
            return
        record = _Record(firmware, todo)
        done = record.done() if resume else 0
        if not done:
            record.forget()  # what was written before is about to be erased
        click.echo(f"hm2: {said}" + (f"; {done} done before" if done else ""), err=True)
        with stages() as advance, _no_interrupt() as interrupted:

            def after_block(count: int, total: int) -> None:
                record.keep(count)
                advance("blocks", count, total)
                if interrupted():
                    cut_short = KeyboardInterrupt()
                    cut_short.add_note(UpdateFailed.fix)
                    raise cut_short

            update(remote, firmware, todo, done=done, progress=after_block)
        record.forget()
    session.report(facts | {"written": len(todo.blocks) - done}, f"{file.name} written; now cycle the power")


def _facts(firmware: Firmware, todo: Plan) -> dict[str, Any]:
    return {
        "file": str(firmware.path),
        "sha256": firmware.digest,
        "remote": todo.name,
        "unit_number": todo.unit_number,
        "erase_size": todo.erase_size,
        "write_size": todo.write_size,
        "blocks": list(todo.blocks),
        "skipped": todo.skipped,
    }


class _Record:
    """How far the update of one remote with one file has come; it outlives the program."""

    def __init__(self, firmware: Firmware, todo: Plan) -> None:
        home = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
        self._path = home / "hostmot2" / f"uflbp-{todo.name}-{todo.unit_number:08X}.json"
        self._facts: dict[str, Any] = {
            "sha256": firmware.digest,
            "erase_size": todo.erase_size,
            "blocks": list(todo.blocks),
        }

    def done(self) -> int:
        """Blocks written before, 0 if that was another file."""
        try:
            found = json.loads(self._path.read_text())
            done = found.pop("done")
        except (OSError, ValueError, AttributeError, KeyError, TypeError, RecursionError):
            return 0
        told = isinstance(done, int) and 0 <= done <= len(self._facts["blocks"])
        return done if told and found == self._facts else 0

    def keep(self, done: int) -> None:
        """So many blocks are written. Without a place to write this, a resumed update begins anew."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with NamedTemporaryFile("w", dir=self._path.parent, delete=False) as beside:
                beside.write(json.dumps(self._facts | {"done": done}))
            os.replace(beside.name, self._path)
        except OSError as failure:
            click.echo(f"hm2: cannot keep the progress: {failure}", err=True)

    def forget(self) -> None:
        """The update is through, or begins anew."""
        with suppress(FileNotFoundError, NotADirectoryError):
            self._path.unlink()


@contextmanager
def _no_interrupt() -> Iterator[Any]:
    """Ctrl-C, or a closed terminal, waits for the end of the block: nothing stops between erase and write."""
    asked: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        asked.append(number)
        with suppress(OSError):  # the terminal may be gone
            click.echo("hm2: ending after this block", err=True)

    before = {
        number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    }
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
