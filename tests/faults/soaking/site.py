"""What a soak has: one server, its board, and what was found out about them so far."""

import contextlib
import json
import shutil
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.faults.board import Board
from tests.faults.means.wrong_calls import WrongCalls, together
from tests.faults.process import HANG_S, Command, Hang, Server, until
from tests.faults.row import TASKS, Scene, compare, frames_of

_OWN_TASKS = Path(__file__).with_name("tasks")
RESULTS_S = 120  # the server keeps results for longer than a round takes, but not for long
# No fault of a soak excuses a code that begins like this.
WRONG = (
    *("internal", "skill.", "hw.driver", "hw.too_fast", "hw.joint", "hw.claimed", "hw.bad", "log."),
    *("server", "file", "plan.bad", "plan.error", "plan.model", "plan.not_finite"),
)
# `log.unreadable`: a recording whose first write takes long.
OF_THE_DISK = {"log.behind", "log.incomplete", "log.disk_full", "log.unreadable"}
_INCOMPLETE = 10


class Site:
    """A server, its board, and what was found.

    Args:
        scene: An empty folder, and what runs in it. Its seed chooses the policy and the firmware.

    Attributes:
        codes: How often each code came.
        problems: What does not hold.
        spoiled: How many faults of the port this round has. Each may cost frames on the way, and
            the record of one frame that was written too late.
        disk_spoiled: Whether this round has faults of the disk. They excuse what goals say of their
            recordings, and that these are cut off.
        verified: How many recordings were verified and hold.
        incomplete: How many a failing disk has cut off.
        disk_failed: Whether a disk has failed; the recording of the server may lack something then.
        frozen: From when to when the server was frozen [s, monotonic].
        stops: How long each stop took, without the time for which the server was frozen [s].
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        folder, random = scene.folder, scene.random
        self.folder = folder
        self.codes: Counter[str] = Counter()
        self.problems: list[str] = []
        self.frozen: list[tuple[float, float]] = []
        self.stops: list[float] = []
        self.goals: list[str] = []
        self.spoiled = 0
        self.disk_spoiled = self.disk_failed = False
        self.plugged = True
        self.unreceived = self.verified = self.incomplete = self.recorded_bytes = 0
        self._lock, self._commands = threading.Lock(), 0
        self._read = self._server_frames = self._errors_read = 0
        self._seen: dict[Path, int] = {}
        shutil.copytree(TASKS, folder / "trees")
        shutil.copytree(_OWN_TASKS, folder / "trees", dirs_exist_ok=True)
        firmware = random.choice(["stock", "armtree"])
        self.policy = random.choice(["reject", "queue", "preempt"])
        self.board: Board = self.scene.board(firmware)
        self.calls = WrongCalls(folder, "/dev/pts/")
        self.disk = WrongCalls(folder, ".mcap", name="disk")
        self.sync = WrongCalls(folder, ".mcap", "sync", name="sync")
        kinds = self.calls, self.disk, self.sync
        self.server: Server = self.scene.serve(
            *("--rosbridge", "--policy", self.policy, "--result-timeout", str(RESULTS_S)),
            board=self.board,
            environment=together(*(each.environment for each in kinds)),
        )
        self.words = f"policy {self.policy}, firmware {firmware}"

    def problem(self, text: str) -> None:
        """Note what does not hold."""
        with self._lock:
            self.problems.append(text)

    def code(self, code: str, where: str) -> None:
        """Count a code; one that nothing excuses is a problem."""
        with self._lock:
            self.codes[code] += 1
        if code.startswith(WRONG) and not (self.disk_spoiled and code in OF_THE_DISK):
            self.problem(f"the code {code} of {where}")

    def request(self, method: str, path: str, body: object = None) -> tuple[int, Any]:
        """Send a request; count the code of a refusal."""
        status, answer = self.server.request(method, path, body)
        if status >= 400:
            if isinstance(answer, dict) and "code" in answer:
                self.code(str(answer["code"]), f"{method} {path}: {answer.get('message')}")
            else:
                self.problem(f"{method} {path} is answered with {status} and {str(answer)[:100]!r}")
        return status, answer

    def send(self, task: int, **fields: object) -> str:
        """Send a goal; return its id, or nothing if it was refused."""
        status, answer = self.request("POST", "/api/goals", {"task": task, **fields})
        if status != 201:
            return ""
        with self._lock:
            self.goals.append(answer["goal_id"])
        return str(answer["goal_id"])

    def result(self, goal_id: str, seconds: float = HANG_S) -> dict[str, Any]:
        """Wait for the end of a goal; return its result, or the error."""
        path = f"/api/goals/{goal_id}/result?timeout={seconds:g}"
        answer: dict[str, Any] = self.server.request("GET", path, seconds=seconds + HANG_S)[1]
        return answer

    def command(self, *arguments: str, server: bool = True) -> Command:
        """Start an `armtree` command that talks to the server, in a folder of its own."""
        with self._lock:
            self._commands += 1
            folder = self.folder / "commands" / str(self._commands)
        folder.mkdir(parents=True)
        address = ("--server", self.server.url) if server else ()
        runtime = {"XDG_RUNTIME_DIR": str(self.folder)}
        return Command(folder, [*arguments, *address], environment=runtime)

    def ended(self, command: Command, allowed: Sequence[int] | None = None) -> str:
        """Wait for the end of a command, remove its folder; return what it printed.

        Args:
            command: The command.
            allowed: Exit statuses that are not a problem; default: any but 1, a bug in armtree.
        """
        words = " ".join(map(str, command.popen.args[1:3]))  # type: ignore[index]
        try:
            status = command.wait()
        finally:
            command.close()
        text = command.text()
        if "frozen site" in text:  # Ctrl-C came before Python had started
            status, text = 130, ""
        if status == 1 or (allowed is not None and status not in allowed):
            self.problem(f"{words} ends with {status}: {text[-200:]!r}")
        if "Traceback" in text:
            self.problem(f"{words} printed a traceback: {text[-300:]!r}")
        shutil.rmtree(command.output.parent, ignore_errors=True)
        return text

    def repair(self) -> None:
        """Do what a person does at the cable, at the power and at the board."""
        for each in (self.calls, self.disk, self.sync):
            each.stop()
        if not self.plugged:
            self.board.ask(f"replug {self.board.port.name}")
            self.plugged = True
        self.board.ask("go")

    def stop(self) -> None:
        """Stop the arm."""
        begin = time.monotonic()
        self.server.stop()
        end = time.monotonic()
        frozen = sum(max(0.0, min(end, last) - max(begin, first)) for first, last in self.frozen)
        self.stops.append(end - begin - frozen)

    def end_goals(self) -> None:
        """Cancel all, and check that every goal of the round has ended."""
        self.stop()
        goals, self.goals = self.goals, []
        for goal_id in goals:
            with contextlib.suppress(Hang):
                until(goal_id, lambda goal_id=goal_id: self._ending(goal_id))  # type: ignore[misc]
            result = self._ending(goal_id)
            if result is None:
                self.problem(f"goal {goal_id} has not ended after a stop")
            else:
                self.code(str(result["code"]), f"goal {goal_id}: {result['message']}")

    def _ending(self, goal_id: str) -> dict[str, Any] | None:
        """The result of a goal, or None if it has not ended."""
        answer: dict[str, Any] = self.server.get(f"/api/goals/{goal_id}")
        return answer.get("result") or (answer if "code" in answer else None)

    def compare(self) -> None:
        """Compare what the board has read since the last call with what was recorded since."""
        data = self.board.data()
        read, self._read = data[self._read :], len(data)
        frames = []
        for path in self.scene.recordings():
            of_this = list(frames_of(path))
            frames += of_this[self._seen.get(path, 0) :]
            self._seen[path] = len(of_this)
        wrote = b"".join(each.data for each in sorted(frames, key=lambda each: each.time))
        unrecorded, unreceived = compare(read, wrote)
        self.unreceived += unreceived
        if unrecorded > self.spoiled:
            self.problem(f"{unrecorded} frames reached the board unrecorded")
        if unreceived and not self.spoiled:
            self.problem(f"{unreceived} recorded frames missed the board")
        self.spoiled = 0

    def verify(self, last: bool = False) -> None:
        """Verify the recordings that ended, and delete them; at last also the server's own."""
        files = [path for path in self.scene.recordings() if last or "-server" not in path.name]
        if not files:
            return
        words = ("replay", *map(str, files), "--verify", "--jobs", "1", "--json")
        command = self.command(*words, server=False)
        with contextlib.closing(command):
            status = command.wait(20 * HANG_S)
            text = self.ended(command)
        held = sum(json.loads(each)["holds"] for each in text.splitlines() if each[:1] == "{")
        spoiled = self.disk_spoiled or (last and self.disk_failed)
        if excused := status == _INCOMPLETE and spoiled:
            self.incomplete += len(files) - held
        if not (excused or (status == 0 and held == len(files))):
            kept = self.folder / "kept"
            kept.mkdir(exist_ok=True)
            for path in files:
                shutil.copy(path, kept)
            self.problem(f"{held} of {len(files)} hold, status {status}: {text[-300:]!r}")
        self.disk_spoiled = False
        self.verified += held
        for path in files:
            self.recorded_bytes += path.stat().st_size
            self._seen.pop(path, None)
            path.unlink()

    def tracebacks(self) -> None:
        """Tracebacks in the log of the server since the last call are problems."""
        text = self.server.errors.read_text(errors="replace")
        new, self._errors_read = text[self._errors_read :], len(text)
        if "Traceback" in new:
            self.problem(f"the server printed a traceback: {new[new.index('Traceback') :][:600]!r}")

    def remove(self) -> None:
        """Delete the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
