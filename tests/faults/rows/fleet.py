"""A fleet whose worker, or whose NATS server, is killed or paused while an arm moves."""

import json
import signal
import time
from pathlib import Path
from typing import Any

from tests.faults.process import Command, Server, kill, until
from tests.faults.row import Scene, row
from tests.faults.rows.client import Answer, endless, slowly, wrong_program
from tests.support.servers.cuttable_proxy import CuttableProxy
from tests.support.servers.free_port import free_port

NAMES = ("--pool", "arms", "--name", "arm-1")
FREE = ("ready", "held")


def fleet(scene: Scene) -> tuple[Command, str]:
    """A fleet that runs, and its URL."""
    port = free_port()
    return up(scene, port), f"nats://127.0.0.1:{port}"


def with_arm(scene: Scene) -> tuple[Command, str, Server]:
    """A fleet that runs, its URL, and the server of an arm that has joined."""
    running, url = fleet(scene)
    return running, url, joined(scene, url)


def moving(scene: Scene, url: str, server: Server, task: int) -> str:
    """The job of a task that moves the only arm."""
    job = str(asked(scene, url, "send", str(task))["job"])
    moves(server)
    return job


def moves(server: Server) -> None:
    until("it moves", lambda: server.get("/api/status")["percentage"] is not None)


def ran(scene: Scene, server: Server, jobs: list[str], when: str = "") -> None:
    """Check that the arm ran these jobs, each once, in this order."""
    goals = [each["goal_id"] for each in server.get("/api/goals")["goals"]]
    scene.check(goals == jobs, f"{when}the arm ran {goals}, not {jobs}")


def up(scene: Scene, port: int) -> Command:
    """`armtree fleet up`, once it runs."""
    started = scene.armtree("fleet", "up", "--nats-port", str(port), "--http-port", "0")
    started.until_printed("The fleet is at")
    return started


def asked(scene: Scene, url: str, *words: str) -> dict[str, Any]:
    """The last object that a command of the fleet prints."""
    command = scene.armtree("fleet", *words, "--json", "--fleet", url)
    command.wait()
    lines = command.output.read_text().splitlines()
    found: dict[str, Any] = json.loads(lines[-1]) if lines else {}
    return found


def record(scene: Scene, url: str, job: str, *states: str) -> dict[str, Any]:
    """The record of a job, once it is in one of these states."""

    def found() -> dict[str, Any]:
        shown = asked(scene, url, "jobs", job)
        return shown if shown.get("state") in states else {}

    known: dict[str, Any] = until(f"the job is {' or '.join(states)}", found)
    return known


def child(command: Command, words: str) -> int:
    """The process of a command whose command line has these words."""

    def found() -> int:
        return next((pid for pid in command.family() if words in line_of(pid)), 0)

    return int(until(f"the process {words}", found))


def line_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


def joined(scene: Scene, url: str, through: CuttableProxy | None = None) -> Server:
    """A server whose arm has joined, and can take a job."""
    own = f"nats://127.0.0.1:{through.port}" if through else url
    environment = {"ARMTREE_FLEET_TOKEN": (scene.folder / "fleet/token").read_text()}
    words = ("--activate", "--fleet", own, *NAMES)
    server = scene.serve(*words, board=scene.board(), environment=environment)
    until("the arm is ready", lambda: asked(scene, url, "ls").get("state") == "ready")
    return server


def ended(scene: Scene, *commands: Command) -> None:
    for command in commands:
        command.signal(signal.SIGINT)
        scene.ended(command, 0)


