"""`armtree calibrate`."""

import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hardware.printable import plural

from .settings import PATH
from .support.command_group import command
from .support.failures import Refusal
from .support.options import port_option, robot_option
from .terminal.full_screen import FullScreen
from .terminal.keyboard import ENTER, ask, key_by_key, pressed_keys
from .terminal.streams import echo

if TYPE_CHECKING:
    from hardware import Robot
    from hardware.bring_up.calibrating import Calibrator, Change, Row

_PERIOD = 0.05  # time between readings of the servos [s]


@command()
@port_option
@robot_option
@click.option("--ids", is_flag=True, help="Write the id of each servo, one servo at a time.")
@click.option(
    "--centre",
    is_flag=True,
    help="Write an offset to every servo, so that the middle of its range is the middle of its "
    "turn. Needed if a range contains the seam, where the position of a servo jumps to 0.",
)
@click.option(
    "--import", "imported", metavar="FILE", type=PATH, help="Import a calibration made by LeRobot."
)
@click.option(
    "--restore",
    is_flag=True,
    help="Write back the values that the servos had before the calibration, and delete the "
    "calibration file; with --ids, only write back their ids.",
)
def calibrate(
    port: str | None,
    robot: Path | None,
    ids: bool,
    centre: bool,
    imported: Path | None,
    restore: bool,
) -> None:
    """Calibrate an arm with bus servos: turn every joint by hand from end to end.

    The command first switches the torque off, so hold the arm. A table shows how far each joint was
    turned, and its range in the URDF. The result is a file in the folder of the robot file, or in
    ~/.config/armtree for a shipped robot. The file has the range of each joint. The servo position
    in the middle of this range counts as the middle of the joint's limits.

    Only this command writes to the memory that servos keep without power. It shows the values,
    asks before it writes them, and reads them back.

    \b
    Example:
      armtree calibrate --robot so101 --port /dev/ttyACM0
    """  # noqa: D301
    from hardware import Ability, PortNotGiven, RealClock, load_robot
    from hardware.bring_up.calibrating import Calibrator, read_lerobot
    from hardware.bring_up.search import answering

    arm = load_robot(robot, calibrated=False)
    arm.require(Ability.LIMITS)
    line = arm.serial.port if port is None else port
    if not line:
        raise PortNotGiven
    if ids:
        _number(arm, line, restore)
        return
    with arm.servo_bus(line, arm.serial.baud, RealClock()) as bus:
        calibrator = Calibrator(arm, bus, answering(arm, bus, line))
        before = calibrator.before() if restore else {}
        ticks = bus.ticks
        kept = read_lerobot(imported, arm.actuated, arm.servos, ticks) if imported else {}
        # A new zero of a servo would move the arm if the servo had torque.
        _confirm("The torque goes off, and gravity moves the arm. Do you hold it?")
        try:
            bus.release([*arm.servos.values()])
            if restore:
                _restore(calibrator, before)
            elif imported:
                echo(f"The values in {imported} are in the servos that LeRobot calibrated.")
                _finish(arm, calibrator, kept, f"from {imported.name} of LeRobot")
            else:
                with _leavable():
                    _show_ranges(calibrator)
                for text in _table(calibrator.rows):
                    echo(text, whole=True)
                _finish(arm, calibrator, calibrator.kept(centre), "swept by hand")
        finally:
            echo("Servos have no torque: hold the arm.")  # some of the servos, or all
    given = {"--robot": robot, "--port": port}
    words = [word for name, value in given.items() if value for word in (name, str(value))]
    echo("Next, type:")
    echo(shlex.join(["armtree", "doctor", "--open", *words]), whole=True)


def _confirm(question: str) -> None:
    """Ask a question. Any answer except yes ends the command."""
    if ask(f"{question} [y/N]:").lower() not in {"y", "yes"}:
        raise click.Abort


@contextmanager
def _leavable() -> Iterator[None]:
    """Report that nothing was written if a person ends the command in this context."""
    try:
        yield
    except (KeyboardInterrupt, click.Abort, click.exceptions.Exit):
        echo("Nothing was written.")
        raise


def _show_ranges(calibrator: "Calibrator") -> None:
    """Show the ranges of the joints until a person presses Enter."""
    note = ""
    with key_by_key() as keyboard, FullScreen(sys.stdout) as screen:
        if keyboard is None:
            raise Refusal("armtree calibrate needs a terminal: it shows a table and reads keys")
        while True:
            calibrator.read()
            rows = calibrator.rows
            title = "Turn every joint by hand from end to end, then press Enter. q leaves."
            width = shutil.get_terminal_size().columns
            screen.draw(line[:width] for line in (title, "", *_table(rows), "", note))
            for key in pressed_keys(keyboard, _PERIOD):
                if key == "q":
                    raise click.exceptions.Exit
                missing = [row.joint.name for row in rows if not row.swept]
                if key == ENTER and not missing:
                    return
                note = f"Not turned yet: {', '.join(missing)}" if missing else "Press Enter to end"


