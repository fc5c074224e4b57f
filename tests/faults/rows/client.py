"""Clients of a server, and what other programs at its address may do to them."""

import contextlib
import functools
import itertools
import json
import os
import signal
import socket
import threading
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial

from tests.faults.process import Command, until
from tests.faults.row import TASKS, Scene, row

Answer = Callable[[], Iterable[bytes]]


@row(
    "token-address",
    "another user's program listens at other addresses of the machine, with the server's port",
    "`--server http://localhost:PORT` reaches the server; the other program never gets the token",
    times=3,
)
def token_address(scene: Scene) -> None:
    server = scene.serve()
    port = server.address[1]
    heads: list[bytes] = []

    def listen(listener: socket.socket) -> None:
        while True:
            connection, _ = listener.accept()
            with connection:
                heads.append(connection.recv(65_536))
                connection.sendall(b"HTTP/1.1 200 OK\r\ncontent-length: 2\r\n\r\n{}")

    with (
        socket.create_server(("::1", port), family=socket.AF_INET6) as six,
        socket.create_server(("127.0.0.2", port)) as four,
    ):
        for each in (six, four):
            threading.Thread(target=listen, args=(each,), daemon=True).start()
        for host in ("localhost", "127.0.0.1"):
            status = scene.armtree("status", "--server", f"http://{host}:{port}")
            scene.ended(status, 0, what=host)
        scene.check(not heads, "a command connected to another program")
        for host in ("[::1]", "127.0.0.2"):
            scene.armtree("cancel", "--server", f"http://{host}:{port}").wait()
        scene.check(len(heads) == 2, f"{len(heads)} requests reached the other program, not 2")
        token = server.token.encode()
        scene.check(not any(token in head for head in heads), "it was sent the token")


def answer(body: bytes, status: str = "200 OK", *headers: str) -> Answer:
    """A program that answers every request with this."""
    lines = (f"HTTP/1.1 {status}", f"content-length: {len(body)}", *headers, "", "")
    return lambda: ["\r\n".join(lines).encode() + body]


@functools.cache
def bomb() -> Iterable[bytes]:
    """An answer of 300 MB of zeros, packed."""
    packer = zlib.compressobj(wbits=31)
    packed = b"".join([packer.compress(bytes(10**6)) for _ in range(300)]) + packer.flush()
    return answer(packed, "200 OK", "content-encoding: gzip")()


def endless(first: bytes, piece: bytes) -> Answer:
    """A program whose answer does not end."""
    return lambda: itertools.chain([first], itertools.repeat(piece))


def slowly(first: bytes, piece: bytes) -> Answer:
    """A program whose answer does not end, and comes in small pieces."""

    def pieces() -> Iterator[bytes]:
        yield first
        while True:
            yield piece
            time.sleep(0.5)  # noqa: TID251, the fault

    return pieces


OK = b"HTTP/1.1 200 OK\r\n"
WRONG: dict[str, Answer] = {
    "another protocol": lambda: [b"SSH-2.0-OpenSSH_9.2\r\n"],
    "nothing": list,
    "text": answer(b"<html>It works!</html>"),
    "a list": answer(b"[]"),
    "other keys": answer(b'{"goal_id": 7, "status": "ok"}'),
    "deep JSON": answer(b"[" * 100_000),
    "a redirect": answer(b"", "302 Found", "location: http://127.0.0.1:1/"),
    "another error": answer(b'{"detail": "Not Found"}', "404 Not Found"),
    "an endless body": endless(OK + b"\r\n", b"x" * 65_536),
    "an endless event": endless(OK + b"\r\n: armtree\n\ndata: ", b"x" * 65_536),
    "an endless head": endless(OK, b"a: b\r\n" * 10_000),
    "a bomb": bomb,
    "a slow head": slowly(OK, b"a: b\r\n"),
    "a slow body": slowly(OK + b"content-length: 5000\r\n\r\n", b" "),
    "a slow chunk": slowly(OK + b"transfer-encoding: chunked\r\n\r\n1;", b"x"),
    "a slow row of 102": slowly(b"", b"HTTP/1.1 102 Processing\r\n\r\n"),
    "a flood of 100": endless(b"", b"HTTP/1.1 100 Continue\r\n\r\n" * 1000),
}
COMMANDS = (
    *("send 23", "send 23 --wait", "cancel", "status", "watch", "arm activate", "pause"),
    *("resume", "step", "break swing", "answer", "status --json", "cancel --json"),
)


