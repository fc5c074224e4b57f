"""What a row is, and what one injection has: a folder, a board, commands, and its findings."""

import contextlib
import dataclasses
import difflib
import json
import random
import re
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from executive.code_table import exit_status
from tests.faults.board import Board
from tests.faults.means.small_disk import SmallDisk
from tests.faults.means.wrong_calls import WrongCalls
from tests.faults.process import Command, Hang, Server, until
from tests.support.paths import ROBOT_FILE

C = TypeVar("C", bound=Command)
K = TypeVar("K")
TASKS = Path(__file__).with_name("tasks")
FRAME = re.compile(rb"b\d{3},s\d{3},e\d{3},g\d{3},")
_TOKENS = re.compile(FRAME.pattern + rb"|[^b]+|b")
LATE_S = 0.1  # by so much a board may read a frame later than it was sent, on a busy machine


@dataclasses.dataclass(frozen=True)
class Row:
    """A fault, what is promised for it, and the function that injects it once.

    Attributes:
        name: Its name on the command line.
        fault: What is injected.
        promise: What holds then.
        limit: Largest 99th percentile of the figure, in `unit`; None if there is no figure.
        worst: Largest figure of all; None if only the 99th percentile is limited.
        times: How often it is injected.
        quick: How often in the quick selection; 0 leaves it out.
        alone: Whether no other row runs meanwhile.
        waits: Whether it computes little for long, so that it runs beside the others.
    """

    name: str
    fault: str
    promise: str
    inject: "Callable[[Scene], None]"
    limit: float | None = None
    worst: float | None = None
    unit: str = ""
    times: int = 5
    quick: int = 0
    alone: bool = False
    waits: bool = False


def row(
    name: str, fault: str, promise: str, **more: Any
) -> "Callable[[Callable[[Scene], None]], Row]":
    """Declare a row; the function injects the fault once. `more` is as of `Row`."""
    return lambda inject: Row(name, fault, promise, inject, **more)