def _table(rows: "Sequence[Row]") -> Iterator[str]:
    """Yield the lines of the table of ranges."""
    from hardware.bring_up.calibrating import degrees

    yield f"{'joint':<14}{'servo':>5}{'now':>6}{'least':>7}{'most':>7}{'range':>9}{'URDF':>9}"
    for row in rows:
        expected = degrees(row.joint)
        note = f"{row.range / expected:.0%} of the range in the URDF" if row.swept else "turn it"
        note = "the seam is inside the range" if row.seam else note
        now = "-" if row.now is None else row.now
        figures = f"{now:>6}{row.least:>7}{row.most:>7}{row.range:>5.0f} deg{expected:>5.0f} deg"
        yield f"{row.joint.name:<14}{row.servo:>5}{figures}  {note}"


def _finish(
    arm: "Robot", calibrator: "Calibrator", kept: Mapping[str, Mapping[str, int]], how: str
) -> None:
    """Show the changes and ask. Then write the calibration file, and then the servos."""
    from hardware.description.calibration import write_calibration

    kept = calibrator.in_position_mode(kept)
    joints, changes = calibrator.joints(kept), calibrator.changes(kept)
    _show(changes)
    replaces = ", which is replaced" if calibrator.path.exists() else ""
    if error := calibrator.difference:
        echo("", f"{error}.", "To use --restore for those servos later, copy the file first.")
    file = f"the file {calibrator.path}{replaces}"
    with _leavable():
        _confirm(f"Write {_values(changes)} to the servos, and {file}?")
    made = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {how}"
    # The file comes first: it has the old values, which --restore writes back.
    write_calibration(calibrator.path, arm.name, made, joints)
    calibrator.write(changes)
    echo(f"{calibrator.path} is written; read again, the servos hold the same values")


def _restore(calibrator: "Calibrator", before: Mapping[str, Mapping[str, int]]) -> None:
    changes = calibrator.changes(before)
    _show(changes)
    with _leavable():
        _confirm(f"Write {_values(changes)} to the servos, and delete {calibrator.path}?")
    calibrator.write(changes)
    calibrator.path.unlink()
    echo("Restored the values that the servos had before the calibration")


def _values(changes: "Sequence[Change]") -> str:
    return plural(len(changes), "value") if changes else "nothing"


def _show(changes: "Sequence[Change]") -> None:
    """Print the values that will be written to the servos."""
    echo("", "Memory of the servos:" + ("" if changes else " every value is right already"))
    for each in changes:
        place = f"  servo {each.servo:<3} {each.joint:<16}"
        echo(f"{place} {each.name:<7} {each.old:>6} -> {each.new}", whole=True)


def _number(arm: "Robot", port: str, restore: bool) -> None:
    """Write the id of each servo, or its earlier id, while no other servo is on the bus."""
    from hardware import DescriptionError, RealClock
    from hardware.bring_up.earlier_ids import ids_file, read_ids, write_ids
    from hardware.bring_up.search import search_speeds

    path = ids_file(arm.path)
    earlier = read_ids(path, arm.servos)
    if restore and not earlier:
        raise DescriptionError(path, 0, "does not exist; there is nothing to restore")
    for joint, wanted in [*(earlier if restore else arm.servos).items()]:
        while True:
            ask(f"Connect only the servo of {joint} (id {wanted}), then press Enter")
            baud, found = search_speeds(arm, port)
            if len(found.servos) == 1 and not found.damaged:
                break
            there = ", ".join(map(str, found.servos)) or "none"
            if found.damaged:
                there += (
                    f"; damaged, as if two answer: {', '.join(map(str, sorted(found.damaged)))}"
                )
            echo(f"Exactly one servo must answer; ids that answer: {there}. Check cable and power")
        (now,) = found.servos
        if baud != arm.serial.baud:
            there = f"The servo runs at {baud} bit/s; the robot file has {arm.serial.baud}"
            ways = "Set its speed with the manufacturer's tool, or correct the robot file"
            echo(f"{there}. {ways}")
        if now == wanted:
            echo(f"The servo has the id {wanted} already")
        else:
            _confirm(f"Write the id {wanted} to the servo, which has {now}?")
            if not restore:
                earlier[joint] = now
                write_ids(path, earlier)
            with arm.servo_bus(port, baud, RealClock()) as bus:
                bus.keep(now, {"id": wanted})
            way_back = "" if restore else f". It had {now}; --ids --restore writes {now} again"
            echo(f"The servo reads back the id {wanted}{way_back}")
        if restore:
            del earlier[joint]
            write_ids(path, earlier)
