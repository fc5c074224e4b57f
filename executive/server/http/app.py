"""The ASGI application: checks each request against its row in `operations` and answers it."""

import asyncio
import gzip
import logging
import re
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from executive.api import strict_json
from executive.api.checking import Checker, Mismatch, checked, checker
from executive.api.operations import OPERATIONS, Access, Operation
from executive.api.outcome import cause_of
from executive.api.token_bucket import TokenBucket
from executive.errors import (
    BadMethod,
    BadRequest,
    Forbidden,
    NotFound,
    RequestError,
    TooLarge,
    TooMuch,
    TooSlow,
)
from executive.server.errors import failure
from executive.server.page.page_files import page_routes
from executive.server.security import (
    AccessRules,
    client_of,
    is_authenticated,
    mark_authenticated,
    with_security_headers,
)
from hardware import Clock

from .recording_endpoints import RecordingEndpoints

logger = logging.getLogger(__name__)

BODY_SECONDS = 5.0  # longest time for the arrival of a body [s]
MAX_STREAMS = 40  # largest number of requests that last as long as their client
# Requests per second, and burst: with the token (True), without it (False). Stops do not count.
RATE_LIMITS = {True: (200.0, 1000.0), False: (50.0, 100.0)}
ANONYMOUS_BYTES = 1024  # largest body of a cancel without the token [bytes]

_COMPRESSED = 2000  # smallest answer that is compressed [bytes]

_URL = re.compile(r"(?i:http)://(?P<authority>[^/]*)(?P<path>/.*)?", re.DOTALL)
_INTEGER = re.compile(r"-?[0-9]{1,20}")
_NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")  # booleans as in JSON