@contextlib.contextmanager
def program(pieces: Answer, greets: bool = False) -> Iterator[str]:
    """The address of a program that sends this to every client, at once or to its first words."""

    def serve() -> None:
        with contextlib.suppress(OSError):  # the row is over
            while True:
                connection, _ = listener.accept()
                threading.Thread(target=say, args=(connection,), daemon=True).start()

    def say(connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError):  # the command is over
            if not greets:
                connection.recv(65_536)
            for piece in pieces():
                connection.sendall(piece)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(65_536):
                pass

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=serve, daemon=True).start()
        yield f"127.0.0.1:{listener.getsockname()[1]}"


@row(
    "wrong-server",
    "another program answers each command: no JSON, a list, other keys, a redirect, a body or head "
    "without end, at once or slowly, 0.3 MB that unpack to 0.3 GB",
    "exit status 13 and one line, beside one while it waits; memory stays below 200 MiB",
    limit=15,
    unit="s",
    times=4,
)
def wrong_server(scene: Scene) -> None:
    lines = [f"{words} --server http://{{}}" for words in scene.share(COMMANDS)]
    wrong_program(scene, WRONG, lines)


def wrong_program(
    scene: Scene, wrong: Mapping[str, Answer], lines: Sequence[str], **how: bool
) -> None:
    """Run each command at each of these programs: it ends with 13 and one line, and takes little.

    Args:
        scene: The injection.
        wrong: What each program sends. Those with `slow` in their names run at the same time.
        lines: The commands, each with {} for the address of a program.
        how: As of `program`.
    """
    commands, memory, seconds = dict[str, Command](), dict[str, float](), dict[str, float]()

    def ended(what: str) -> bool:
        for each, command in commands.items():
            with contextlib.suppress(OSError, ValueError):  # it has just ended
                memory[each] = max(memory.get(each, 0.0), command.memory())
            if command.popen.poll() is not None:
                seconds.setdefault(each, time.monotonic() - command.started)
        return what in seconds

    with contextlib.ExitStack() as stack:
        for name in sorted(wrong, key=lambda name: "slow" not in name):
            address = stack.enter_context(program(wrong[name], **how))
            for line in lines:
                what = f"{line} at {name}"
                commands[what] = scene.armtree(*line.format(address).split())
                if "slow" not in name:
                    until(f"the end of {what}", partial(ended, what))
        for what in commands:
            until(f"the end of {what}", partial(ended, what))
    for what, command in commands.items():
        scene.figure(seconds[what])
        scene.ended(command, 13, what=what)
        printed = command.errors.read_text().splitlines()
        said = [each for each in printed if "answer yet" not in each]  # it waits
        scene.check(len(said) == 1 and "bug" not in said[0], f"{what}: it says {said}")
        scene.check(memory[what] < 200, f"{what}: {memory[what]:.0f} MiB")
    scene.injections = len(commands)


EVIL = "\x1b]0;owned\x07\x1b[2J\x9b1A\r\u202e"
LINES = "\nError: forged\n2026-01-01 00:00:00,000 ERROR   forged"
FORGED = EVIL + LINES
SKILLS = f"""
import logging
from armtree import skill

@skill
def evil_log() -> str:
    logging.getLogger("skill").warning({FORGED!r})
    return {FORGED!r}

@skill
def evil_raise() -> None:
    raise RuntimeError({FORGED!r})
"""
TASK = f"""task: 60
name: evil
description: {json.dumps("Says" + LINES)}
tree:
  sequence:
    - Say: {{text: {json.dumps("owned" + LINES)}, value: 1}}
    - evil_log: {{result: $said}}
    - Say: {{text: $said, value: 1}}
    - evil_raise
"""