@row(
    "fleet-worker",
    "the worker of an arm is killed with `kill -9`, or paused for 1.5 s, while its job moves",
    "the server stops the arm, and starts a killed worker again; the job ends CANCELED with what "
    "the arm did, and runs once; the arm takes the next job",
    times=2,
)
def worker(scene: Scene) -> None:
    running, url, server = with_arm(scene)
    sent = list[str]()
    for how in scene.share(["killed", "paused"]):
        pid = child(server, "fleet join")
        job = moving(scene, url, server, 20)
        kill(pid, signal.SIGKILL if how == "killed" else signal.SIGSTOP)
        result = server.result(job)
        scene.check(result["state"] == "CANCELED", f"{how}: the goal ended {result['state']}")
        if how == "paused":
            kill(pid, signal.SIGCONT)
        found = record(scene, url, job, "CANCELED", "ABORTED")["result"]
        scene.check(found["frames"] == result["frames"], f"{how}: the record says {found}")
        until("the arm is listed", lambda: asked(scene, url, "ls").get("state") in FREE)
        asked(scene, url, "resume")  # a pause looks like a stop at the arm
        after = asked(scene, url, "send", "23")["job"]
        record(scene, url, after, "SUCCEEDED")
        sent += [job, after]
        ran(scene, server, sent, f"{how}: ")
    ended(scene, server, running)


@row(
    "fleet-pause",
    "the worker of an arm is paused for a minute while its job moves, and comes back",
    "the server stops the arm; the job ends as `fleet.arm_lost`; the worker then reports what the "
    "arm did, the record says `late`, and the job runs once",
    times=1,
    waits=True,
)
def pause(scene: Scene) -> None:
    running, url, server = with_arm(scene)
    pid = child(server, "fleet join")
    job = moving(scene, url, server, 20)
    kill(pid, signal.SIGSTOP)
    result = server.result(job)
    scene.check(result["state"] == "CANCELED", f"the goal ended {result['state']}")
    time.sleep(60.0)  # noqa: TID251, the fault
    found = asked(scene, url, "jobs", job)
    scene.check((found["result"] or {}).get("code") == "fleet.arm_lost", f"the record says {found}")
    kill(pid, signal.SIGCONT)
    found = record(scene, url, job, "CANCELED")
    scene.check(found["late"], f"the record says {found}")
    ran(scene, server, [job])
    ended(scene, server, running)


@row(
    "fleet-server",
    "`kill -9` of `armtree serve` while its arm runs a job of a fleet",
    "the arm stays listed, a fleet stop names it, and its job ends as `fleet.arm_lost`",
    times=2,
)
def killed_server(scene: Scene) -> None:
    running, url, server = with_arm(scene)
    job = moving(scene, url, server, 20)
    scene.unrecorded = scene.unreceived = 1
    kill(server.pid, signal.SIGKILL)
    until("the arm is gone", lambda: asked(scene, url, "ls").get("state") == "gone")
    stopping = scene.armtree("fleet", "stop", "--fleet", url)
    scene.ended(stopping, 13, what="a stop")
    scene.check("arms.arm-1" in stopping.text(), f"the stop says {stopping.text()}")
    found = record(scene, url, job, "ABORTED")["result"]
    scene.check(found["code"] == "fleet.arm_lost", f"the record says {found}")
    ended(scene, running)


@row(
    "fleet-up",
    "`kill -9` of `armtree fleet up` while an arm runs a job; it starts again",
    "its NATS server ends with it, the arm finishes its job, which runs once, and the result is "
    "stored afterwards",
    times=2,
)
def killed_fleet(scene: Scene) -> None:
    running, url, server = with_arm(scene)
    job = moving(scene, url, server, 21)
    nats_server = child(running, "nats-server")
    kill(running.pid, signal.SIGKILL)
    again = up(scene, int(url.rpartition(":")[2]))
    until("nats-server has ended", lambda: "nats-server" not in line_of(nats_server))
    record(scene, url, job, "SUCCEEDED")
    ran(scene, server, [job])
    ended(scene, server, again)


