"""A board on a pseudo-terminal, in a process of its own. It keeps its own log of bytes, in memory:
on a disk that others use, a write waits, and a board does not.

It shares no code with the virtual Arduino. As a program it reads commands from its standard input,
one a line, and answers each with a line of JSON:

| command | does |
|---|---|
| `state` | nothing |
| `stall` | read nothing more |
| `go` | read again |
| `damage N` | change one bit of the Nth byte that it reads next, after it is logged |
| `garbage N SEED` | send N random bytes |
| `mute` | send nothing more |
| `send TEXT` | send this line, as a firmware does |
| `reset` | boot, as after the reset button |
| `unplug` | close the pseudo-terminal; the port's name points nowhere |
| `replug NAME` | a new pseudo-terminal; the port has this name now |
"""

import binascii
import contextlib
import io
import json
import math
import os
import random
import re
import select
import subprocess
import sys
import time
import tty
from collections import deque
from pathlib import Path
from typing import Any, NamedTuple

RATE = 11520  # bytes per second at 115200 baud
RING = 63  # bytes that the core of an Arduino keeps
STEP_S = 0.005  # the published sketch waits after each degree
BOOT_FRAME = (90, 90, 90, 0)


class Read(NamedTuple):
    """Bytes that the board read, and when [s, monotonic]."""

    time: float
    data: bytes


class Board:
    """A board that a command can open, driven from this process.

    Args:
        folder: Folder of the port's name, and of the log after `close`.
        firmware: `stock` (the published sketch) or `armtree`.
        boot_s: How long it boots after it was opened [s].
    """

    def __init__(self, folder: Path, firmware: str = "stock", boot_s: float = 0.1) -> None:
        number = len(list(folder.glob("board*.log")))
        self.port, self._file = folder / "ttyACM0", folder / f"board{number}.log"
        self._file.touch()
        self._log = io.FileIO(os.memfd_create("board"))
        self.period = 0.1 if firmware == "stock" else 0.02  # between two frames to it [s]
        self._known, self._rest = 0, b""  # bytes of the log that are in the lists; of no frame yet
        self._reads: list[Read] = []
        self._frames: list[Read] = []
        log = self._log.fileno()
        command = [sys.executable, "-I", __file__, str(self.port), str(log), firmware, str(boot_s)]
        self._process = subprocess.Popen(
            command,
            pass_fds=[log],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Linux schedules sessions apart from each other
        )
        self.pid = self._process.pid
        self.starved = 0.0  # the longest time that it did not run, known after `close` [s]
        self.ask("state")

    def ask(self, command: str) -> dict[str, Any]:
        """Send a command; return the state of the board.

        `time` [s, monotonic] is when the command was done. `resets`, `lost` (bytes for which the
        ring had no room, or that came while it booted), `wrong` (fields that are not an angle),
        `angles` [deg], `frames` and `backlog` (bytes in the ring) describe the firmware; `open`
        tells whether a program has the port, and `unsent` how many bytes it could not send yet.
        `reached` [deg] is where the servos are now, on their way to `angles`.
        `turned` [s, monotonic] is when a servo turned last. `harmed` [s, monotonic] is when
        `damage` changed a byte, or `mute` first withheld an answer; None until then. `starved` [s]
        is the longest time that the program of the board did not run.
        """
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def at(self, name: Path) -> None:
        """Commands are given this name of the port from now on."""
        self.port = name

    def reads(self) -> list[Read]:
        """Everything that it read until now, on all its pseudo-terminals."""
        new = self._logged(self._known)  # rows ask every few milliseconds
        for line in new.splitlines(keepends=True):
            if line.endswith(b"\n"):
                self._known += len(line)
                time, data = line.decode().split()
                self._note(Read(float(time), bytes.fromhex(data)))
        return list(self._reads)

    def data(self) -> bytes:
        return b"".join(read.data for read in self.reads())

    def frames(self) -> list[Read]:
        """Its frames, each with the time of its last byte."""
        self.reads()
        return list(self._frames)

    def _logged(self, begin: int) -> bytes:
        if self._log.closed:
            return self._file.read_bytes()[begin:]
        log = self._log.fileno()
        return os.pread(log, os.fstat(log).st_size - begin, begin)

    def _note(self, read: Read) -> None:
        self._reads.append(read)
        self._rest += read.data
        while match := re.search(rb"b\d{3},s\d{3},e\d{3},g\d{3},", self._rest):
            self._frames.append(Read(read.time, match.group()))
            self._rest = self._rest[match.end() :]

    def close(self) -> None:
        assert self._process.stdin
        assert self._process.stdout
        with contextlib.suppress(BrokenPipeError, ValueError):  # it has ended, or is closed
            self.starved = self.ask("state")["starved"]
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(5)
        finally:
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()
            self._file.write_bytes(self._logged(0))
            self._log.close()


