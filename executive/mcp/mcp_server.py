"""The server of the Model Context Protocol: over standard input and output, or HTTP."""

import hmac
import json
import logging
import os
import socket
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from typing import Any

from mcp.server import Server, ServerRequestContext
from mcp.server.request_state import RequestStateBoundary, RequestStateSecurity
from mcp.server.stdio import stdio_server
from mcp.server.transport_security import TransportSecuritySettings
from mcp_types import (
    CallToolRequestParams,
    CallToolResult,
    InputRequiredResult,
    ListToolsResult,
    PaginatedRequestParams,
    TextContent,
    Tool as Described,
    ToolAnnotations,
)
from starlette.types import Receive, Scope, Send

from executive.api import ADDRESS, strict_json
from executive.api.checking import Mismatch, checked, checker
from executive.api.outcome import cause_of
from executive.api.token_bucket import TokenBucket
from executive.client.asynchronous import AsyncClient
from executive.client.held_goals import HeldGoals
from executive.client.transport import Address
from executive.errors import AddressInUse, BadRequest, TooMuch, Unauthorized
from hardware import ArmtreeError, InternalError, RealClock, Robot
from hardware.installed import version

from .asking import MustRepeat, Person
from .calls import Calls, NotDone
from .following import Waits
from .tools import MOVE, TOOLS, Tool

logger = logging.getLogger(__name__)

NAME = "armtree"
RATE, BURST = 5.0, 20.0  # calls per second and at once; stops are not counted
_NO_TOKEN = "none"  # not empty, because an empty token is replaced by the user's
_NEEDS_TOKEN = (
    "this call needs the token of the arm's server",
    "let the client send the HTTP header Authorization: Bearer TOKEN; the server printed the token "
    "when it started",
)
_MAX_ARGUMENTS = 48 * 1024  # largest arguments [bytes]; the arm's server accepts a little more
_MAX_BODY = 256 * 1024  # largest request over HTTP [bytes]
_MAX_SESSIONS = 16
_INSTRUCTIONS = (
    "Tools of a real robot arm. Check or plan a task before you run it. run_task and resume may "
    "move the arm: tell the person first. If anything looks wrong, call stop."
)

_Context = ServerRequestContext[Any, Any]


class Tools:
    """Lists the tools and answers calls.

    Args:
        url: URL of the server of the arm.
        robot: Robot for drawings, or None.
        allow_move: True to offer `move`.
    """

    def __init__(self, url: str, robot: Robot | None, allow_move: bool) -> None:
        self._url, self._robot = url, robot
        self._tools = {each.name: each for each in (*TOOLS, *([MOVE] if allow_move else []))}
        self._checkers = {name: checker(each.schema) for name, each in self._tools.items()}
        self._bucket, self._held = TokenBucket(RATE, BURST, RealClock().now), HeldGoals()
        self._waits = Waits()

    async def list(
        self, context: _Context, params: PaginatedRequestParams | None
    ) -> ListToolsResult:
        """List the tools."""
        return ListToolsResult(tools=[_described(each) for each in self._tools.values()])

    async def call(
        self, context: _Context, params: CallToolRequestParams
    ) -> CallToolResult | InputRequiredResult:
        """Answer a call. Errors become words for the model."""
        try:
            return await self._answer(context, params)
        except MustRepeat as question:
            return question.result
        except ArmtreeError as error:
            without = _token(context) == _NO_TOKEN and cause_of(error).code == Unauthorized.code
            return _refusal(Unauthorized(*_NEEDS_TOKEN) if without else error)
        except NotDone as error:
            return CallToolResult(content=[TextContent(text=str(error))], is_error=True)
        except Mismatch as error:
            return _refusal(BadRequest(str(error), "correct the arguments"))
        except Exception:  # catches every error of a call
            logger.exception("a bug in armtree")
            return _refusal(InternalError("the log has the details"))

    async def _answer(self, context: _Context, params: CallToolRequestParams) -> CallToolResult:
        tool = self._tools.get(params.name)
        if tool is None:
            known = ", ".join(self._tools)
            raise Mismatch(f"there is no tool {params.name[:40]!r}; there are {known}")
        if tool.limited and not self._bucket.take():
            raise TooMuch(f"more than {RATE:g} calls per second; only stop is not limited")
        given = checked(self._checkers[tool.name], _as_json(params.arguments), "the arguments")

        def connect() -> AsyncClient:
            return AsyncClient(self._url, _token(context), name=_client(context))

        async with connect() as client:
            person = Person(context, params)
            calls = Calls(client, connect, self._held, self._waits, person, self._robot)
            answer = await getattr(calls, tool.name)(**given)
        return CallToolResult(
            content=[TextContent(text=answer)] if isinstance(answer, str) else answer
        )


