"""`armtree completion`: prints the script for completions in a shell, and completes commands."""

import os
import re
import shlex
import sys
from pathlib import Path

import click
from click.shell_completion import (
    BashComplete,
    CompletionItem,
    ZshComplete,
    add_completion_class,
    get_completion_class,
    split_arg_string,
)

from .support.command_group import COMPLETION_VARIABLE, command
from .terminal.streams import echo

# For each shell: the command that loads the script, the file that the user adds it to, and the call
# of armtree in the script of click, with its replacement.
_LOAD = {"bash": 'eval "$({})"', "zsh": 'eval "$({})"', "fish": "{} | source"}
_FILES = {"bash": "~/.bashrc", "zsh": "~/.zshrc", "fish": "~/.config/fish/config.fish"}
_CALLS = {
    "bash": ("bash_complete $1", "bash_complete {}"),
    "zsh": ("zsh_complete armtree", "zsh_complete {}"),
    "fish": ("(commandline -t) armtree", "(commandline -t) {}"),
}
_ZSH_CHECK = "    (( ! $+commands[armtree] )) && return 1\n"
_ZSH_BEGIN = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"


class _Bash(BashComplete):
    """Completion in bash. Bash splits a word at a colon, and replaces only the part after it."""

    source_template = BashComplete.source_template.replace(
        'COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD',
        'COMP_LINE="${COMP_LINE:0:$COMP_POINT}" COMP_WORDBREAKS="$COMP_WORDBREAKS"',
    ).replace(
        "COMPREPLY+=($value)",
        "COMPREPLY+=($value)\n            [[ $value == *[=/] ]] && compopt -o nospace",
    )
    _kept = ""  # the part of the word before the colon, which Bash keeps

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the complete words after `armtree`, and the unfinished word at the cursor."""
        line, breaks = os.environ["COMP_LINE"], os.environ["COMP_WORDBREAKS"]
        words = split_arg_string(line)
        word = "" if line[-1:].isspace() else words.pop()
        end = re.search(f"[{re.escape(breaks)}][^{re.escape(breaks)}]*$", word)
        self._kept = word[: end.start() + 1] if end else ""
        return words[1:], word

    def format_completion(self, item: CompletionItem) -> str:
        """Return the line for a completion: its type, and the text after the kept part."""
        return f"{item.type},{str(item.value).removeprefix(self._kept)}"


class _Zsh(ZshComplete):
    """Completion in zsh, without a space after a word that ends with = or /."""

    source_template = ZshComplete.source_template.replace(
        'if [[ "$descr" == "_" ]]',
        'if [[ "$key" == *[=/] ]]; then\n                compadd -U -S "" -- "$key"\n'
        '            elif [[ "$descr" == "_" ]]',
    )


add_completion_class(_Bash)
add_completion_class(_Zsh)


@command()
@click.argument("shell", metavar="SHELL", type=click.Choice(list(_LOAD)))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print the script with which a shell completes commands, options and names.

    SHELL is bash, zsh or fish. Names are those of tasks, poses, joints, nodes, robots, recordings
    and ports.

    \b
    To install it, add a line to the file of your shell:
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
