"""The connection to the NATS server of a fleet: credentials, stream, buckets, subjects."""

import asyncio
import json
import logging
import os
import re
import ssl
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

import nats
import nats.errors
from nats.aio.client import Client as Nats
from nats.aio.msg import Msg
from nats.js import JetStreamContext
from nats.js.api import (
    ConsumerConfig,
    DiscardPolicy,
    KeyValueConfig,
    RePublish,
    RetentionPolicy,
    StorageType,
    StreamConfig,
)
from nats.js.errors import KeyNotFoundError, NotFoundError
from nats.js.kv import KeyValue
from nats.protocol.parser import Parser

from executive.api import NATS_PORT, strict_json, token_file
from hardware import read_file
from hardware.loading.dataclass import dataclass

from .errors import (
    BadCredentials,
    BadJob,
    FleetError,
    FleetRefused,
    FleetUnreachable,
    UntrustedFleet,
    without_login,
)
from .values import PRIORITIES, Job, JobRecord, Member, Presence, from_bytes

T = TypeVar("T")

logger = logging.getLogger(__name__)

MEMBERS, RECORDS, ALIVE = "fleet_members", "fleet_jobs", "fleet_alive"
_BUCKETS: Mapping[type, str] = {Member: MEMBERS, JobRecord: RECORDS, Presence: ALIVE}
JOBS = "fleet_jobs_queue"  # stream of the jobs that no arm has claimed
ALIVE_SECONDS = 10.0  # silence after which an arm counts as gone
_CLAIM_SECONDS = 30.0  # time until an unclaimed job is delivered again [s]
_REPEAT_SECONDS = 3600.0  # a repeated message id is refused for this time [s]
_KEEP_SECONDS = 7 * 86400.0  # records of jobs are kept for this time [s]
_QUEUE_BYTES = 2**30
_CONNECT_SECONDS, _ANSWER_SECONDS = 2.0, 5.0
_RETRY_SECONDS, _CLOSE_SECONDS = 1.0, 1.0
_MOST_KEY = 4096  # largest file of a private key [bytes]
_MOST_TOLD = 8  # number of errors kept for each connection
_WAITING = 20_000  # largest number of waiting arms of a pool
_BATCH = 500  # number of values read with one request
_MOST_UNREAD = 2**23  # largest part of a message that has no end yet [bytes]
_MOST_UNSENT = 2**23  # largest amount that a server has not read yet [bytes]

_LOST = "the connection was lost"

# Exceptions of NATS and its libraries if the server is gone, slow, or restarting.
GONE = (nats.errors.Error, OSError, asyncio.TimeoutError)
# Exceptions of nats-py if another program answers.
_CONFUSED = (ValueError, TypeError, AttributeError, KeyError)


def job_subject(pool: str, priority: str, identity: str) -> str:
    """Return the subject of a job; `*` for all pools, priorities or jobs."""
    return f"fleet.job.{pool}.{priority}.{identity}"


def consumer_of(pool: str, priority: str) -> str:
    """Return the name of the consumer of these jobs."""
    return f"{pool}-{priority}"


def control_subject(request: str, arm: str = "") -> str:
    """Return the subject of a request to arms.

    Args:
        request: `stop`, `resume` or `cancel`.
        arm: POOL.NAME, or POOL for all arms of a pool; empty for all arms.
    """
    return f"fleet.{request}{f'.{arm}' if arm else ''}"


def confirm_subject(request: str) -> str:
    """Return the reply subject of a request; `*` for all requests.

    An arm adds its POOL.NAME. The NATS server lets the arm use no other name, so that no arm can
    answer for another arm.
    """
    return f"fleet.confirm.{request}"


def inbox_prefix(name: str) -> str:
    """Return the prefix of the subjects on which a program receives its answers."""
    return f"_INBOX.{name}"


