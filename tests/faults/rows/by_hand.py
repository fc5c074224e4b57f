"""A person moves the arm with `armtree move` or `armtree jog`, and something fails."""

import itertools
import signal
import time
from pathlib import Path

from tests.faults.process import Command, kill, until
from tests.faults.row import Scene, row
from tests.faults.rows.command_line import in_motion, on_terminal, type_keys

WORDS = {
    "move": ("move", "joint_1=80deg", "--speed", "0.1"),
    "jog": ("jog", "--speed", "0.05"),
}
LONG_STEP = b"1+++\x1b[C"  # joint 1, a step of 10 degrees, and the key of the arrow to the right
FAULTS = ("unplug", "Ctrl-C", "kill -9", "closed terminal")


@row(
    "move-and-jog",
    "during a motion of `armtree move` or `armtree jog`: unplug the board, type Ctrl-C, `kill -9`,"
    " or close the terminal",
    "`move` ends with 6, 7, by the signal, or 7; `jog` shows `hw.port_lost` and stays, and ends"
    " with 130 in place of 7. A stop ends with a hold frame; the recording has every frame",
    limit=300,
    unit="ms",
    times=8,
)
def by_hand(scene: Scene) -> None:
    ((name, fault),) = scene.share(itertools.product(WORDS, FAULTS))
    board, keys, jogs = scene.board(), scene.folder / "keys", name == "jog"
    command = on_terminal(scene, board, keys, *WORDS[name])
    if jogs:
        command.until_printed("choose")  # the line of its keys
        type_keys(keys, LONG_STEP)
    in_motion(scene, board, most=7)  # a long step has ten frames
    begin = time.monotonic()
    if fault == "unplug":
        scene.unreceived = 1
        board.ask("unplug")
        if jogs:
            command.until_printed("hw.port_lost")
            type_keys(keys, b"q")
    elif fault == "Ctrl-C":
        type_keys(keys, b"\x03")
    elif fault == "kill -9":
        scene.unrecorded = scene.unreceived = 1
        kill(on_it(command), signal.SIGKILL)
    else:
        keys.touch()
    stopped = 130 if jogs else 7
    status = {"unplug": 0 if jogs else 6, "kill -9": 128 + signal.SIGKILL}.get(fault, stopped)
    scene.ended(command, status, what=f"{name}, {fault}")
    *_, before, last = board.frames()
    if fault in ("Ctrl-C", "closed terminal"):
        scene.check(before.data == last.data, f"{name}, {fault}: the last frame is not a hold")
    scene.figure(1000 * max(0.0, last.time - begin))
    scene.recovered(0, 10)
    scene.verified(10 if fault == "kill -9" else 0)


def on_it(terminal: Command) -> int:
    """The command that the program of a terminal has started."""

    def parent(pid: int) -> int:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])

    found: int = until(
        "the command", lambda: [each for each in terminal.family() if parent(each) == terminal.pid]
    )[0]
    return found