class Sketch:
    """The published sketch: one byte per loop; while a servo turns, nothing is read."""

    def __init__(self) -> None:
        self.boot()

    def boot(self) -> None:
        self.angles = list(BOOT_FRAME)
        self.ring: deque[int] = deque()
        self.digits, self.joint, self.free_at = "", 0, 0.0
        self.turning = 0, 1, 0  # joint, direction and way of the last turn [deg]
        self.turned_at = 0.0  # when a servo turned last [s]
        self.lost = self.wrong = self.frames = 0
        self.answer = b""

    def receive(self, data: bytes, now: float) -> None:
        """Bytes come from the line."""
        self.work(now)
        for byte in data:
            if len(self.ring) < RING:
                self.ring.append(byte)
            else:
                self.lost += 1
        self.work(now)

    def work(self, now: float) -> None:
        """Take bytes from the ring, until a servo turns."""
        while self.ring and self.free_at <= now:
            char = chr(self.ring.popleft())
            if char in "bseg":
                self.joint, self.digits = "bseg".index(char), ""
            elif char == ",":
                self.turn(self.digits, now)
                self.digits = ""
            else:
                self.digits += char

    def turn(self, digits: str, now: float) -> None:
        if not re.fullmatch(r"\d{3}", digits) or int(digits) > 180:
            self.wrong += 1
            return
        delta = abs(int(digits) - self.angles[self.joint])
        self.free_at = max(self.free_at, now) + STEP_S * (delta + 1)
        self.turned_at = self.free_at if delta else self.turned_at
        self.turning = self.joint, 1 if int(digits) > self.angles[self.joint] else -1, delta
        self.angles[self.joint] = int(digits)
        self.frames += self.joint == 3

    def reached(self, now: float) -> list[int]:
        """The angles of the servos now: the one that turns is on its way to that in `angles`."""
        reached, (joint, direction, delta) = list(self.angles), self.turning
        left = math.ceil(max(0.0, self.free_at - now) / STEP_S)
        reached[joint] -= direction * min(delta, left)
        return reached


class OwnFirmware(Sketch):
    """armtree's firmware, as its README.md describes it: it never blocks, and can acknowledge."""

    def boot(self) -> None:
        super().boot()
        self.text, self.acks, self.sum = "", False, 0
        self.answer = b"\narmtree 1 AVW? boot %s\n" % self.frame()

    def frame(self) -> bytes:
        return b"b%03d,s%03d,e%03d,g%03d," % tuple(self.angles)

    def work(self, now: float) -> None:
        before = self.angles
        while self.ring:
            self.take(chr(self.ring.popleft()))
        self.turned_at = now if self.angles != before else self.turned_at

    def take(self, char: str) -> None:
        self.text += char
        if match := re.fullmatch(r"b(\d{3}),s(\d{3}),e(\d{3}),g(\d{3}),", self.text):
            self.angles, self.text = [int(angle) for angle in match.groups()], ""
            self.sum = binascii.crc_hqx(bytes(self.angles), self.sum)
            self.frames += 1
            if self.acks:
                self.answer += b"k%04x,%02x,00,%04x\n" % (self.frames, self.wrong, self.sum)
        elif match := re.fullmatch(r"bA(\d\d);|bW\d\d;|[bseg]V\d\d;|\?", self.text):
            self.acks, self.text = match[1] == "01" if match[1] else self.acks, ""
            state = (self.frames, self.wrong, self.sum, self.acks, self.frame())
            self.answer += (
                b"status frames=%04x refused=%04x lost=0000 sum=%04x holds=00 acks=%d "
                b"watchdog_ms=0000 speeds=000,000,000,000 at=%s\n" % state
            )
        elif len(self.text) >= 20 or not self.text.startswith(("b", "s", "e", "g")):
            self.wrong += len(self.text)
            self.text = ""