def make_server(url: str, robot: Robot | None = None, allow_move: bool = False) -> Server[Any]:
    """Return a server for all transports.

    Args:
        url: URL of the server of the arm.
        robot: Robot for drawings, or None.
        allow_move: True to offer `move`.
    """
    tools = Tools(url, robot, allow_move)
    server: Server[Any] = Server(
        NAME,
        version=version("armtree"),
        instructions=_INSTRUCTIONS,
        on_list_tools=tools.list,
        on_call_tool=tools.call,
    )
    # Encrypts the state that a client must send back with the answer to a question.
    server.middleware.append(
        RequestStateBoundary(RequestStateSecurity.ephemeral(), default_audience=NAME)
    )
    return server


async def serve_stdio(server: Server[Any]) -> None:
    """Serve one client over standard input and output, until it closes them."""
    async with stdio_server() as (read, write):
        await server.run(read, write, server.create_initialization_options())


def listen(port: int) -> socket.socket:
    """Return a socket for `serve_http`.

    Args:
        port: TCP port; 0 for any.

    Raises:
        AddressInUse: Another program listens on this port.
    """
    try:
        return socket.create_server((ADDRESS, port))
    except OSError as error:
        why = os.strerror(error.errno or 0)  # the words of the error name the address again
        words = f"cannot listen on {ADDRESS} port {port}: {why}; choose another port with --http"
        raise AddressInUse(words) from error


async def serve_http(make: Callable[[], Server[Any]], url: str, listener: socket.socket) -> None:
    """Serve clients of this machine over HTTP, until a signal comes.

    A client sends the token of the arm's server as `Authorization: Bearer TOKEN`. Without the
    token, it can only read and stop, like any program on this machine. Clients with the token of
    this user have their own server, so that others cannot use up its sessions or calls.

    Args:
        make: Callback that makes a server.
        url: URL of the server of the arm.
        listener: Socket from `listen`.
    """
    import uvicorn
    from starlette.applications import Starlette
    from starlette.routing import Mount

    hosts = [f"{host}:{listener.getsockname()[1]}" for host in (ADDRESS, "localhost")]
    rules = TransportSecuritySettings(
        allowed_hosts=hosts, allowed_origins=[f"http://{host}" for host in hosts]
    )
    known, others = (
        make().streamable_http_app(
            transport_security=rules, max_request_body_size=_MAX_BODY, max_sessions=_MAX_SESSIONS
        )
        for _ in range(2)
    )

    async def choose(scope: Scope, receive: Receive, send: Send) -> None:
        given = dict(scope["headers"]).get(b"authorization", b"")
        own = Address.find(url, None).headers.get("authorization", "")
        right = own and hmac.compare_digest(given, own.encode())
        await (known if right else others)(scope, receive, send)

    @asynccontextmanager
    async def run(_: object) -> AsyncIterator[None]:
        async with known.router.lifespan_context(known), others.router.lifespan_context(others):
            yield

    app = Starlette(routes=[Mount("/", choose)], lifespan=run)
    config = uvicorn.Config(app, log_config=None, server_header=False, timeout_graceful_shutdown=1)
    with listener:
        await uvicorn.Server(config).serve([listener])


def _as_json(arguments: Mapping[str, Any] | None) -> Any:
    """Return arguments in the form in which the arm's server reads them.

    Raises:
        Mismatch: The arguments are not JSON, nested too deeply, or too large.
    """
    try:
        text = json.dumps(arguments or {}, ensure_ascii=False, allow_nan=False).encode()
        parsed = strict_json.parse(text)
    except (ValueError, RecursionError) as error:
        words = f"the arguments are not valid JSON: {str(error)[:100]}"
        raise Mismatch(words) from error
    if len(text) > _MAX_ARGUMENTS:
        raise Mismatch(f"arguments may have at most {_MAX_ARGUMENTS} bytes, not {len(text)}")
    return parsed


def _described(tool: Tool) -> Described:
    return Described(
        name=tool.name,
        description=tool.description,
        input_schema=tool.schema,
        annotations=ToolAnnotations(
            read_only_hint=tool.reads,
            destructive_hint=tool.moves,
            idempotent_hint=tool.repeatable,
            open_world_hint=False,
        ),
    )


def _refusal(error: ArmtreeError) -> CallToolResult:
    cause = cause_of(error)
    hint = f"\n-> {cause.advice}" if cause.advice else ""
    return CallToolResult(content=[TextContent(text=f"{cause}{hint}")], is_error=True)


def _token(context: _Context) -> str | None:
    """Return the token of a client over HTTP; None for a client that started this process.

    Such a client runs as this user, and uses the user's token.
    """
    headers = getattr(context.request, "headers", None)
    if headers is None:
        return None
    given: Sequence[str] = headers.get("authorization", "").split()
    return given[1] if len(given) == 2 and given[1].isascii() else _NO_TOKEN


def _client(context: _Context) -> str:
    """Return the name of a client, for recordings. The client chooses it."""
    params = context.session.client_params
    info = params.client_info if params else None
    words = f"{info.name} {info.version}" if info else "unknown"
    plain = "".join(each if " " <= each <= "~" else "?" for each in words[:80])
    return f"armtree-mcp ({plain})"