@row(
    "fleet-nats",
    "`kill -9` of the NATS server while an arm runs a job; it starts again",
    "the arm finishes its job, its server answers meanwhile, and the result is stored afterwards; "
    "a queued job is not lost, and a repeat of the first one is refused",
    times=2,
)
def nats(scene: Scene) -> None:
    running, url, server = with_arm(scene)
    asked(scene, url, "stop")  # until both jobs are queued, however slow the machine is
    job = asked(scene, url, "send", "21")["job"]
    queued = asked(scene, url, "send", "23")["job"]
    scene.armtree("fleet", "resume", "--fleet", url)
    moves(server)
    kill(child(running, "nats-server"), signal.SIGKILL)
    scene.ended(running, 13)
    result = server.result(job)
    scene.check(result["code"] == "ok", f"the goal ended {result['code']}: {result['message']}")
    again = up(scene, int(url.rpartition(":")[2]))
    for each in (job, queued):
        record(scene, url, each, "SUCCEEDED")
    repeated = scene.armtree("fleet", "send", "21", "--id", job, "--fleet", url)
    scene.ended(repeated, 4, what="a repeat")
    goals = [each["goal_id"] for each in server.get("/api/goals")["goals"]]
    scene.check(sorted(goals) == sorted([job, queued]), f"the arm ran {goals}")
    ended(scene, server, again)


@row(
    "fleet-network",
    "the network between an arm and NATS is cut while a job moves, with connections that end or "
    "that hang, and mended afterwards",
    "the arm finishes its job, and its server answers meanwhile; the result is stored once the "
    "network is back, and each job runs once",
    times=4,
)
def network(scene: Scene) -> None:
    running, url = fleet(scene)
    sent = list[str]()
    with CuttableProxy(int(url.rpartition(":")[2])) as proxy:
        server = joined(scene, url, proxy)
        for how in scene.share(["ends", "hangs"]):
            job = moving(scene, url, server, 21)
            proxy.cut(silent=how == "hangs")
            result = server.result(job)
            scene.check(result["code"] == "ok", f"{how}: the goal ended {result['code']}")
            found = asked(scene, url, "jobs", job)
            scene.check(found["state"] == "CLAIMED", f"{how}: the record says {found}")
            proxy.mend()
            record(scene, url, job, "SUCCEEDED")
            sent.append(job)
            ran(scene, server, sent, f"{how}: ")
        ended(scene, server, running)


INFO = b'INFO {"server_id": "x", "headers": true, "max_payload": 1048576}\r\n'
WRONG: dict[str, Answer] = {
    "another protocol": lambda: [b"SSH-2.0-OpenSSH_9.2\r\n"],
    "nothing": list,
    "a list": lambda: [b"INFO []\r\n"],
    "other fields": lambda: [b'INFO {"max_payload": "a"}\r\nPONG\r\n'],
    "an endless line": endless(b"INFO ", b"x" * 65_536),
    "an endless later line": endless(INFO + b"PONG\r\n", b"x" * 65_536),
    "an endless message": endless(INFO + b"PONG\r\nMSG a 1 99999999999\r\n", b"x" * 65_536),
    "a flood of pings": endless(INFO, b"PING\r\n" * 1000),
    "a slow line": slowly(b"INFO {", b" "),
    "slow pings": slowly(INFO, b"PING\r\n"),
    "slow pings later": slowly(INFO + b"PONG\r\n", b"PING\r\n"),
    "slow words": slowly(INFO + b"PONG\r\n", b"+OK\r\n"),
}
COMMANDS = (
    "send 23",
    f"cancel {32 * 'a'}",
    "ls",
    "jobs",
    "stop",
    "resume",
    "forget arms.arm-1",
    "ls --json",
)


@row(
    "wrong-fleet",
    "another program answers each command of a fleet, in place of NATS: another protocol, other "
    "fields, a line or a message without end, at once or slowly",
    "exit status 13 and one line; memory stays below 200 MiB",
    limit=15,
    unit="s",
    times=2,
)
def wrong_fleet(scene: Scene) -> None:
    lines = [f"fleet {words} --fleet nats://{{}}" for words in scene.share(COMMANDS)]
    wrong_program(scene, WRONG, lines, greets=True)
