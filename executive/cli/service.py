"""`armtree service`: start the server with the computer."""

import os
import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hardware import VIRTUAL, serial_ports, write_file

from .settings import option
from .support.command_group import CommandGroup
from .support.failures import Refusal
from .support.options import port_option
from .terminal.streams import echo

if TYPE_CHECKING:
    from executive.server.systemd.service_files import Step

_dry_run = click.option("--dry-run", is_flag=True, help="Only show the files and commands.")
_yes = click.option("--yes", is_flag=True, help="Do not ask.")


@click.group(cls=CommandGroup)
def service() -> None:
    """Start `armtree serve` when the computer starts, as a service of systemd.

    The arm is inactive after a start. A person activates it.
    """


@service.command()
@port_option
@option("robot")
@_dry_run
@_yes
def install(port: str | None, robot: Path | None, dry_run: bool, yes: bool) -> None:
    """Install and start the service.

    The command needs root. The server runs as the user `armtree`. systemd starts the server again
    after a crash, or if it hangs for 30 s.

    \b
    Examples:
      armtree service install --port /dev/ttyACM0 --dry-run
      sudo /opt/armtree/bin/armtree service install \\
        --port virtual
    """  # noqa: D301
    from executive.server.systemd.service_files import hidden_from_service, install_steps
    from hardware import load_robot

    if not port:
        raise click.UsageError("give the port of the board, such as --port /dev/ttyACM0")
    if port != VIRTUAL and not Path(port).exists():
        raise Refusal(f"{port} does not exist; plug the board in, or see `armtree doctor`")
    command, file = _own_path(), robot if robot and robot.exists() else None
    for path in (command, Path(sys.prefix), Path(sys.base_prefix), *([file] if file else [])):
        if hidden_from_service(path):
            why = (
                f"the service cannot read {path}, which is in a home or temporary folder; install "
                "armtree into /opt/armtree with the Python of the system, and put robot files there"
            )
            if not dry_run:
                raise Refusal(why)
            echo(f"This would be refused: {why}", err=True)
    load_robot(robot)  # with a wrong robot file, the service would start again and again
    name, usb = (port, "") if port == VIRTUAL else _persistent(port)
    steps = install_steps(command, name, usb, file.absolute() if file else robot)
    _perform(list(steps), dry_run, yes)
    if not dry_run:
        echo("The service runs. Its log: journalctl -u armtree")


@service.command()
@_dry_run
@_yes
def remove(dry_run: bool, yes: bool) -> None:
    """Stop the service and remove its files. Its user, tasks and recordings stay."""
    from executive.server.systemd.service_files import remove_steps

    _perform(list(remove_steps()), dry_run, yes)


def _own_path() -> Path:
    """Return the path of the command `armtree`."""
    return Path(sys.argv[0]).absolute()


def _persistent(port: str) -> tuple[str, str]:
    """Return the persistent name of a port and "". Without a name, return the port and its USB id.

    Raises:
        Refusal: Another port has the same USB id, and no persistent names distinguish the ports.
    """
    ports, device = serial_ports(), os.path.realpath(port)
    own = next((each for each in ports if os.path.realpath(each.device) == device), None)
    if own is None:
        return port, ""
    same = [each for each in ports if own.usb and each.usb == own.usb]
    # Boards without a serial number share a persistent name, and only one port gets it.
    if len(same) > 1 and not all(each.by_id for each in same):
        raise Refusal(
            f"{len(same)} serial ports have the USB id {own.usb}, and nothing else distinguishes "
            "them after a restart; connect only the board of this arm to this computer"
        )
    return (own.by_id, "") if own.by_id else (port, own.usb)


def _perform(steps: Sequence["Step"], dry_run: bool, yes: bool) -> None:
    """Show the steps, ask, and perform them.

    Raises:
        Refusal: The user is not root, a program is missing, or a program failed.
    """
    from executive.server.systemd.service_files import NewFile, Program

    for step in steps:
        echo(step, whole=True)
    if dry_run:
        return
    if os.geteuid() != 0:
        # sudo does not search the folder of a virtual environment.
        again = shlex.join(["sudo", str(_own_path()), *sys.argv[1:]])
        raise Refusal(f"nothing was changed; this needs root; type: {again}")
    missing = {
        step.words[0]
        for step in steps
        if isinstance(step, Program) and not shutil.which(step.words[0])
    }
    if missing:
        raise Refusal(f"nothing was changed; not installed: {', '.join(sorted(missing))}")
    if not yes:
        click.confirm("Write these files and run these commands?", abort=True, err=True)
    import subprocess

    for step in steps:
        if isinstance(step, NewFile):
            write_file(step.path, step.text.encode())
        elif status := subprocess.run(step.words, check=False).returncode:
            raise Refusal(f"`{step}` failed with status {status}; correct the cause, and try again")