class Scene:
    """One injection: its folder, what runs in it, and what was found.

    Args:
        folder: An empty folder.
        seed: Seed of `random`, with the number.
        number: Number of the injection.
        times: Injections that share the kinds of the row.
    """

    def __init__(self, folder: Path, seed: str, number: int = 0, times: int = 1) -> None:
        self.folder, self.random = folder, random.Random(f"{seed} {number}")
        self._seed, self._number, self._times = seed, number, times
        self.problems: list[str] = []
        self.figures: list[tuple[str, float]] = []
        self.means: set[str] = set()
        self.cleanup = contextlib.ExitStack()  # of what must last until all is compared
        self.injections = 1
        # What the fault may cost: frames that only the board has, that only a recording has.
        self.unrecorded, self.unreceived = 0, 0
        self.verdicts: tuple[int, ...] = ()  # as of `verified`; none if it was not called
        self._boards: list[Board] = []
        self._commands: list[Command] = []

    def check(self, holds: object, problem: str) -> bool:
        """Note a problem unless something holds; return whether it does."""
        if not holds:
            self.problems.append(problem)
        return bool(holds)

    def figure(self, value: float, kind: str = "") -> None:
        """Add a figure, in the unit of the row. The limit holds for the figures of each kind."""
        self.figures.append((kind, value))

    def by(self, means: str) -> None:
        """Note by which means the fault is injected, if that depends on the machine."""
        self.means.add(means)

    def ended(self, command: Command, *statuses: int, what: str = "") -> None:
        """Wait for the end of a command, and check its exit status."""
        known = command.wait() in statuses
        said = f"exit status {command.wait()}, not {' or '.join(map(str, statuses))}"
        self.check(known, f"{what or command.words}: {said}: {last_line(command)}")

    def succeeds(self, server: Server, what: str, task: int = 21) -> None:
        """Run a task on a server, and check that it succeeds."""
        result = server.result(server.goal(task))
        self.check(result["code"] == "ok", f"{what}: {result['code']}: {result['message']}")

    def share(self, kinds: Iterable[K]) -> list[K]:
        """The kinds that this injection tries: one, or more if there are more than injections.

        All injections of a row together try each kind.
        """
        order = list(kinds)
        random.Random(self._seed).shuffle(order)
        places = range(self._number % self._times, max(self._times, len(order)), self._times)
        return [order[place % len(order)] for place in places]

    def board(self, firmware: str = "stock", boot_s: float = 0.1) -> Board:
        """A board, and for `armtree` a robot file that says so.

        In the end, what it read is compared with what was recorded.
        """
        self._boards.append(Board(self.folder, firmware, boot_s))
        if firmware == "armtree":
            self.robot({'firmware = "stock"': 'firmware = "armtree"'})
        return self._boards[-1]

    def write(self, texts: Mapping[str, str]) -> None:
        """Write files of its folder, by their names."""
        for name, text in texts.items():
            (self.folder / name).parent.mkdir(exist_ok=True)
            (self.folder / name).write_text(text)

    def robot(self, text: Mapping[str, str] | None = None) -> Path:
        """The shipped robot file with the shortest wait for the boot, and these texts replaced."""
        new = ROBOT_FILE.read_text()
        urdf = {'"arduinobot.urdf"': f'"{ROBOT_FILE.with_suffix(".urdf")}"'}
        short = {"boot_wait_s = 2.0": "boot_wait_s = 1.0"}
        for old, value in {**urdf, **short, **(text or {})}.items():
            assert old in new, old
            new = new.replace(old, value)
        path = self.folder / "robot.toml"
        path.write_text(new)
        return path

    def run(self, *arguments: str | Path, board: Board | None = None, **options: object) -> Command:
        """`armtree run ... --json` with the tasks of this folder; options as of `Command`."""
        port = board.port if board else "virtual"
        line = ["run", *arguments, "--json", *self._common(port)]
        return self._start(Command, line, options)

    def moving(
        self,
        board: Board,
        task: str = "20",
        frames: tuple[int, int] = (1, 12),
        calls: WrongCalls | None = None,
        disk: SmallDisk | None = None,
    ) -> Command:
        """A run of a task, a random part of a period after a random number of frames."""
        faulty = calls or disk
        options = {"argv": disk.argv} if disk else {}
        run = self.run(task, board=board, environment=faulty and faulty.environment, **options)
        run.until_event("sent", self.random.randint(*frames))
        time.sleep(self.random.uniform(0.0, board.period))  # noqa: TID251, a random moment
        return run

    def faulted(self, run: Command, *codes: str) -> float:
        """Check that a run ends with a hardware fault and sends nothing after it; when [s].

        What a board has read afterwards is known from its own log.
        """
        self.ended(run, 6)
        (result,) = run.events("result")
        self.check(result["code"] in codes, f"the code is {result['code']}")
        labels = "raise_error", "transition_error"  # of an active arm, and of one that boots
        failing = next(each for each in run.events("lifecycle") if each["label"] in labels)
        failed, sent = float(failing["time_s"]), run.events("sent")
        late = [each for each in sent if each["time_s"] > failed]
        self.check(not late, f"{len(late)} frames were sent after the fault")
        for board in self._boards:
            read = board.frames()
            more = len(read) - len(sent) - self.unrecorded
            self.check(more <= 0, f"{more} frames reached the board, and were not reported")
            after = [each for each in read if each.time > failed + LATE_S]
            self.check(not after, f"the board has read {len(after)} frames after the fault")
        return failed

    def serve(
        self, *arguments: str | Path, board: Board | None = None, **options: object
    ) -> Server:
        """`armtree serve`, listening, with the tasks of this folder; options as of `Command`."""
        port = board.port if board else "virtual"
        line = ["serve", "--tcp-port", "0", *arguments, *self._common(port)]
        server = self._start(Server, line, options).listening()
        if "--activate" in arguments:
            until("the arm is active", lambda: server.state() == "active")
        return server

    def armtree(self, *arguments: str | Path, **options: object) -> Command:
        """Any other command, as it is given."""
        return self._start(Command, list(arguments), options)

    def _common(self, port: str | Path) -> list[str | Path]:
        robot = self.folder / "robot.toml"
        trees = self.folder / "trees"
        robot = robot if robot.exists() else self.robot()
        return ["--port", port, "--robot", robot, "--trees", trees if trees.exists() else TASKS]

    def _start(self, kind: type[C], line: list[str | Path], options: Mapping[str, object]) -> C:
        command = kind(self.folder, line, **options)  # type: ignore[arg-type]
        self._commands.append(command)
        return command

    def recordings(self) -> list[Path]:
        """The recordings in its folder, oldest first."""
        return sorted(self.folder.glob("recordings/*.mcap"))

    def verified(self, *statuses: int) -> None:
        """Every recording holds (0, the default), or is what a crash leaves (10).

        `verify` checks it when all injections of the row are over.
        """
        self.verdicts = statuses or (0,)

    def recovered(self, *statuses: int) -> None:
        """`log recover` of all recordings ends with one of these: 0, or 10 if one was cut off."""
        self.ended(self.armtree("log", "recover", *self.recordings()), *statuses)

    def no_traceback(self) -> None:
        for command in self._commands:
            known = "Traceback" not in command.text() or command.interrupted_python()
            self.check(known, f"a traceback in {command.errors.name}")

    def no_survivors(self) -> None:
        for command in self._commands:
            if command.popen.poll() is not None:
                with contextlib.suppress(Hang):
                    until("the end of its processes", lambda: not command.family(), 20)  # noqa: B023
                self.check(not command.family(), f"{command.output.stem}: it left processes behind")

    def finish(self) -> None:
        """End all, and compare each board with the recordings."""
        with contextlib.ExitStack() as stack:  # whatever fails, nothing is left
            for board in self._boards:
                stack.callback(board.close)
            for command in self._commands:
                stack.callback(command.close)
            for command in self._commands:
                if isinstance(command, Server) and command.popen.poll() is None:
                    command.signal(signal.SIGTERM)  # after SIGKILL, a frame could be unrecorded
                    command.signal(signal.SIGCONT)
                    with contextlib.suppress(Hang):
                        command.wait(20)
            self.no_survivors()
        self.no_traceback()
        if self._boards:
            read = b"".join(board.data() for board in self._boards)
            unrecorded, unreceived = compare(read, recorded(self.recordings()))
            self.check(
                unrecorded <= self.unrecorded, f"{unrecorded} frames reached the board unrecorded"
            )
            self.check(
                unreceived <= self.unreceived, f"{unreceived} recorded frames missed the board"
            )
        starved = max((board.starved for board in self._boards), default=0.0)
        if self.problems and starved > LATE_S:  # then they may be due to it
            self.problems.append(f"the program of the board did not run for {starved:.2f} s")