@dataclass(frozen=True, slots=True)
class Fleet:
    """The data of a fleet on its NATS server.

    Attributes:
        nats: The connection.
        stream: JetStream of the server.
        members: Bucket of `Member`, by arm.
        alive: Bucket of `Presence`, by arm; entries expire.
        jobs: Bucket of `JobRecord`, by identity. Creating a record claims the job.
    """

    nats: Nats
    stream: JetStreamContext
    members: KeyValue
    alive: KeyValue
    jobs: KeyValue

    async def values(self, kind: type[T]) -> dict[str, T]:
        """Return all values of a type, by key. Malformed values are logged and left out."""
        found, _ = await self.changes(kind)
        return {key: value for key, value in found.items() if value is not None}

    async def changes(self, kind: type[T], after: int = 0) -> tuple[dict[str, T | None], int]:
        """Return the changed values of a type by key, and the last revision.

        Args:
            kind: The type.
            after: Revision; only later changes are returned.

        Returns:
            The values, with None for deleted values; and the `after` of the next call.
        """
        bucket, found, more = _BUCKETS[kind], dict[str, T | None](), True
        prefix = f"$KV.{bucket}."
        subscription = await self.nats.subscribe(inbox := self.nats.new_inbox())
        try:
            while more:
                request = {"seq": after + 1, "batch": _BATCH, "next_by_subj": f"{prefix}>"}
                subject = f"$JS.API.DIRECT.GET.KV_{bucket}"
                await self.nats.publish(subject, json.dumps(request).encode(), inbox)
                while True:
                    message = await subscription.next_msg(_ANSWER_SECONDS)
                    headers = message.headers or {}
                    if "Nats-Sequence" not in headers:  # the end of the batch
                        break
                    after = int(headers["Nats-Sequence"])
                    key = headers["Nats-Subject"].removeprefix(prefix)
                    try:
                        gone = "KV-Operation" in headers
                        found[key] = None if gone else from_bytes(kind, message.data)
                    except BadJob as error:
                        logger.warning("Fleet: ignored %s in the bucket %s: %s", key, bucket, error)
                more = headers.get("Nats-Num-Pending", "0") != "0"
        finally:
            await subscription.unsubscribe()
        return found, after

    async def get(self, kind: type[T], key: str) -> tuple[T, int] | None:
        """Return a value of a type and its revision, or None if there is no such key.

        Raises:
            BadJob: The value is malformed.
        """
        buckets = {Member: self.members, JobRecord: self.jobs, Presence: self.alive}
        try:
            entry = await buckets[kind].get(key)
        except KeyNotFoundError:
            return None
        return from_bytes(kind, entry.value), entry.revision or 0

    async def age(self, message: Msg, job: Job) -> float:
        """Return the time since a job was sent, by the clock of the NATS server [s].

        Args:
            message: Message of the job.
            job: The job.

        Raises:
            nats.errors.Error: An answer of the NATS server has no time, such as after a start
                without its disk.
        """
        consumer = consumer_of(job.pool, job.priority)
        answer = await self.nats.request(f"$JS.API.CONSUMER.INFO.{JOBS}.{consumer}", b"")
        try:
            now = datetime.fromisoformat(strict_json.parse_object(answer.data)["ts"])
            return (now - message.metadata.timestamp).total_seconds()
        except (strict_json.NotJson, KeyError, TypeError, ValueError) as error:
            raise nats.errors.Error(f"no time in an answer about {consumer}: {error}") from error

    async def add_consumers(self, pool: str) -> bool:
        """Make the consumers of a pool, unless they exist. Return True if a stop holds them."""
        with suppress(NotFoundError):
            info = await self.stream.consumer_info(JOBS, consumer_of(pool, PRIORITIES[-1]))
            return bool(info.paused)
        for priority in PRIORITIES:
            await self.stream.add_consumer(
                JOBS,
                ConsumerConfig(
                    name=consumer_of(pool, priority),  # puts the filter into the subject
                    durable_name=consumer_of(pool, priority),
                    filter_subject=job_subject(pool, priority, "*"),
                    ack_wait=_CLAIM_SECONDS,
                    max_deliver=-1,
                    max_ack_pending=-1,
                    max_waiting=_WAITING,
                ),
            )
        return False


@asynccontextmanager
async def open_fleet(
    url: str,
    name: str,
    lasting: bool = False,
    changed: Callable[[bool], Awaitable[None]] | None = None,
    credentials: Mapping[str, Any] | None = None,
) -> AsyncIterator[Fleet]:
    """Connect to a fleet, and make its stream and its buckets unless they exist.

    Args:
        url: URL of the NATS server.
        name: Name of this program, which the server shows; POOL.NAME for an arm.
        lasting: True to wait for the server and always reconnect; False to fail at once.
        changed: Callback with False when the connection is lost, and with True when it is back.
        credentials: Options of nats-py for the login of this program. Default: the user's.

    Raises:
        FleetUnreachable: No server answers, or the server stopped answering.
        FleetRefused: The server refuses the credentials, or an action of this program.
        BadCredentials: The file of a key or certificate is unusable.
    """
    url, connection = token_file.loopback(url), _Connection()
    watch = _Watch(url, connection, lasting, changed)
    options: dict[str, Any] = {
        **(_credentials(url) if credentials is None else credentials),
        "name": name,
        "inbox_prefix": inbox_prefix(name),
        "error_cb": watch.note,
        "disconnected_cb": watch.disconnected,
        "reconnected_cb": watch.reconnected,
        "closed_cb": watch.closed,
        "connect_timeout": _CONNECT_SECONDS,
        "reconnect_time_wait": 0.5,
        "ping_interval": ALIVE_SECONDS,  # two missing answers mean a dead network
        "max_reconnect_attempts": -1 if lasting else 1,  # the library treats 0 as no limit
        "allow_reconnect": lasting,
    }
    try:
        try:
            await connection.connect(url, **options)
            fleet = await _open(connection, lasting)
        except OSError as error:
            raise watch.why(error) from error
        yield fleet  # the caller may raise its own OSError, such as of a file
    except (TimeoutError, nats.errors.Error) as error:
        raise watch.why(error) from error
    except asyncio.CancelledError as error:
        if watch.has_canceled():
            raise watch.why(error) from error
        raise
    finally:
        watch.closing = True
        with suppress(*GONE):  # the library waits for ever, for example after a refused certificate
            async with asyncio.timeout(_CLOSE_SECONDS):
                await connection.close()