ERROR = {
    "code": "goal.busy",
    "message": FORGED,
    "node": EVIL,
    "joint": EVIL,
    "argument": EVIL,
    "value": None,
    "limit": None,
    "hint": FORGED,
    "place": EVIL,
}
# Over what a server answers: the texts of several operations.
TEXTS = {
    "fault": ERROR,
    "port": FORGED,
    "phase": FORGED,
    "node": FORGED,
    "breakpoints": [FORGED],
    "url": FORGED,
    "questions": [{"question_id": 8 * "a", "text": FORGED, "choices": [FORGED]}],
}
REFUSED = ("status", "send 23", "send 23 --wait", "cancel", "watch", "arm activate", "pause")
ANSWERED = ("status", "status --json", "break", "break swing", "answer", "view --print")


@row(
    "escapes",
    "a task's texts, what its skills log, return and raise, the errors and answers of a server, and"
    " its file in the runtime folder have control characters and forged lines",
    "no command and no log prints a control character, or a forged line at the start of a line",
    times=2,
)
def escapes(scene: Scene) -> None:
    nothing = (TASKS / "23_nothing.yaml").read_text()
    texts = {"trees/60_evil.yaml": TASK, "trees/23_nothing.yaml": nothing}
    scene.write({**texts, "skills/evil.py": SKILLS})
    trees, skills = ("--trees", "trees"), ("--skills", "skills")
    server = scene.serve("--activate", *skills)
    watching = scene.armtree("watch", "--verbose", "--server", server.url)
    until("the watcher", lambda: server.result(server.goal(23)) and watching.text())
    server.result(done := server.goal(23))
    run = ("run", "60", "--port", "virtual", *trees, *skills)
    ends = [
        (scene.armtree("send", "60", "--wait", "--server", server.url), 11),
        (scene.armtree(*run), 11),
        (scene.armtree(*run, "--verbose"), 11),
        (scene.armtree("tasks", *trees), 0),
        (scene.armtree("show", "60", "--ports", *trees, *skills), 0),
    ]
    honest = {**server.get("/api/where"), **server.get("/api/status")}
    forged = {**honest, **TEXTS, "goal": server.get(f"/api/goals/{done}")}
    with (
        program(answer(json.dumps(ERROR).encode(), "409 Conflict")) as refusing,
        program(answer(json.dumps(forged).encode())) as answering,
    ):
        for words in REFUSED:
            asked = [*words.split(), "--server", f"http://{refusing}"]
            ends.append((scene.armtree(*asked), 4))
        for words in ANSWERED:
            asked = [*words.split(), "--server", f"http://{answering}"]
            ends.append((scene.armtree(*asked), 0))
        for command, status in ends:
            scene.ended(command, status)
    watching.signal(signal.SIGINT)
    scene.ended(watching, 130)
    recording = next(each for each in scene.recordings() if each.stem.endswith("-60"))
    for shown in (["log", "info"], ["log", "show"], ["show"]):
        ends.append((scene.armtree(*shown, recording), 0))
        scene.ended(*ends[-1])
    left = {"url": f"http://127.0.0.1:1/{FORGED}", "token": EVIL, "pid": os.getpid()}
    scene.write({"armtree/server-1.json": json.dumps(left)})
    ends.append((scene.armtree("stop"), 13))
    scene.ended(*ends[-1])
    for command in (server, watching, *(each for each, _ in ends)):
        raw = command.output.read_bytes() + command.errors.read_bytes()
        said = raw.decode(errors="replace")
        name = f"{command.errors.name}, {command.words}"
        wrong = {each for each in said if not (each.isprintable() or each in "\n\t")}
        scene.check(not wrong, f"{name} has {sorted(map(ascii, wrong))}")
        lines = [each for each in said.splitlines() if each.startswith(("Error: f", "2026-01-01"))]
        scene.check(not lines, f"{name} has the forged {lines}")
        scene.check("forged" in said, f"{name} has no forged text: {said[-300:]}")
