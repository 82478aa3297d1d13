"""`hm2`: the options before the command, the list of commands, and what happens to errors."""

from __future__ import annotations

import importlib
import logging
import os
import select
import sys
import warnings
from collections.abc import Sequence
from typing import Any, TextIO

import click
from click.shell_completion import CompletionItem

from hostmot2.cli import failure
from hostmot2.cli.session import Session

SECTIONS: dict[str, dict[str, str]] = {
    "Look at a card": {
        "discover": "hostmot2.cli.ethernet:discover_cards",
        "info": "hostmot2.cli.identify:info",
        "modules": "hostmot2.cli.identify:modules",
        "pins": "hostmot2.cli.identify:pins",
        "peek": "hostmot2.cli.registers:peek",
        "poke": "hostmot2.cli.registers:poke",
        "dump": "hostmot2.cli.dump:dump",
        "diff": "hostmot2.cli.dump:diff",
        "monitor": "hostmot2.cli.monitor:monitor",
    },
    "Smart serial and remotes": {
        "sserial": "hostmot2.cli.sserial:sserial",
        "param": "hostmot2.cli.param:param",
        "rpd": "hostmot2.cli.serial_remote:rpd",
        "wpd": "hostmot2.cli.serial_remote:wpd",
        "uflbp": "hostmot2.cli.uflbp:uflbp",
    },
    "Record and measure": {
        "record": "hostmot2.cli.recording:record",
        "play": "hostmot2.cli.recording:play",
        "plot": "hostmot2.cli.recording:plot",
        "export": "hostmot2.cli.recording:export",
        "live": "hostmot2.cli.live:live",
        "bench": "hostmot2.bench.command:bench",
    },
    "Emulate": {
        "emulate": "hostmot2.cli.emulate:emulate",
        "emu": "hostmot2.cli.emulate:emu",
        "emulate-remote": "hostmot2.cli.emulate_remote:emulate_remote",
    },
    "Service of Ethernet cards": {
        "ip": "hostmot2.cli.ethernet:ip",
        "flash": "hostmot2.cli.ethernet:flash",
        "reload": "hostmot2.cli.ethernet:reload",
    },
    "When something is wrong, and this machine": {
        "doctor": "hostmot2.cli.doctor:doctor",
        "explain": "hostmot2.cli.explain:explain",
        "setup": "hostmot2.cli.setup:setup",
        "completion": "hostmot2.cli.completion:completion",
    },
}
"""Section of the help -> name -> module:command. A module is imported when its command is used, so that
`hm2 info` is quick."""

COMMANDS = {name: place for section in SECTIONS.values() for name, place in section.items()}

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

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands by section."""
        room = formatter.width - 2 - max(map(len, COMMANDS)) - 4
        for title, section in SECTIONS.items():
            commands = ((name, self.get_command(ctx, name)) for name in section)
            lines = [(name, command.get_short_help_str(room)) for name, command in commands if command]
            with formatter.section(title):
                formatter.write_dl(lines, col_max=max(map(len, COMMANDS)) + 2)


def _boards(_context: click.Context, _parameter: click.Parameter, typed: str) -> list[CompletionItem]:
    """What --board may be: cards on the PCI bus, addresses cards are shipped with, emulated ones."""
    from hostmot2.pci_cards import find_cards

    urls = [card.url for card in find_cards()]
    urls += ["udp://192.168.1.121", "udp://10.10.10.10", "emu://5i25+7i77", "emu://7i92+7i77", "dump://"]
    return [CompletionItem(url) for url in urls if url.startswith(typed)]


@click.command(
    cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110}
)
@click.version_option(package_name="hostmot2")
@click.option(
    "--board",
    "url",
    metavar="URL",
    shell_complete=_boards,
    help="Which card: emu://5i25+7i77, pci://, udp://10.10.10.10, dump://FILE. Else $HM2_BOARD.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document on stdout.")
@click.option("-v", "--verbose", is_flag=True, help="Say on stderr what is done, and what led to an error.")
@click.pass_obj
def hm2(session: Session, url: str | None, as_json: bool, verbose: bool) -> None:
    """Mesa FPGA cards running HostMot2, from the shell. `hm2 COMMAND --help` has examples of each.

    Without --board and $HM2_BOARD the card is an emulated 5I25 with a 7I77: everything can be tried without
    hardware. Exit codes: 0 ok, 2 usage, 3 not found, 4 permission, 5 communication, 6 device fault, 7 busy.

    \b
    Examples:
      hm2 info
      hm2 --board udp://10.10.10.10 sserial scan
      hm2 --json --board pci:// pins
      hm2 explain NoRemote
    """
    session.url, session.as_json, session.verbose = url, as_json, verbose
    if verbose:
        logging.basicConfig(level=logging.DEBUG, stream=sys.stderr, format="hm2: %(name)s: %(message)s")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs one command and exits with its status."""
    warnings.showwarning = _warn
    _fill_in_closed_streams()
    session = Session()
    try:
        status = hm2.main(arguments, prog_name="hm2", standalone_mode=False, obj=session)
        if session.document is not None:
            click.echo(session.document)
    except click.ClickException as error:
        status = failure.show_usage(error, as_json=session.as_json)
    except (click.Abort, KeyboardInterrupt) as interrupt:
        notes = getattr(interrupt.__cause__ or interrupt, "__notes__", [])
        click.echo("\n  ".join(["hm2: interrupted", *notes]), err=True)
        status = 130
    except BrokenPipeError:
        _turn_away(sys.stdout)  # the reader has seen enough
        status = 0
    except SystemExit as ended:  # so click passes on a broken pipe, and rich, which turns stdout away first
        seen_enough = _nobody_reads(sys.stdout) or isinstance(ended.__context__, BrokenPipeError)
        if not seen_enough or _nobody_reads(sys.stderr):
            raise
        status = 0
    except Exception as error:
        if os.environ.get(DEBUG_VARIABLE) or failure.exit_code(error) == 1:
            raise
        status = failure.show(error, as_json=session.as_json, verbose=session.verbose)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:  # told already, or the terminal has gone
            _turn_away(stream)
    sys.exit(status if isinstance(status, int) else 0)


def _fill_in_closed_streams() -> None:
    """A stream that is closed (`>&-`) is None in Python; here it takes everything, as /dev/null does."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def _turn_away(stream: TextIO) -> None:
    """What is buffered for it, and comes yet, goes nowhere: it fails no second time."""
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


def _nobody_reads(stream: Any) -> bool:
    """Whether it is a pipe without a reader: what broke off there may have been work, not its report."""
    try:
        watch = select.poll()
        watch.register(stream.fileno(), 0)
        return any(events & select.POLLERR for _, events in watch.poll(0))
    except (OSError, ValueError):
        return False


def _warn(message: Warning | str, category: type[Warning], *_place: Any, **_more: Any) -> None:
    click.echo(f"hm2: {message}", err=True)