def last_line(command: Command) -> str:
    """The last line that a command printed."""
    lines = command.text().strip().splitlines()
    return lines[-1][:200] if lines else "(nothing)"


class Recorded(NamedTuple):
    """Bytes that a recording holds, and when they were written [s since 1970]."""

    time: float
    data: bytes


def frames_of(path: Path) -> Iterator[Recorded]:
    """What a recording, finished or not, says was written to the port."""
    for when, data in messages(path, "/serial/tx"):
        # CDR: 4 bytes of header, seq, direction, padding, length of the data, data.
        length = int.from_bytes(data[16:20], "little")
        yield Recorded(when, data[20 : 20 + length])


def motions_of(path: Path) -> list[list[float]]:
    """When each frame of each motion of a recording was due, from the begin of the motion [s]."""
    # CDR: 4 bytes of header, length of the text, text with a zero.
    return [json.loads(data[8:-1])["times"] for _, data in messages(path, "/schedule")]


def delays(times: Sequence[float], motions: Iterable[Sequence[float]]) -> Iterator[Sequence[float]]:
    """How late each frame of each motion was [s], but for a time that all of a motion share.

    Args:
        times: When the frames came, motion after motion; the last may be incomplete [s].
        motions: When they were due, from the begin of their motion [s].
    """
    for planned in motions:
        seen, times = times[: len(planned)], times[len(planned) :]
        yield [when - due for when, due in zip(seen, planned, strict=False)]