class App:
    """The ASGI application.

    Requests with and without the token have separate limits. Clients without the token therefore
    cannot block the others.

    Args:
        endpoints: Answer the requests. An operation is served if `endpoints` has its method.
        rules: Rules of access.
        clock: Time source.
        rosbridge: Serves a WebSocket at `/`, or None.
    """

    def __init__(
        self,
        endpoints: RecordingEndpoints,
        rules: AccessRules,
        clock: Clock,
        rosbridge: Callable[[WebSocket], Awaitable[None]] | None,
    ) -> None:
        self._endpoints, self._rules = endpoints, rules
        self._buckets = {
            known: TokenBucket(*rate, clock.now) for known, rate in RATE_LIMITS.items()
        }
        # Clients without the token must not fill the log.
        self._log_bucket = TokenBucket(0.1, 3.0, clock.now)
        self._streams = {True: 0, False: 0}
        operations = [o for o in OPERATIONS.values() if hasattr(endpoints, o.name)]
        routes: list[Any] = page_routes()  # first, because a view of the page requests many
        routes += [
            self._route([o for o in operations if o.path == path])
            for path in dict.fromkeys(o.path for o in operations)
        ]
        routes += [
            Route(f"{o.path}/", self._endpoint(o), methods=[o.method])
            for o in operations
            if o.ignores_input
        ]
        if rosbridge:
            routes.append(WebSocketRoute("/", rosbridge))
        starlette = Starlette(routes=routes, exception_handlers={HTTPException: _not_routed})
        starlette.router.redirect_slashes = False
        # Browsers pass answers to pages of accepted origins. Other pages were refused before.
        self._with_cors = CORSMiddleware(
            starlette,
            allow_origins=list(rules.origins),
            allow_methods=("GET", "POST"),
            allow_headers=("authorization",),
            allow_private_network=True,
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or one WebSocket."""
        headers = Headers(scope=scope)
        if self._rules.has_token(headers):
            mark_authenticated(scope)
        try:
            self._rules.check_source(headers, _take_authority(scope))
        except Forbidden as error:
            if scope["type"] == "websocket":
                if self._log_bucket.take():
                    logger.warning("Refused a WebSocket: %s; %s", error, error.hint)
                await send({"type": "websocket.close", "code": 1008})
            else:
                await _refusal(error)(scope, receive, with_security_headers(send))
            return
        await self._with_cors(scope, receive, with_security_headers(send))

    def _route(self, operations: Sequence[Operation]) -> Route:
        """Return one route for all methods of a path, so that Starlette knows all of them."""
        endpoints = {o.method: self._endpoint(o) for o in operations}

        async def answer(request: Request) -> Response:
            method = "GET" if request.method == "HEAD" else request.method
            return await endpoints[method](request)

        return Route(operations[0].path, answer, methods=list(endpoints))

    def _endpoint(self, operation: Operation) -> Callable[[Request], Awaitable[Response]]:
        arguments = _Arguments(operation)
        answer = getattr(self._endpoints, operation.name)
        changes = operation.access is Access.CHANGE and operation.method == "POST"

        async def endpoint(request: Request) -> Response:
            try:
                self._admit(operation, request)
                given = await arguments.read(request)
                client = client_of(request.headers)
                if operation.names_client:
                    given["client"] = client
                elif client and changes and not operation.streams:
                    logger.info("%s %s from %s", request.method, request.url.path, client)
                with self._counted(operation, request):
                    value = await (
                        answer(request, **given) if operation.streams else answer(**given)
                    )
                if isinstance(value, Response):
                    return await _compressed(request, value)
                if operation.answer is None:
                    return Response(value, operation.status, media_type=operation.media)
                return await _compressed(request, JSONResponse(value, operation.status))
            except (ClientDisconnect, asyncio.CancelledError):  # client left, or server ends
                return Response()
            except RequestError as error:
                return _refusal(error)
            except Mismatch as error:
                return _refusal(BadRequest(str(error), status=422))
            except Exception as error:
                # Catches every error of a request, so that a bug does not end the connection.
                return failure(error, operation.path)

        return endpoint

    def _admit(self, operation: Operation, request: Request) -> None:
        if operation.stops:
            return
        known = is_authenticated(request.scope)
        if not self._buckets[known].take():
            rate, _ = RATE_LIMITS[known]
            raise TooMuch(f"more than {rate:g} requests per second", "wait a moment")
        changes = operation.access is Access.CHANGE
        if changes or (self._rules.exposed and operation.access is Access.READ):
            self._rules.check_token(request.headers)

    @contextmanager
    def _counted(self, operation: Operation, request: Request) -> Iterator[None]:
        known = is_authenticated(request.scope)
        if operation.streams and self._streams[known] >= MAX_STREAMS:
            raise TooMuch(f"{MAX_STREAMS} clients wait or watch already", "close one of them")
        self._streams[known] += operation.streams
        try:
            yield
        finally:
            self._streams[known] -= operation.streams


class _Arguments:
    """Reads and checks the parameters and the body of requests for one operation."""

    def __init__(self, operation: Operation) -> None:
        self._operation = operation
        self._parameters = {name: checker(each) for name, each in operation.parameters.items()}
        self._body = None if operation.body is None else checker(operation.body)

    async def read(self, request: Request) -> dict[str, Any]:
        """Return the arguments by name.

        Raises:
            RequestError: An argument is wrong, unknown or given twice.
        """
        if self._operation.ignores_input:
            return {}
        arguments = self._in_address(request)
        return arguments | await _read_body(request, self._body) if self._body else arguments

    def _in_address(self, request: Request) -> dict[str, Any]:
        schemas, texts = self._operation.parameters, dict[str, str](request.path_params)
        in_query = [name for name in schemas if not self._operation.in_path(name)]
        for name, text in request.query_params.multi_items():
            if name in texts or name not in in_query:
                known = ", ".join(in_query) or "none"
                raise BadRequest(f"the parameter {name} is unknown or given twice; known: {known}")
            texts[name] = text
        return {
            name: checked(self._parameters[name], _value(text, schemas[name]["type"]), name)
            for name, text in texts.items()
        }


async def _compressed(request: Request, response: Response) -> Response:
    """Return a response. Large JSON is compressed if the client accepts it."""
    takes = "gzip" in request.headers.get("accept-encoding", "")
    is_json = response.media_type == JSONResponse.media_type
    if not (takes and is_json and len(response.body) >= _COMPRESSED):
        return response
    headers = {"content-encoding": "gzip", "vary": "accept-encoding"}
    data = await asyncio.to_thread(gzip.compress, response.body, 1, mtime=0)
    return Response(data, response.status_code, headers, response.media_type)


def _take_authority(scope: Scope) -> str | None:
    """Return the host in the target of a request, and keep only its path; None for a path."""
    found = _URL.fullmatch(scope["path"])
    if found is None:
        return None
    scope["path"] = found["path"] or "/"
    return found["authority"]


def _value(text: str, kind: str) -> float | str:
    if kind == "integer" and _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if kind == "number" and _NUMBER.fullmatch(text) else text


async def _read_body(request: Request, check: Checker) -> Any:
    """Return the checked JSON object of a body. An empty body counts as an empty object."""
    known = is_authenticated(request.scope)
    data = await _read(request, strict_json.MAX_BYTES if known else ANONYMOUS_BYTES)
    kind = request.headers.get("content-type")
    if data and not _is_json(kind or ""):
        raise BadRequest(f"a body must be application/json, not {kind or 'untyped'}", status=415)
    try:
        value = strict_json.parse(data) if data else {}
    except strict_json.NotJson as error:
        raise BadRequest(f"invalid JSON: {error}") from error
    return checked(check, value, "the body")


def _is_json(kind: str) -> bool:
    main, _, more = kind.partition(";")
    return main.strip().lower() == "application/json" and more.strip().lower() in (
        "",
        "charset=utf-8",
    )


async def _read(request: Request, limit: int) -> bytes:
    declared = request.headers.get("content-length", "0")
    too_large = TooLarge(f"a body may have at most {limit} bytes")
    if int(declared) > limit:
        raise too_large
    data = bytearray()
    try:
        async with asyncio.timeout(BODY_SECONDS):
            async for chunk in request.stream():
                data += chunk
                if len(data) > limit:
                    raise too_large
    except TimeoutError as error:
        raise TooSlow(f"the body was incomplete after {BODY_SECONDS:g} s") from error
    return bytes(data)


def _refusal(error: RequestError) -> Response:
    # The client may still send a body that will not be read.
    headers = {"connection": "close"}
    if error.http_status == 401:
        headers["www-authenticate"] = "Bearer"
    return JSONResponse(cause_of(error).to_json(), error.http_status, headers)


async def _not_routed(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    words = f"{request.method} {request.url.path}: {error.detail}"
    kind = {404: NotFound, 405: BadMethod}.get(error.status_code, RequestError)
    hint = "GET /openapi.json lists all operations"
    response = _refusal(kind(words, hint, error.status_code))
    response.headers.update(error.headers or {})
    return response
