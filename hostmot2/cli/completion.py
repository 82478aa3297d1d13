"""hm2 completion: the script that makes a shell complete commands, options and values."""

from __future__ import annotations

import sys

import click
from click.shell_completion import BashComplete, FishComplete, ShellComplete, ZshComplete

VARIABLE = "_HM2_COMPLETE"
"""What the scripts set when they ask hm2 for completions."""

_SHELLS: dict[str, tuple[type[ShellComplete], str]] = {
    "bash": (BashComplete, "hm2 completion bash > ~/.local/share/bash-completion/completions/hm2"),
    "zsh": (ZshComplete, "hm2 completion zsh > ~/.zfunc/_hm2  # ~/.zshrc: fpath+=~/.zfunc before compinit"),
    "fish": (FishComplete, "hm2 completion fish > ~/.config/fish/completions/hm2.fish"),
}


@click.command()
@click.argument("shell", type=click.Choice(list(_SHELLS)))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print a shell's completion script: commands, codes, cards.

    It is printed and nothing else; where it goes is said on stderr when stdout is a terminal.

    \b
    Examples:
      hm2 completion bash
      hm2 completion zsh
      hm2 completion fish
    """
    made, install = _SHELLS[shell]
    click.echo(made(context.find_root().command, {}, "hm2", VARIABLE).source())
    if sys.stdout.isatty():
        click.echo(f"hm2: to install it:  {install}", err=True)