def messages(path: Path, topic: str) -> Iterator[tuple[float, bytes]]:
    """Times [s since 1970] and data of a topic. Reads no code of armtree."""
    channels: dict[int, str] = {}
    with path.open("rb") as stream, contextlib.suppress(McapError, EOFError):
        for record in StreamReader(stream, record_size_limit=2**26).records:
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Message) and channels.get(record.channel_id) == topic:
                yield record.log_time / 1e9, record.data


def recorded(paths: Iterable[Path]) -> bytes:
    """The bytes written to the port in all these recordings, in the order of their times."""
    found = [each for path in paths for each in frames_of(path)]
    return b"".join(each.data for each in sorted(found, key=lambda each: each.time))


def compare(board: bytes, recording: bytes) -> tuple[int, int]:
    """Compare what a board read with what was recorded.

    Returns:
        How many frames (or pieces of one) only the board has, and how many only the recording has.
        A frame that the board read in part is one that only the recording has.
    """
    if board == recording:
        return 0, 0
    read, wrote = _TOKENS.findall(board), _TOKENS.findall(recording)
    only_board = only_recording = 0
    matcher = difflib.SequenceMatcher(None, read, wrote, autojunk=False)
    for _, begin, end, first, last in matcher.get_opcodes():
        here, there = read[begin:end], wrote[first:last]
        if here != there:
            torn = bool(here and there and b"".join(there).startswith(b"".join(here)))
            only_board += 0 if torn else len(here)
            only_recording += len(there)
    return only_board, only_recording


def verify(asked: Sequence[Scene], scene: Scene) -> None:
    """Verify the recordings of scenes with one command, whose start takes longest.

    Args:
        asked: Scenes that have called `verified`.
        scene: That of the command.
    """
    scene.injections = 0
    folders = [one.folder / "recordings" for one in asked if one.recordings()]
    command = scene.armtree("replay", *folders, "--verify", "--json")
    command.wait()
    statuses = dict[Path, int]()
    for each in map(json.loads, command.output.read_text().splitlines()):
        if "verdicts" in each:  # else it is an error of the command
            differs = not all(verdict["holds"] for verdict in each["verdicts"])
            statuses[Path(each["path"])] = 12 if differs else exit_status(each["code"] or "ok")
    for one in asked:
        seen = {path.name: statuses.get(path) for path in one.recordings()}
        worst = max((-1 if each is None else each for each in seen.values()), default=None)
        held = None not in seen.values() and worst in one.verdicts
        one.check(held, f"replay --verify: {seen or 'no recording'}, not {one.verdicts}")
    scene.ended(command, max(statuses.values(), default=0))


def inject(one: Row, folder: Path, seed: str, number: int = 0) -> Scene:
    """Inject a row's fault once. What the function raises, and a hang, is a problem of the row."""
    folder.mkdir(parents=True)
    scene = Scene(folder, seed, number, one.times)
    try:
        one.inject(scene)
    except Hang as error:
        scene.problems.append(str(error))
    except Exception as error:  # the row is wrong, or what it talks to
        scene.problems.append(f"{type(error).__name__}: {error}")
    finally:
        with scene.cleanup:
            try:
                scene.finish()
            except Exception as error:
                scene.problems.append(f"at the end: {type(error).__name__}: {error}")
    return scene
