"""A crowd of hostile clients, until it is killed: `hostile.py KIND PORT [CLIENTS]`.

A program of its own, so that it does not hold up the process that measures. Every 0.1 s it prints
how often the server has answered or closed a connection; of clients that wait for no answer, how
often one has connected.
"""

import asyncio
import contextlib
import json
import random
import resource
import sys
from collections.abc import AsyncIterator, Callable

from websockets.frames import Frame, Opcode

Data = Callable[[int], bytes]
served = [0]  # times


def head(line: str, *more: str, host: str = "127.0.0.1:PORT") -> Data:
    """The head of a request; PORT is the server's."""
    text = "".join(f"{each}\r\n" for each in (f"{line} HTTP/1.1", f"host: {host}", *more, ""))
    return lambda port: text.replace("PORT", str(port)).encode()


def message(**fields: object) -> bytes:
    return Frame(Opcode.TEXT, json.dumps(fields).encode()).serialize(mask=True)


MANY = tuple(f"a{number}:" for number in range(11_000))
STOP = head("POST /api/stop")
WEBSOCKET = head(
    "GET /",
    *("connection: upgrade", "upgrade: websocket", "sec-websocket-version: 13"),
    "sec-websocket-key: AAAAAAAAAAAAAAAAAAAAAA==",
)
GOALS = head("POST /api/goals", "content-type: application/json", "content-length: 60000")
# Valid and invalid frames of a WebSocket: pings, no mask, no end, 2^62 bytes, other codes, no JSON.
FRAMES = (
    *(Frame(Opcode.PING, b"x" * 125).serialize(mask=True) * 100 for _ in range(3)),
    Frame(Opcode.TEXT, b"{}").serialize(mask=False),
    Frame(Opcode.TEXT, b"x" * 60_000, fin=False).serialize(mask=True),
    b"\x81\xff" + (2**62).to_bytes(8) + b"mask" + b"x" * 60_000,
    b"\xff\x80mask" * 1000,
    *(Frame(Opcode.TEXT, text).serialize(mask=True) for text in (b"[" * 60_000, b"\xff" * 1000)),
)
GOAL = {"op": "send_action_goal", "action": "/task_server", "args": {"task_number": 23}}
KIND = {"action_type": "arduinobot_msgs/action/ArduinobotTask", "id": "a"}
CANCEL = {"op": "cancel_action_goal", "action": "/task_server", "id": "a"}

# What each client sends on a new connection, again and again.
CONNECTING: dict[str, Data] = {
    "connections": lambda port: b"",
    "long stops": head("POST /api/stop", *MANY),
    "wide stops": head("POST /api/stop", *["a:"] * 480),
    "foreign long stops": head("POST /api/stop", *MANY, host="evil.example"),
    "endless stops": lambda port: head("POST /api/stop", *MANY)(port)[:-2],
    "foreign stops": head("POST /api/stop", host="evil.example"),
    "stops": STOP,
    "pipelined stops": lambda port: STOP(port) * 500,
    "stops with bodies": lambda port: head("POST /api/stop", "content-length: 9")(port) + b"x",
    "long cancels": head("POST /api/cancel", *MANY),
    "bad JSON": lambda port: GOALS(port) + b"[" * 60_000,
}
# What each client sends on a new connection, which it soon closes, whatever the answer.
LEAVING: dict[str, Data] = {"unfinished stops": lambda port: STOP(port)[:-2]}
# What each client sends on a connection that it keeps, before and then again and again.
STAYING: dict[str, tuple[Data, Data]] = {
    "stops on open connections": (head("GET /api/health"), STOP),  # a first stop would end it
    "stops behind lines": (lambda port: head("GET /", *MANY)(port)[:8000], STOP),
    "chunks": (
        head("POST /api/stop", "transfer-encoding: chunked"),
        lambda port: b"1\r\nx\r\n" * 1000,
    ),
    "huge bodies": (
        head("POST /api/goals", "content-type: application/json", f"content-length: {10**9}"),
        lambda port: b"[" * 65_536,
    ),
    "rosbridge frames": (WEBSOCKET, lambda port: random.choice(FRAMES)),
    "rosbridge goals": (WEBSOCKET, lambda port: message(**GOAL, **KIND)),
    "rosbridge cancels": (WEBSOCKET, lambda port: message(**CANCEL)),
}


@contextlib.asynccontextmanager
async def connected(
    port: int,
) -> AsyncIterator[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        yield reader, writer
    finally:
        writer.transport.abort()


async def connect(port: int, data: bytes) -> None:
    """Connect, send, and read the first piece of the answer."""
    async with connected(port) as (reader, writer):
        writer.write(data)
        if data:
            await reader.read(4096)
        served[0] += 1


async def leave(port: int, data: bytes) -> None:
    """Connect, send, and leave without an answer."""
    async with connected(port) as (_, writer):
        writer.write(data)
        await asyncio.sleep(0.01)
        served[0] += 1


async def stay(port: int, first: bytes, then: bytes) -> None:
    """Send and read on one connection, 20 times or until the server closes it."""
    async with connected(port) as (reader, writer):
        for data in (first, *[then] * 20):
            writer.write(data)
            await writer.drain()
            with contextlib.suppress(TimeoutError):
                answer = await asyncio.wait_for(reader.read(65_536), 0.02)
                served[0] += 1
                if not answer:
                    return


async def hold(port: int) -> None:
    """Connect, send nothing, stay until the server closes the connection, and return later."""
    async with connected(port) as (reader, _):
        await reader.read()
        served[0] += 1
    await asyncio.sleep(random.uniform(0.5, 1.5))


async def client(kind: str, port: int) -> None:
    """Be one hostile client."""
    while True:
        with contextlib.suppress(OSError, TimeoutError):
            if kind in CONNECTING:
                await asyncio.wait_for(connect(port, CONNECTING[kind](port)), 1.0)
            elif kind == "held connections":
                await hold(port)  # without a limit of time
            elif kind in LEAVING:
                await asyncio.wait_for(leave(port, LEAVING[kind](port)), 1.0)
            else:
                await stay(port, *(data(port) for data in STAYING[kind]))
        await asyncio.sleep(0)


async def tell() -> None:
    """Print how often the server has served a client."""
    while True:
        await asyncio.sleep(0.1)
        print(*served, flush=True)  # noqa: T201


async def crowd(kind: str, port: int, clients: int) -> None:
    """Be all of them, as far as the limit of open files allows."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    await asyncio.gather(tell(), *(client(kind, port) for _ in range(clients)))


if __name__ == "__main__":
    asyncio.run(crowd(sys.argv[1], int(sys.argv[2]), int((sys.argv[3:] or ["80"])[0])))
