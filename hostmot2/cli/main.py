"""`hm2`: the options before the command, the list of commands, and what happens to errors."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

import click

from hostmot2.cli import failure
from hostmot2.cli.session import Session

COMMANDS: dict[str, str] = {
    "info": "hostmot2.cli.identify:info",
    "modules": "hostmot2.cli.identify:modules",
    "pins": "hostmot2.cli.identify:pins",
    "peek": "hostmot2.cli.registers:peek",
    "poke": "hostmot2.cli.registers:poke",
    "dump": "hostmot2.cli.dump:dump",
    "diff": "hostmot2.cli.dump:diff",
    "sserial": "hostmot2.cli.sserial:sserial",
    "bench": "hostmot2.bench.command:bench",
    "discover": "hostmot2.cli.ethernet:discover_cards",
    "ip": "hostmot2.cli.ethernet:ip",
    "flash": "hostmot2.cli.ethernet:flash",
    "reload": "hostmot2.cli.ethernet:reload",
    "emulate": "hostmot2.cli.emulate:emulate",
    "emu": "hostmot2.cli.emulate:emu",
    "explain": "hostmot2.cli.explain:explain",
    "setup": "hostmot2.cli.setup:setup",
    "rpd": "hostmot2.cli.serial_remote:rpd",
    "wpd": "hostmot2.cli.serial_remote:wpd",
    "param": "hostmot2.cli.param:param",
    "uflbp": "hostmot2.cli.uflbp:uflbp",
    "emulate-remote": "hostmot2.cli.emulate_remote:emulate_remote",
    "record": "hostmot2.cli.recording:record",
    "play": "hostmot2.cli.recording:play",
    "plot": "hostmot2.cli.recording:plot",
    "export": "hostmot2.cli.recording:export",
}
"""Name -> module:command. A module is imported when its command is used, so that `hm2 info` is quick."""

DEBUG_VARIABLE = "HM2_DEBUG"


class Commands(click.Group):
    """The commands of the table above."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All names, in the table's order."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported now; None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        module, attribute = COMMANDS[cmd_name].split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command


@click.command(
    cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(package_name="hostmot2")
@click.option(
    "--board", "url", metavar="URL", help="Which card: emu://5i25+7i77, pci://, udp://10.10.10.10, dump://F."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout.")
@click.pass_obj
def hm2(session: Session, url: str | None, as_json: bool) -> None:
    """Mesa FPGA cards running HostMot2.

    Without --board the card is $HM2_BOARD, and without that an emulated 5I25 with a 7I77. Exit codes: 0 ok,
    2 usage, 3 not found, 4 permission, 5 communication, 6 device fault, 7 busy.
    """
    session.url, session.as_json = url, as_json


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs one command and exits with its status."""
    warnings.showwarning = _warn
    session = Session()
    try:
        status = hm2.main(arguments, prog_name="hm2", standalone_mode=False, obj=session)
    except click.exceptions.Exit as end:
        status = end.exit_code
    except click.ClickException as error:
        status = failure.show_usage(error, as_json=session.as_json)
    except (click.Abort, KeyboardInterrupt):
        click.echo("hm2: interrupted", err=True)
        status = 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has seen enough
        status = 0
    except Exception as error:
        if os.environ.get(DEBUG_VARIABLE) or failure.exit_code(error) == 1:
            raise
        status = failure.show(error, as_json=session.as_json)
    sys.exit(status if isinstance(status, int) else 0)


def _warn(message: Warning | str, category: type[Warning], *_place: Any, **_more: Any) -> None:
    click.echo(f"hm2: {message}", err=True)
