"""The command as a user runs it, in a process and a folder of its own."""

import contextlib
import ctypes
import http.client
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

ARMTREE = Path(sys.executable).with_name("armtree")
MARK = "ARMTREE_FAULTS_COMMAND"  # a variable that all processes of a command inherit
LIBC = ctypes.CDLL(None)
PR_CAPBSET_DROP, CAP_SYS_RESOURCE = 24, 24
HANG_S = 60.0  # longer than any honest wait, even on a busy machine


# Set when the program is to end: then nothing waits any more, and nothing is started.
INTERRUPTED = threading.Event()


class Hang(Exception):
    """Something did not happen in time."""


def until(what: str, done: Callable[[], Any], seconds: float = HANG_S) -> Any:
    """Wait for a true value, and return it.

    Raises:
        Hang: It did not come in time, or the program is to end.
    """
    end = time.monotonic() + seconds
    while not (value := done()):
        if time.monotonic() > end or INTERRUPTED.is_set():
            raise Hang(f"{what}: not within {seconds:g} s")
        time.sleep(0.004)  # noqa: TID251, it waits for another process
    return value


class Command:
    """A running `armtree` command. Its output goes to two files.

    Args:
        folder: Its working folder, and that of its runtime files.
        arguments: What follows `armtree`.
        environment: Variables beside PATH, HOME and XDG_RUNTIME_DIR.
        limits: Limits of the operating system: `resource.RLIMIT_...` and the value, both hard.
        argv: What to run in place of `armtree`.
    """

    def __init__(
        self,
        folder: Path,
        arguments: Sequence[str | Path],
        environment: Mapping[str, str] | None = None,
        limits: Mapping[int, int] | None = None,
        argv: Sequence[str | Path] = (ARMTREE,),
        stdin: int | None = subprocess.DEVNULL,
    ) -> None:
        if INTERRUPTED.is_set():
            raise Hang("the program is to end")
        self.words = str(arguments[0])
        number = len(list(folder.glob("*.out")))
        self.output, self.errors = folder / f"{number}.out", folder / f"{number}.err"
        variables = {
            "PATH": os.environ["PATH"],
            "HOME": str(folder),
            "XDG_RUNTIME_DIR": str(folder),
            "TERM": "dumb",
            # Python keeps a file of bytecode that such a limit has cut, and fails at each import.
            **({"PYTHONDONTWRITEBYTECODE": "1"} if resource.RLIMIT_FSIZE in (limits or ()) else {}),
            **(environment or {}),
            MARK: uuid.uuid4().hex,
        }
        self._mark = f"{MARK}={variables[MARK]}".encode()

        def prepare() -> None:
            for which, value in (limits or {}).items():
                resource.setrlimit(which, (value, value))
            if limits:  # with this capability, root exceeds a hard limit
                LIBC.prctl(PR_CAPBSET_DROP, CAP_SYS_RESOURCE)
            for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
                signal.signal(number, signal.SIG_DFL)  # as in a shell, also under nohup

        self.started = time.monotonic()
        with self.output.open("wb") as output, self.errors.open("wb") as errors:
            self.popen = subprocess.Popen(
                [*argv, *arguments],
                cwd=folder,
                env=variables,
                stdin=stdin,
                stdout=output,
                stderr=errors,
                start_new_session=True,
                preexec_fn=prepare,  # noqa: PLW1509, it takes no lock
            )
        self.pid = self.popen.pid

    def text(self) -> str:
        """What it printed so far, on both streams."""
        return self.output.read_text(errors="replace") + self.errors.read_text(errors="replace")

    def interrupted_python(self) -> bool:
        """Whether Ctrl-C came while Python was starting: then it prints a traceback of its own."""
        text = self.text()
        of_armtree = "sys.exit(main())", "multiprocessing"  # of the command, of its workers
        return "KeyboardInterrupt" in text and not any(words in text for words in of_armtree)

    def events(self, kind: str | None = None) -> list[dict[str, Any]]:
        """The objects that `--json` printed so far."""
        lines = self.output.read_text(errors="replace").splitlines(keepends=True)
        objects = [json.loads(line) for line in lines if line.endswith("\n") and line[0] == "{"]
        return [each for each in objects if kind in (None, each["event"])]

    def until_event(self, kind: str, count: int = 1, seconds: float = HANG_S) -> dict[str, Any]:
        """Wait until so many events of a kind were printed; return the newest of them."""

        def found() -> list[dict[str, Any]]:
            events = self.events(kind)
            if len(events) < count and self.popen.poll() is not None:
                said = f"{kind} number {count}: {self.text()[-300:]}"
                raise Hang(f"it ended with {self.popen.poll()} before {said}")
            return events[count - 1 : count]

        event: dict[str, Any] = until(f"{kind} number {count}", found, seconds)[0]
        return event

    def until_printed(self, words: str, seconds: float = HANG_S) -> str:
        """Wait until a line with these words was printed, and return it."""

        def found() -> str:
            ended = self.popen.poll() is not None
            lines = [line for line in self.text().splitlines() if words in line]
            if not lines and ended:
                raise Hang(f"it ended with {self.popen.poll()} before it printed {words!r}")
            return lines[0] if lines else ""

        return str(until(f"the words {words!r}", found, seconds))

    def signal(self, number: int) -> float:
        """Send a signal; return when [s, monotonic]."""
        os.kill(self.pid, number)
        return time.monotonic()

    def wait(self, seconds: float = HANG_S) -> int:
        """Wait for its end; return the exit status.

        Raises:
            Hang: It did not end in time.
        """
        until("its end", lambda: self.popen.poll() is not None, seconds)
        return self.popen.returncode

    def memory(self) -> float:
        """Of the process itself, resident [MiB]."""
        return memory_of(self.pid)

    def most_memory(self) -> float:
        """Of the largest of its processes, resident [MiB]; 0 if all have ended."""
        most = 0.0
        for pid in [self.pid, *self.family()]:
            with contextlib.suppress(OSError, IndexError):  # it has just ended
                most = max(most, memory_of(pid))
        return most

    def descriptors(self) -> int:
        return len(os.listdir(f"/proc/{self.pid}/fd"))

    def threads(self) -> int:
        return len(os.listdir(f"/proc/{self.pid}/task"))

    def processor(self) -> float:
        """Processor time of the process itself [s]."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def family(self) -> list[int]:
        """All processes that it started and that still run, also after its own end."""
        return [pid for pid in processes() if pid != self.pid and self._mark in variables_of(pid)]

    def close(self) -> None:
        """End it and all it started, whatever it does."""
        for pid in [self.pid, *self.family()]:
            if pid != self.pid or self.popen.poll() is None:
                kill(pid, signal.SIGCONT)
                kill(pid, signal.SIGKILL)
        self.popen.wait(10)


def memory_of(pid: int) -> float:
    """The resident memory of a process [MiB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def processes() -> Iterator[int]:
    return (int(name) for name in os.listdir("/proc") if name.isdigit())


def variables_of(pid: int) -> list[bytes]:
    """The environment of a process; none if it ended, or is a zombie."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:
        return []


def kill(pid: int, number: int) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


class Server(Command):
    """A running `armtree serve` on a free port."""

    address: tuple[str, int]
    token: str

    def listening(self) -> "Server":
        """Wait until it listens."""
        line = self.until_printed("Listening on http://")
        host, _, number = line.partition("http://")[2].partition(";")[0].rpartition(":")
        self.address = host.strip("[]"), int(number.split()[0])
        self.token = self.until_printed("Token for requests").rpartition(" ")[2]
        return self

    @property
    def url(self) -> str:
        return f"http://{self.address[0]}:{self.address[1]}"

    def request(
        self,
        method: str,
        path: str,
        body: object = None,
        headers: Mapping[str, str] | None = None,
        token: bool = True,
        seconds: float = HANG_S,
    ) -> tuple[int, Any]:
        """Send a request; return the status and the JSON, or the text if it is none."""
        connection = http.client.HTTPConnection(*self.address, timeout=seconds)
        sent = {"authorization": f"Bearer {self.token}"} if token else {}
        data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
        if data is not None:
            sent["content-type"] = "application/json"
        try:
            connection.request(method, path, data, {**sent, **(headers or {})})
            response = connection.getresponse()
            text = response.read()
        except TimeoutError:
            raise Hang(f"{method} {path}: no answer within {seconds:g} s") from None
        finally:
            connection.close()
        try:
            return response.status, json.loads(text)
        except ValueError:
            return response.status, text.decode(errors="replace")

    def get(self, path: str) -> Any:
        """The JSON of a GET."""
        return self.request("GET", path)[1]

    def post(self, path: str, body: object = None) -> Any:
        """The JSON of a POST."""
        return self.request("POST", path, {} if body is None else body)[1]

    def goal(self, task: int, **fields: object) -> str:
        """Send a goal; return its id."""
        answer = self.post("/api/goals", {"task": task, **fields})
        if "goal_id" not in answer:
            raise Hang(f"the goal was refused: {answer}")
        return str(answer["goal_id"])

    def result(self, goal_id: str) -> dict[str, Any]:
        """Wait for the end of a goal; return its result."""
        answer: dict[str, Any] = self.get(f"/api/goals/{goal_id}/result")
        return answer

    def state(self) -> str:
        """The state of the arm's lifecycle."""
        return str(self.get("/api/status")["arm"])

    def stop(self) -> float:
        """Stop as `curl` does, without token; return how long the answer took [s]."""
        begin = time.monotonic()
        status, answer = self.request("POST", "/api/stop", token=False)
        if status != 200:
            raise Hang(f"a stop was answered with {status}: {answer}")
        return time.monotonic() - begin
