"""`armtree completion`: completes commands in a shell."""

import shlex
import sys
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from .support.command_group import COMPLETION_VARIABLE
from .terminal.streams import echo

# How a shell loads the script, and where the script names the program: an alias is none.
_LOAD = {"bash": 'eval "$({})"', "zsh": 'eval "$({})"', "fish": "{} | source"}
_FILES = {"bash": "~/.bashrc", "zsh": "~/.zshrc", "fish": "~/.config/fish/config.fish"}
_CALLS = {
    "bash": ("bash_complete $1", "bash_complete {}"),
    "zsh": ("zsh_complete armtree", "zsh_complete {}"),
    "fish": ("(commandline -t) armtree", "(commandline -t) {}"),
}
_ZSH_CHECK = "    (( ! $+commands[armtree] )) && return 1\n"
_ZSH_BEGIN = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"


@click.command()
@click.argument("shell", type=click.Choice(list(_LOAD)))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the script with which a shell completes commands, options and names.

    Names are those of tasks, poses, nodes, recordings and ports.

    \b
    To install it, add the line of your shell to its file:
      ~/.bashrc    eval "$(armtree completion bash)"
      ~/.zshrc     eval "$(armtree completion zsh)"
      ~/.config/fish/config.fish
                   armtree completion fish | source
    """  # noqa: D301
    kind = get_completion_class(shell)
    assert kind is not None
    program = _program()
    called, calls = _CALLS[shell]
    script = kind(context.find_root().command, {}, "armtree", COMPLETION_VARIABLE).source()
    script = script.replace(called, calls.format(program)).replace(_ZSH_CHECK, "")
    line = _LOAD[shell].format(f"{program} completion {shell}")
    begin = _ZSH_BEGIN if shell == "zsh" else ""
    echo(
        f"# To install this, add to {_FILES[shell]}:  {line}\n{begin}{script}", nl=False, whole=True
    )


def _program() -> str:
    """Return the path of this program, quoted for a shell."""
    given = Path(sys.argv[0])
    path = given if given.name == "armtree" else Path(sys.executable).with_name("armtree")
    return shlex.quote(str(path.absolute()))
