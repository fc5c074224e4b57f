"""Pages of other sites in a real browser, which attack a server on the same machine."""

import json
import re
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, Queue
from typing import Any
from urllib.parse import urlencode

from tests.faults.process import Server, until
from tests.faults.row import Scene, row

PAGE = Path(__file__).with_name("attack.html")
# What the attempts do to the page's own site, which answers all but a WebSocket and a stream.
OWN_SITE = {
    **dict.fromkeys(("read", "stop", "cancel", "goal", "plain"), "answered 200"),
    **dict.fromkeys(("frame", "form"), "readable"),
    "beacon": "opaque",
    "socket": "refused",
    "events": "refused",
}
FOREIGN = "robot-tips.example"  # the browser resolves it to this machine, as DNS rebinding does


class Site(ThreadingHTTPServer):
    """Serves the page, and receives its report."""

    def __init__(self) -> None:
        self.reports: Queue[dict[str, Any]] = Queue()
        super().__init__(("127.0.0.1", 0), Handler)


class Handler(BaseHTTPRequestHandler):
    """Answers every request for the site."""

    server: Site

    def do_GET(self) -> None:
        self.answer(PAGE.read_bytes())

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        self.answer(b"read me")
        if self.path == "/report":
            self.server.reports.put(json.loads(body))

    def answer(self, body: bytes) -> None:
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002, as it is called
        """Log nothing."""


@contextmanager
def site() -> Iterator[Site]:
    with Site() as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        try:
            yield made
        finally:
            made.shutdown()
            thread.join()


def attacked(scene: Scene, made: Site, host: str, server: Server) -> dict[str, Any]:
    """What the page reports, opened under a name of its site."""
    targets = [f"http://{name}:{server.address[1]}" for name in ("127.0.0.1", "localhost", FOREIGN)]
    facts = urlencode({"targets": " ".join(targets)})
    profile = scene.folder / f"profile-{host}"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    options += ["--disable-background-networking", f"--user-data-dir={profile}"]
    options += ["--enable-logging=stderr"]  # what the browser refuses
    options += [f"--host-resolver-rules=MAP {FOREIGN} 127.0.0.1"]
    url = f"http://{host}:{made.server_port}/page?{facts}"
    browser = scene.armtree(
        *options,
        url,
        argv=[shutil.which("chromium") or "chromium"],
        environment={"TMPDIR": str(scene.folder)},  # it is killed, and leaves files there
    )
    try:
        report = made.reports.get(timeout=60)
    except Empty:
        return {}
    finally:
        browser.close()
    for target in targets:
        refused = re.search(rf"Framing '{re.escape(target)}/'.*frame-ancestors", browser.text())
        scene.check(refused, f"{host}: the browser shows {target} in a frame")
    return report


@row(
    "foreign-page",
    "pages of another port, another name, and of a name rebound to this machine, in a real browser:"
    " requests of ten kinds to three names of the server",
    "none of them is answered or has an effect: the goal continues, and no goal is added",
    times=1,
)
def foreign_page(scene: Scene) -> None:
    board = scene.board()
    server = scene.serve("--activate", "--rosbridge", board=board)
    goal = server.goal(20)
    until("the first frame", board.frames)
    with site() as made:
        for host in ("127.0.0.1", "localhost", FOREIGN):
            report = attacked(scene, made, host, server)
            scene.check(len(report) == 40, f"{host}: the page reports {len(report)} attempts")
            for attempt, outcome in report.items():
                name, _, where = attempt.partition(" ")
                expected = (OWN_SITE[name],) if where == "own site" else ("refused", "opaque")
                scene.check(outcome in expected, f"{host}: {attempt}: {outcome}")
    scene.injections = 90
    goals = server.get("/api/goals")["goals"]
    scene.check([each["state"] for each in goals] == ["EXECUTING"], f"the goals: {goals}")
    count = len(board.frames())
    until("more frames", lambda: len(board.frames()) > count + 5)
    server.stop()
    scene.check(server.result(goal)["state"] == "CANCELED", "it was not canceled by the stop")