class _Connection(Nats):
    """A connection of nats-py that ends if another program answers, and reads until its end."""

    def __init__(self) -> None:
        super().__init__()
        self._ps = _Parser(self)

    async def _process_connect_init(self) -> None:
        try:
            await super()._process_connect_init()
            self._max_payload = int(self._max_payload)
        except ssl.SSLError:  # also a ValueError
            raise
        except _CONFUSED as error:
            raise nats.errors.Error("another program answers at this address") from error

    async def _process_pong(self) -> None:
        # The library would stop reading if the caller no longer waits for this answer.
        with suppress(asyncio.InvalidStateError):
            await super()._process_pong()


class _Parser(Parser):
    """Reads the data of a NATS server, and limits the data that is not processed yet."""

    async def parse(self, data: bytes = b"") -> None:
        """Read more data.

        Raises:
            nats.errors.ProtocolError: The data is not of a NATS server, or there is too much of it.
        """
        if len(self.buf) > _MOST_UNREAD or self.nc.pending_data_size > _MOST_UNSENT:
            raise nats.errors.ProtocolError
        try:
            await super().parse(data)
        except _CONFUSED as error:
            raise nats.errors.ProtocolError from error


class _Watch:
    """Handles the events of a connection of nats-py.

    Args:
        url: URL of the NATS server.
        connection: The connection.
        lasting: True if the connection always reconnects.
        changed: Callback as in `open_fleet`.

    Attributes:
        closing: True if the connection may end.
    """

    def __init__(
        self,
        url: str,
        connection: Nats,
        lasting: bool,
        changed: Callable[[bool], Awaitable[None]] | None,
    ) -> None:
        self._url, self._connection, self._lasting = url, connection, lasting
        self._changed = changed
        self._told = deque[Exception](maxlen=_MOST_TOLD)
        self._logged: type[FleetError] | None = None
        self._user, self._canceled = asyncio.current_task(), False
        self.closing = False

    async def note(self, error: Exception) -> None:
        """Note an error. Without this callback the library logs every failed attempt.

        The library leaves the socket of a failed attempt to reconnect open.
        """
        if self._connection.is_connecting and (socket := self._connection._transport):
            socket.close()  # type: ignore[no-untyped-call]
        why = self.why(error)
        if self._lasting and type(why) is not self._logged:
            self._logged = type(why)
            logger.warning("Fleet: %s", why)
        self._told.append(error)

    async def disconnected(self) -> None:
        """Report that the connection is lost."""
        if self._changed and not self.closing:
            await self._changed(False)

    async def reconnected(self) -> None:
        """Report that the connection is back, when its stream and buckets exist again."""
        self._told.clear()
        self._logged = None
        await _open(self._connection, self._lasting)  # a restart loses buckets in memory
        if self._changed:
            await self._changed(True)

    async def closed(self) -> None:
        """Cancel the task that uses a closed connection, because answers will never come."""
        if self._user and not self.closing:
            self._canceled = True
            self._told.append(ConnectionError(_LOST))
            self._user.cancel()

    def has_canceled(self) -> bool:
        """Return True if only `closed` has canceled the task that uses the connection."""
        return bool(self._canceled and self._user and self._user.uncancel() == 0)

    def why(self, error: BaseException) -> FleetError:
        """Return the error of armtree for an error of nats-py.

        An earlier error, such as a refusal by the NATS server, comes first: it has the reason.
        """
        url, words = without_login(self._url), [str(each) for each in (error, *self._told)]
        if any(re.search("authorization|permissions", each, re.IGNORECASE) for each in words):
            return FleetRefused(url)
        why = self._told[-1] if self._told else error
        if isinstance(why, ssl.SSLCertVerificationError):
            return UntrustedFleet(url, why.verify_message)
        if isinstance(why, nats.errors.UnexpectedEOF):  # may come before `closed`
            return FleetUnreachable(url, _LOST)
        number = getattr(why, "errno", None) or 0  # negative for a name that has no address
        said = os.strerror(number) if number > 0 else getattr(why, "strerror", None) or str(why)
        return FleetUnreachable(url, said or type(why).__name__)


