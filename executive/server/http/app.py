"""Requests taken apart, checked by the table, and handed to the one who answers."""

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any

import fastjsonschema
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.middleware.cors import CORSMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket

from executive.codes import INTERNAL
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
from executive.server.limits.token_bucket import TokenBucket
from executive.server.security import HAS_TOKEN, AccessRules, with_security_headers
from hardware import Clock

from . import strict_json
from .answers import Api, Call
from .errors import as_json, status_of
from .operations import OPERATIONS, Operation, Parameter

logger = logging.getLogger(__name__)

BODY_SECONDS = 5.0  # a body must be whole by then
MAX_STREAMS = 40  # requests that may last as long as their client stays
# Requests a second, and at once, by whether they show the token; stops are not counted.
RATE_LIMITS = {True: (200.0, 1000.0), False: (50.0, 100.0)}
ANONYMOUS_BYTES = 1024  # of the body of a cancel, from whoever does not show the token

_URL = re.compile(r"(?i:http)://(?P<authority>[^/]*)(?P<path>/.*)?", re.DOTALL)
_INTEGER = re.compile(r"-?[0-9]{1,20}")
_NUMBER = re.compile(r"-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?")  # as in JSON


class App:
    """The ASGI application.

    Args:
        api: Who answers.
        rules: Who may ask.
        clock: Whose time.
        rosbridge: Serves a WebSocket at `/`; None to have none.
    """

    def __init__(
        self,
        api: Api,
        rules: AccessRules,
        clock: Clock,
        rosbridge: Callable[[WebSocket], Awaitable[None]] | None,
    ) -> None:
        self._api, self._rules = api, rules
        # Strangers must not use up what is meant for those who know the token.
        self._buckets = {
            known: TokenBucket(*each, clock.now) for known, each in RATE_LIMITS.items()
        }
        self._said = TokenBucket(0.1, 3.0, clock.now)  # strangers must not fill the log
        self._streams = {True: 0, False: 0}  # of those who know the token, and of all others
        routes: list[Any] = [
            self._route(path) for path in dict.fromkeys(o.path for o in OPERATIONS)
        ]
        routes += [
            Route(f"{o.path}/", self._endpoint(o), methods=[o.method])
            for o in OPERATIONS
            if o.blind
        ]
        if rosbridge:
            routes.append(WebSocketRoute("/", rosbridge))
        starlette = Starlette(routes=routes, exception_handlers={HTTPException: _not_routed})
        starlette.router.redirect_slashes = False
        # Has a browser show the answers to pages that may ask; others are refused before.
        self._answers = CORSMiddleware(
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
            scope["state"][HAS_TOKEN] = True
        try:
            self._rules.check_source(headers, _authority(scope))
        except Forbidden as error:
            if scope["type"] == "websocket":
                if self._said.take():
                    logger.warning("A WebSocket is refused: %s; %s", error, error.hint)
                await send({"type": "websocket.close", "code": 1008})
            else:
                await _refused(error)(scope, receive, with_security_headers(send))
            return
        await self._answers(scope, receive, with_security_headers(send))

    def _route(self, path: str) -> Route:
        """All that can be asked at a path; as one route, it knows which methods there are."""
        there = {o.method: self._endpoint(o) for o in OPERATIONS if o.path == path}

        async def answer(request: Request) -> Response:
            return await there["GET" if request.method == "HEAD" else request.method](request)

        return Route(path, answer, methods=list(there))

    def _endpoint(self, operation: Operation) -> Callable[[Request], Awaitable[Response]]:
        check = None if operation.body is None else fastjsonschema.compile(dict(operation.body))
        parameters = {each.name: _Checked(each) for each in operation.parameters}
        answer = getattr(self._api, operation.name)

        async def endpoint(request: Request) -> Response:
            try:
                self._admit(operation, request)
                given = {} if operation.blind else _given(parameters, request)
                body = await _body(request, check) if check else {}
                with self._counted(operation, request):
                    response: Response = await answer(Call(request, given, body))
                    return response
            except ClientDisconnect:
                return Response()
            except RequestError as error:
                return _refused(error)
            except Exception as error:
                # The outermost place of a request: a bug costs its answer, not the connection.
                told = as_json(error)
                if told["code"] == INTERNAL:
                    logger.exception("a bug of ours, asked for %s", operation.path)
                return JSONResponse(told, status_of(told["code"]))

        return endpoint

    def _admit(self, operation: Operation, request: Request) -> None:
        if operation.stops:
            return
        known = HAS_TOKEN in request.scope["state"]
        if not self._buckets[known].take():
            raise TooMuch(f"more than {RATE_LIMITS[known][0]:g} requests a second", "wait a moment")
        if self._rules.exposed or operation.method != "GET":
            self._rules.check_token(request.headers)

    @contextmanager
    def _counted(self, operation: Operation, request: Request) -> Iterator[None]:
        known = HAS_TOKEN in request.scope["state"]
        if operation.streams and self._streams[known] >= MAX_STREAMS:
            raise TooMuch(f"{MAX_STREAMS} clients wait or watch already", "close one of them")
        self._streams[known] += operation.streams
        try:
            yield
        finally:
            self._streams[known] -= operation.streams


def _authority(scope: Scope) -> str | None:
    """What a target that is a whole URL names as its server; leaves the path alone in the scope."""
    found = _URL.fullmatch(scope["path"])
    if found is None:
        return None
    scope["path"] = found["path"] or "/"
    return found["authority"]


class _Checked:
    """A parameter, and how it is checked."""

    def __init__(self, parameter: Parameter) -> None:
        self.in_query = parameter.where == "query"
        self._type = parameter.schema["type"]
        self._check = fastjsonschema.compile(dict(parameter.schema))

    def read(self, name: str, text: str) -> Any:
        """Its value."""
        return _checked(self._check, self._value(text), name)

    def _value(self, text: str) -> float | str:
        if self._type == "integer" and _INTEGER.fullmatch(text):
            return int(text)
        return float(text) if self._type == "number" and _NUMBER.fullmatch(text) else text


def _given(parameters: dict[str, _Checked], request: Request) -> dict[str, Any]:
    """The parameters in the address, checked."""
    given: dict[str, Any] = dict(request.path_params)
    for name, text in request.query_params.multi_items():
        if name in given or name not in parameters or not parameters[name].in_query:
            there = ", ".join(n for n, p in parameters.items() if p.in_query) or "none"
            raise BadRequest(f"the parameter {name} is unknown or twice there; there are {there}")
        given[name] = text
    return {name: parameters[name].read(name, text) for name, text in given.items()}


async def _body(request: Request, check: Callable[[Any], Any]) -> Any:
    """The JSON object that was sent, checked; an empty body is an empty object."""
    known = HAS_TOKEN in request.scope["state"]
    data = await _read(request, strict_json.MAX_BYTES if known else ANONYMOUS_BYTES)
    kind = request.headers.get("content-type")
    if data and not _is_json(kind or ""):
        raise BadRequest(f"a body is application/json, not {kind or 'of no type'}", status=415)
    try:
        value = strict_json.parse(data) if data else {}
    except strict_json.NotJson as error:
        raise BadRequest(f"no JSON: {error}") from error
    return _checked(check, value, "the body")


def _is_json(kind: str) -> bool:
    main, _, more = kind.partition(";")
    return main.strip().lower() == "application/json" and more.strip().lower() in (
        "",
        "charset=utf-8",
    )


def _checked(check: Callable[[Any], Any], value: Any, whole: str) -> Any:
    try:
        return check(value)
    except fastjsonschema.JsonSchemaValueException as error:
        name = str(error.name)
        where = name.removeprefix("data").lstrip(".") or whole
        title = error.definition.get("title")
        words = f"must be {title}" if title else error.message.removeprefix(name).strip()
        raise BadRequest(f"{where} {words}", status=422) from error


async def _read(request: Request, most: int) -> bytes:
    declared = request.headers.get("content-length", "0")
    large = TooLarge(f"a body may have {most} bytes")
    if int(declared) > most:
        raise large
    data = bytearray()
    try:
        async with asyncio.timeout(BODY_SECONDS):
            async for chunk in request.stream():
                data += chunk
                if len(data) > most:
                    raise large
    except TimeoutError as error:
        words = f"the body was not whole after {BODY_SECONDS:g} s"
        raise TooSlow(words) from error
    return bytes(data)


def _refused(error: RequestError) -> Response:
    # A client that is refused may be in the middle of a body nobody will read.
    headers = {"connection": "close"}
    if error.status == 401:
        headers["www-authenticate"] = "Bearer"
    return JSONResponse(as_json(error), error.status, headers)


async def _not_routed(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    words = f"{request.method} {request.url.path}: {error.detail}"
    kind = {404: NotFound, 405: BadMethod}.get(error.status_code, RequestError)
    told = kind(words, "GET /openapi.json lists all there is", error.status_code)
    headers = {**(error.headers or {}), "connection": "close"}
    return JSONResponse(as_json(told), error.status_code, headers)
