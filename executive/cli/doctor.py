"""`armtree doctor`."""

import json
import platform
import shlex
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from executive.code_table import exit_status

from .settings import PATH, given_options
from .support.command_group import command
from .support.names import first_motion, load_library
from .support.options import port_option, recordings_option, robot_option, trees_option
from .terminal.streams import echo

if TYPE_CHECKING:
    from hardware import Check
    from hardware.link.serial_ports import SerialPort

_MARKS = {True: "ok", False: "NO", None: "?"}


@command()
@port_option
@robot_option
@trees_option
@recordings_option
@click.option(
    "--open", "opens_port", is_flag=True, help="Open the port too. This may move the arm."
)
@click.option(
    "--report",
    metavar="FILE",
    type=PATH,
    help="Write all results to a JSON file, to send with a question.",
)
@click.pass_context
def doctor(
    context: click.Context,
    port: str | None,
    robot: Path | None,
    trees: Path | None,
    recordings: Path,
    opens_port: bool,
    report: Path | None,
) -> None:
    """Check everything that a run needs.

    The checks concern the robot file, the tasks, the planner, the recordings and the port. Nothing
    moves, and the port is not opened unless --open is given. On a bus, --open reads the id, speed,
    supply voltage and firmware of each servo. If a servo is missing, it names the cable to check.
    The last line is the command to type next. The exit status is 0 if no check fails, else that of
    the first failure.
    """
    from hardware import serial_ports

    from .support.readiness import check_readiness

    failures, checks = [], []
    for check in check_readiness(robot, port, trees, recordings, opens_port):
        checks.append(check)
        failures += [check.code] if check.ok is False else []
        detail = check.detail.replace("\n", "\n    ")
        echo(f"{_MARKS[check.ok]:<4}{check.name:<12}{detail}")
        if check.ok is False and check.remedy:
            echo(f"{'':<16}-> {check.remedy}")
    found = serial_ports()
    echo("", f"Serial ports: {'' if found else 'none'}")
    for each in found:
        echo("  " + "  ".join(filter(None, (each.device, each.usb, each.name, each.by_id))))
    if report:
        _write_report(report, checks, found)
        echo("", f"{report} has all these results, with names of files and ports of this machine")
    if failures:
        echo("", "Fix the lines with NO.")
        sys.exit(exit_status(failures[0]))
    loaded, library = load_library(trees, robot)
    numbers = library.numbers()
    first = ["run", f"{numbers[0]}"] if numbers else first_motion(loaded)
    command = ["armtree", *first, *given_options(context, "port", "robot", "trees", "recordings")]
    echo(f"\nNext, type: {shlex.join(command)}", whole=True)


def _write_report(path: Path, checks: "list[Check]", ports: "list[SerialPort]") -> None:
    """Write the results to a JSON file. Raises OSError if this fails."""
    from executive.recording.versions import versions
    from hardware import write_file

    found = {
        "armtree_report": 1,
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "platform": platform.platform(),
        "versions": versions(),
        "command": sys.argv[1:],
        "checks": [asdict(check) for check in checks],
        "serial_ports": [asdict(port) for port in ports],
    }
    write_file(path, f"{json.dumps(found, indent=2)}\n".encode())