async def _open(connection: Nats, lasting: bool) -> Fleet:
    """Return the fleet of a connection. Make its stream and buckets unless they exist."""
    stream = connection.jetstream(timeout=_ANSWER_SECONDS)
    while True:
        try:
            try:
                # The only bucket in memory. It is made last.
                await stream.stream_info(f"KV_{ALIVE}")
            except NotFoundError:
                await _make(stream)
            break
        except GONE:
            if not lasting:
                raise
            await asyncio.sleep(_RETRY_SECONDS)
    members, jobs, alive = (
        KeyValue(name=name, stream=f"KV_{name}", pre=f"$KV.{name}.", js=stream, direct=True)
        for name in (MEMBERS, RECORDS, ALIVE)
    )
    return Fleet(connection, stream, members, alive, jobs)


async def _make(stream: JetStreamContext) -> None:
    await stream.add_stream(
        StreamConfig(
            name=JOBS,
            subjects=["fleet.job.>"],
            retention=RetentionPolicy.WORK_QUEUE,
            storage=StorageType.FILE,
            discard=DiscardPolicy.NEW,
            max_bytes=_QUEUE_BYTES,
            duplicate_window=_REPEAT_SECONDS,
            num_replicas=1,
            allow_direct=True,
        )
    )
    events = RePublish(f"$KV.{ALIVE}.>", "fleet.events.>")
    for bucket, ttl, storage, publish in (
        (MEMBERS, None, StorageType.FILE, None),
        (RECORDS, _KEEP_SECONDS, StorageType.FILE, None),
        (ALIVE, ALIVE_SECONDS, StorageType.MEMORY, events),
    ):
        await stream.create_key_value(
            KeyValueConfig(bucket, direct=True, ttl=ttl, storage=storage, republish=publish)
        )


def _credentials(url: str) -> dict[str, Any]:
    """Return the options for the login and for the check of the server's certificate."""
    found: dict[str, Any] = {}
    parts = urlsplit(url)
    if key := os.environ.get("ARMTREE_FLEET_NKEY"):
        found["nkeys_seed_str"] = _seed(key)
    elif not parts.username:
        # Read for each attempt, because the server may start later than this program.
        found["token"] = lambda: os.environ.get("ARMTREE_FLEET_TOKEN") or _own_token(url)
    if parts.scheme == "tls":
        authority = os.environ.get("ARMTREE_FLEET_CA")
        try:
            found["tls"] = ssl.create_default_context(cafile=authority)
        except OSError as error:  # also if the format of the file is wrong
            why = error.strerror or error
            raise BadCredentials("ARMTREE_FLEET_CA", authority or "", why) from error
    return found


def _seed(key: str) -> str:
    """Return the private key of a file.

    Raises:
        BadCredentials: The file cannot be read, or has no private key.
    """
    import nkeys

    try:
        seed = read_file(Path(key).expanduser(), _MOST_KEY).strip()
        nkeys.from_seed(bytearray(seed))
    except (OSError, ValueError, nkeys.NkeysError) as error:
        why = getattr(error, "strerror", None) or error
        raise BadCredentials("ARMTREE_FLEET_NKEY", key, why) from error
    return seed.decode()


def _own_token(url: str) -> str:
    """Return the token of the NATS server at a URL if this user started it here, else "".

    Without TLS, the host must be that in the server's file: at another address of this machine,
    another user's program may listen. With TLS, the check of the certificate refuses that program.
    """
    parts = urlsplit(url)
    own = token_file.read(parts.port or NATS_PORT, token_file.FLEET)
    if not own:
        return ""
    known = {urlsplit(own.url).hostname}
    if parts.scheme == "tls":
        known |= {"localhost", "127.0.0.1", "::1"}
    return own.token if parts.hostname in known else ""


async def end_all(*tasks: asyncio.Task[Any]) -> None:
    """Cancel tasks until they end. `wait_for` of Python 3.11, in nats-py, can lose one cancel."""
    left = {task for task in tasks if not task.done()}
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=_RETRY_SECONDS)