class Terminal:
    """The pseudo-terminal, at the pace of the line, and the firmware behind it."""

    def __init__(self, port: Path, log: int, firmware: str, boot_s: float) -> None:
        self.port, self.boot_s = port, boot_s
        self.firmware = OwnFirmware() if firmware == "armtree" else Sketch()
        self.log = os.fdopen(log, "w", buffering=1)
        self.stalled, self.open, self.resets, self.damage = False, False, 0, -1
        self.ready_at, self.unsent, self.mute = 0.0, b"", False
        self.harmed: float | None = None
        self.starved = 0.0
        self.plug()

    def plug(self) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        name = os.ttyname(slave)
        os.close(slave)  # so that the master shows POLLHUP until a command opens the port
        os.set_blocking(self.master, False)
        self.open = False
        with contextlib.suppress(FileNotFoundError):
            self.port.unlink()
        self.port.symlink_to(name)

    def reset(self) -> None:
        self.resets += 1
        lost = self.firmware.lost + len(self.firmware.ring)
        self.firmware.boot()
        self.firmware.lost = lost
        self.ready_at = time.monotonic() + self.boot_s

    def tick(self, budget: int) -> int:
        """Read at most so many bytes, write the firmware's answers; return how many were read."""
        if self.master < 0:
            return 0
        (_, seen), *_ = poll(self.master) or [(0, 0)]
        if opened := not seen & select.POLLHUP:
            if not self.open:
                self.reset()
            self.send()
        self.open, count = opened, 0
        if seen & select.POLLIN and budget and not self.stalled:
            data = os.read(self.master, budget)
            now, count = time.monotonic(), len(data)
            self.log.write(f"{now:.6f} {data.hex()}\n")
            if 0 <= self.damage < len(data):
                data = bytes(byte ^ (index == self.damage) for index, byte in enumerate(data))
                self.harmed = now
            self.damage -= len(data)
            if now < self.ready_at:
                self.firmware.lost += count
            else:
                self.firmware.receive(data, now)
        self.firmware.work(time.monotonic())
        return count

    def send(self) -> None:
        """Send what the firmware answered and garbage, as much as the line takes now."""
        if (now := time.monotonic()) >= self.ready_at and self.firmware.answer:
            if self.mute:
                self.harmed = self.harmed or now
            else:
                self.unsent += self.firmware.answer
            self.firmware.answer = b""
        with contextlib.suppress(BlockingIOError):
            self.unsent = self.unsent[os.write(self.master, self.unsent[:512]) :]

    def obey(self, command: str) -> str:
        word, _, rest = command.partition(" ")
        if action := getattr(self, f"do_{word}", None):
            action(rest)
        firmware = self.firmware
        state = {name: getattr(firmware, name) for name in ("lost", "wrong", "frames", "angles")}
        state |= {"resets": self.resets, "backlog": len(firmware.ring), "open": self.open}
        state |= {"unsent": len(self.unsent), "time": time.monotonic()}
        state["reached"] = firmware.reached(time.monotonic())
        state |= {"turned": firmware.turned_at, "harmed": self.harmed, "starved": self.starved}
        return json.dumps(state)

    def do_stall(self, _: str) -> None:
        self.stalled = True

    def do_go(self, _: str) -> None:
        self.stalled = False

    def do_garbage(self, words: str) -> None:
        count, seed = words.split()
        self.unsent += random.Random(seed).randbytes(int(count))

    def do_send(self, text: str) -> None:
        self.unsent += text.encode() + b"\n"

    def do_mute(self, _: str) -> None:
        self.mute = True

    def do_damage(self, index: str) -> None:
        self.damage = int(index)

    def do_reset(self, _: str) -> None:
        self.reset()

    def do_unplug(self, _: str) -> None:
        self.port.unlink()
        os.close(self.master)
        self.master = -1

    def do_replug(self, name: str) -> None:
        if self.master >= 0:
            self.do_unplug("")
        self.port = self.port.with_name(name)
        self.plug()


def poll(handle: int) -> list[tuple[int, int]]:
    watched = select.poll()
    watched.register(handle, select.POLLIN)
    return watched.poll(0)


def main(port: str, log: str, firmware: str, boot_s: str) -> None:
    """Run until standard input ends."""
    with contextlib.suppress(PermissionError):  # a board does not wait for the computer
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    terminal = Terminal(Path(port), int(log), firmware, float(boot_s))
    credit, last = 0.0, time.monotonic()
    while True:
        ready, _, _ = select.select([sys.stdin], [], [], 0.001)
        terminal.starved = max(terminal.starved, time.monotonic() - last)
        if ready:
            if not (line := sys.stdin.readline()):
                return
            sys.stdout.write(terminal.obey(line.strip()) + "\n")
            sys.stdout.flush()
        now = time.monotonic()
        credit, last = min(credit + (now - last) * RATE, 64.0), now
        credit -= terminal.tick(int(credit))


if __name__ == "__main__":
    main(*sys.argv[1:])
