"""The page of a fleet, and its metrics for Prometheus: over HTTP, for this machine only."""

import logging
import os
import socket
from collections import Counter as Counts
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import uvicorn
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from executive.api import ADDRESS

from .connection import GONE
from .errors import NotStarted
from .fleet_client import ArmRow, FleetClient, waiting_words
from .supervisor import Supervisor

_FILES = ("index.html", "fleet.css", "fleet.js")
_HEADERS = {
    "cache-control": "no-store",
    "content-security-policy": "default-src 'self'; base-uri 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


def listen(port: int) -> socket.socket:
    """Return a socket for `serve`.

    Args:
        port: TCP port; 0 for any free one.

    Raises:
        NotStarted: Another program listens on this port.
    """
    try:
        return socket.create_server((ADDRESS, port))
    except OSError as error:
        why = os.strerror(error.errno or 0)  # the words of the error name the address again
        raise NotStarted(
            f"the page of the fleet cannot listen on {ADDRESS} port {port}: {why}; "
            "choose another port with --http-port, or 0 for any free one"
        ) from error


async def serve(client: FleetClient, supervisor: Supervisor, listener: socket.socket) -> None:
    """Serve the page until canceled.

    Args:
        client: Reads arms and queue.
        supervisor: Supervisor, which counts the jobs.
        listener: Socket from `listen`. It stays open.
    """
    logging.getLogger("uvicorn.error").setLevel(logging.ERROR)
    app = make_app(client, supervisor)
    config = uvicorn.Config(
        app, lifespan="off", log_config=None, access_log=False, server_header=False
    )
    await _Server(config).serve([listener.dup()])


class _Server(uvicorn.Server):
    """uvicorn without signal handlers, because this program handles signals."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def make_app(client: FleetClient, supervisor: Supervisor) -> Starlette:
    """Return the ASGI application of `serve`."""

    async def read() -> tuple[list[ArmRow], int]:
        rows, queued = await client.arms(), await client.queued(0)
        return rows, queued[0]

    async def arms(_: Request) -> Response:
        rows, queued = await read()
        waiting = [*waiting_words(rows, await client.pools()).values()] if queued else []
        found = {"queued": queued, "waiting": waiting, "arms": [row.to_json() for row in rows]}
        return JSONResponse({"host": socket.gethostname(), **found}, headers=_HEADERS)

    async def metrics(_: Request) -> Response:
        registry = CollectorRegistry()
        registry.register(_Figures(*await read(), supervisor.claimed, supervisor.ended))
        return PlainTextResponse(generate_latest(registry), headers=_HEADERS)

    async def gone(_: Request, error: Exception) -> Response:
        words = f"the NATS server does not answer: {error or type(error).__name__}"
        return PlainTextResponse(words, 503, headers=_HEADERS)

    async def file(request: Request) -> Response:
        name = request.url.path[1:] or _FILES[0]
        return FileResponse(Path(__file__).parent / "page" / name, headers=_HEADERS)

    routes = [Route(f"/{name}", file) for name in ("", *_FILES)]
    routes += [Route("/arms", arms), Route("/metrics", metrics)]
    return Starlette(
        routes=routes,
        # Pages of other sites must not read this page under another name of this machine.
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[ADDRESS, "localhost"])],
        exception_handlers=dict.fromkeys(GONE, gone),
    )


class _Figures(Collector):
    """The metrics of one moment.

    Args:
        rows: The arms.
        queued: Number of queued jobs.
        claimed: Number of claimed jobs.
        ended: Number of jobs that ended, by pool, state and code.
    """

    def __init__(
        self,
        rows: Sequence[ArmRow],
        queued: int,
        claimed: int,
        ended: Mapping[tuple[str, str, str], int],
    ) -> None:
        self._rows, self._queued, self._claimed, self._ended = rows, queued, claimed, ended

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics."""
        arms = GaugeMetricFamily("armtree_fleet_arms", "Arms.", labels=["pool", "state"])
        counts = Counts((row.member.arm.partition(".")[0], row.state) for row in self._rows)
        for labels, number in sorted(counts.items()):
            arms.add_metric(labels, number)
        yield arms
        for name, words, number in (
            ("queued", "Jobs that no arm has claimed.", self._queued),
            ("claimed", "Jobs that an arm has claimed, and that have not ended.", self._claimed),
        ):
            yield GaugeMetricFamily(f"armtree_fleet_jobs_{name}", words, value=number)
        words = "Jobs that ended, also before this start, as long as their records were kept."
        by = ["pool", "state", "code"]
        ended = CounterMetricFamily("armtree_fleet_jobs_ended", words, labels=by)
        for key, number in sorted(self._ended.items()):
            ended.add_metric(key, number)
        yield ended
