"""The NATS server of a fleet: its configuration, its process, and its users."""

import fcntl
import json
import os
import shutil
import signal
import socket
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from executive.api import ADDRESS, NATS_PORT, token_file
from hardware import Clock, read_file
from hardware.loading.dataclass import dataclass

from .connection import (
    ALIVE,
    JOBS,
    MEMBERS,
    RECORDS,
    confirm_subject,
    consumer_of,
    control_subject,
    inbox_prefix,
)
from .errors import FleetMissing, FleetUnsafe, NotStarted, check_name
from .values import PRIORITIES

_START_SECONDS, _LOCK_SECONDS, _RETRY_SECONDS = 10.0, 3.0, 0.02
_OWN_KEY = "supervisor.nkey"  # file in the data folder; new at each start
_MOST = 2**20  # largest file of keys [bytes]
_LAST_LINES = 3  # number of lines of its log in an error


@dataclass(frozen=True, slots=True)
class NatsOptions:
    """Options of a NATS server: address, data folder and users.

    Attributes:
        data: Folder for jobs and their records.
        address: IP address of the interface.
        port: TCP port.
        certificate: TLS certificate of the server, or None.
        key: Private key of the certificate.
        nkeys: File with the public keys that may connect, one per line: `operator KEY`, or
            `arm KEY POOL.NAME`. None to accept a token, which programs of this user find.
    """

    data: Path
    address: str = ADDRESS
    port: int = NATS_PORT
    certificate: Path | None = None
    key: Path | None = None
    nkeys: Path | None = None

    @property
    def host(self) -> str:
        """Address for clients on this machine."""
        found = {"0.0.0.0": "127.0.0.1", "localhost": "127.0.0.1", "::": "::1"}
        return found.get(self.address, self.address)

    @property
    def url(self) -> str:
        """URL for clients on this machine."""
        scheme = "tls" if self.certificate else "nats"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{scheme}://{host}:{self.port}"

    def check(self) -> None:
        """Check the options against each other.

        Raises:
            FleetUnsafe: Other machines could connect without encryption or without keys.
            FleetMissing: The program nats-server is not installed.
            NotStarted: One file for TLS is missing.
            FileNotFoundError: A file for TLS does not exist.
        """
        local = self.address in ("127.0.0.1", "::1", "localhost")
        if not local and not (self.certificate and self.key and self.nkeys):
            raise FleetUnsafe(self.address)
        if bool(self.certificate) != bool(self.key):
            raise NotStarted("TLS needs both --tls-cert and --tls-key")
        for path in filter(None, (self.certificate, self.key)):
            path.stat()  # an error of nats-server would not name this file
        _program()


def make_key(path: Path) -> str:
    """Write a new private key to a file that only this user can read. Return its public key.

    Raises:
        FileExistsError: The file exists.
    """
    import nkeys

    seed = nkeys.encode_seed(os.urandom(32), nkeys.PREFIX_BYTE_USER)
    _write_private(path, seed.decode(), os.O_EXCL)
    public: bytes = nkeys.from_seed(bytearray(seed)).public_key
    return public.decode()


def own_credentials(options: NatsOptions) -> dict[str, Any]:
    """Return the options of nats-py for the connection of this program to the server."""
    found: dict[str, Any] = {"token": _token(options.data / "token")}
    if options.nkeys:
        found = {"nkeys_seed": str(options.data / _OWN_KEY)}
    if options.certificate:
        # The connection is to this machine, so the name in the certificate does not count.
        context = ssl.create_default_context(cafile=options.certificate)
        context.check_hostname = False
        context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        found["tls"] = context
    return found


@contextmanager
def nats_server(options: NatsOptions, clock: Clock) -> Iterator["subprocess.Popen[bytes]"]:
    """Run nats-server during the context. Stored data remains.

    Args:
        options: Its address, data folder and users.
        clock: Time source.

    Raises:
        FleetUnsafe, FleetMissing: As of `NatsOptions.check`.
        NotStarted: nats-server ends or does not answer in time, or another program uses the data
            folder or the address.
    """
    options.check()
    options.data.mkdir(mode=0o700, parents=True, exist_ok=True)
    with _locked(options.data, clock) as lock:
        _check_address(options)
        token = _token(options.data / "token")
        configuration = options.data / "nats-server.json"  # JSON is valid in its format
        _write_private(configuration, json.dumps(_configuration(options, token), indent=1))
        log = options.data / "nats-server.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                [*_ending_with_parent(), _program(), "-c", configuration],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=(lock,),
                start_new_session=True,  # Ctrl-C is for armtree, which then ends nats-server
            )
    info = token_file.ServerInfo(options.url, token, process.pid)
    try:
        _wait_until_ready(options, process, log, clock)
        token_file.write(options.port, info, token_file.FLEET)
        yield process
    finally:
        token_file.remove(options.port, info, token_file.FLEET)
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        try:
            process.wait(_START_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextmanager
def _locked(folder: Path, clock: Clock) -> Iterator[int]:
    """Lock a data folder: a second NATS server there would damage the stored jobs.

    nats-server inherits the lock, and holds it until its end, which follows soon if armtree dies.

    Raises:
        NotStarted: Another NATS server uses the folder.
    """
    end, pause = clock.now() + _LOCK_SECONDS, clock.signal()
    with (folder / "lock").open("wb") as stream:
        while True:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if clock.now() >= end:
                    raise NotStarted(
                        f"a NATS server uses the data folder {folder}, and its jobs are there. End "
                        "that fleet first, or name its URL with --use. A second fleet needs its "
                        "own --data, --nats-port and --http-port"
                    ) from error
            with pause:
                pause.wait(clock.now() + _RETRY_SECONDS)
        yield stream.fileno()


def _check_address(options: NatsOptions) -> None:
    """Check that no other program listens at the address of a server.

    Raises:
        NotStarted: Another program listens there.
    """
    family = socket.AF_INET6 if ":" in options.address else socket.AF_INET
    with socket.socket(family) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((options.address, options.port))
        except OSError as error:
            where = f"{options.address} port {options.port}"
            raise NotStarted(
                f"nats-server cannot listen on {where}: {error.strerror}. If the NATS server "
                f"of a fleet runs there, --use {options.url} adds the supervisor and the page; "
                "else choose another port with --nats-port, and another folder with --data"
            ) from error


# Program that becomes another program. The system sends it SIGTERM if its parent dies.
_BECOME = """
import ctypes, os, signal, sys
PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>
ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
parent, *command = sys.argv[1:]
if os.getppid() == int(parent):  # else it has died already
    os.execv(command[0], command)
"""


def _ending_with_parent() -> list[str]:
    """Return the beginning of a command that ends if the thread that starts it dies.

    Linux only. Elsewhere nats-server outlives a killed armtree, and needs `fleet up --use URL`.
    """
    if sys.platform != "linux":
        return []
    return [sys.executable, "-I", "-S", "-c", _BECOME, str(os.getpid())]


def _program() -> str:
    """Return the path of nats-server: in the folder of this Python, or in the search path."""
    beside = Path(sys.executable).with_name("nats-server")
    found = str(beside) if beside.is_file() else shutil.which("nats-server")
    if not found:
        raise FleetMissing("nats-server")
    return found


def _configuration(options: NatsOptions, token: str) -> dict[str, Any]:
    found: dict[str, Any] = {
        "host": options.address,
        "port": options.port,
        "server_name": "armtree-fleet",
        # A job is acknowledged when it is on disk. By default, NATS syncs only every two minutes.
        "jetstream": {"store_dir": str(options.data.resolve()), "sync_interval": "always"},
        "max_connections": 65_536,
    }
    if options.certificate:
        found["tls"] = {"cert_file": str(options.certificate), "key_file": str(options.key)}
    if options.nkeys:
        (options.data / _OWN_KEY).unlink(missing_ok=True)
        own = {"nkey": make_key(options.data / _OWN_KEY)}
        found["authorization"] = {"users": [own, *_users(options.nkeys)]}
    else:
        found["authorization"] = {"token": token}
    return found


def _users(path: Path) -> list[dict[str, Any]]:
    users: list[dict[str, Any]] = []
    for number, line in enumerate(read_file(path, _MOST).decode(errors="replace").splitlines(), 1):
        match line.partition("#")[0].split():
            case []:
                pass
            case ["operator", key] if key.startswith("U"):
                users.append({"nkey": key})
            case ["arm", key, arm] if key.startswith("U") and arm.count(".") == 1:
                users.append({"nkey": key, "permissions": _permissions(*arm.split("."))})
            case _:
                words = "expected `operator KEY` or `arm KEY POOL.NAME`"
                raise NotStarted(f"{path}:{number}: {words}: {line[:80]}")
    if not users:
        raise NotStarted(f"{path} names no key; `armtree fleet key` makes one")
    return users


def _permissions(pool: str, name: str) -> dict[str, Any]:
    """Return the subjects that an arm may use. They allow no jobs, stops, or names of other arms.

    Raises:
        BadName: A name is malformed.
    """
    arm = f"{check_name('a pool', pool)}.{check_name('an arm', name)}"
    consumers = [f"{JOBS}.{consumer_of(pool, priority)}" for priority in PRIORITIES]
    buckets = [f"KV_{bucket}" for bucket in (ALIVE, MEMBERS, RECORDS)]
    publish = [f"$KV.{ALIVE}.{arm}", f"$KV.{MEMBERS}.{arm}", f"$KV.{RECORDS}.*"]
    publish += [f"{confirm_subject('*')}.{arm}", "$JS.API.STREAM.INFO.*"]
    publish += [f"$JS.API.STREAM.CREATE.{each}" for each in (JOBS, *buckets)]
    publish += [f"$JS.API.DIRECT.GET.{each}.>" for each in buckets]
    publish += [
        f"$JS.API.CONSUMER.{act}.{each}" for act in ("INFO", "MSG.NEXT") for each in consumers
    ]
    publish += [f"$JS.API.CONSUMER.CREATE.{each}.>" for each in consumers]
    publish += [f"$JS.ACK.{each}.>" for each in consumers]
    subscribe = [f"{inbox_prefix(arm)}.>"]
    subscribe += [
        control_subject(request, whom)
        for request in ("stop", "resume", "cancel")
        for whom in ("", pool, arm)
    ]
    return {"publish": {"allow": publish}, "subscribe": {"allow": subscribe}}


def _token(path: Path) -> str:
    """Return the token of a data folder. It stays the same, so that arms can reconnect."""
    if not path.exists():
        _write_private(path, token_file.new_token())
    return path.read_text().strip()


def _write_private(path: Path, text: str, if_exists: int = os.O_TRUNC) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | if_exists | os.O_NOFOLLOW, 0o600)
    with os.fdopen(handle, "w") as stream:
        stream.write(text)


def _wait_until_ready(
    options: NatsOptions, process: "subprocess.Popen[bytes]", log: Path, clock: Clock
) -> None:
    end, pause = clock.now() + _START_SECONDS, clock.signal()
    while process.poll() is None and clock.now() < end:
        try:
            socket.create_connection((options.host, options.port), 1).close()
            return
        except OSError:
            with pause:
                pause.wait(clock.now() + _RETRY_SECONDS)
    last = " ".join(log.read_text(errors="replace").splitlines()[-_LAST_LINES:])
    why = "does not answer" if process.poll() is None else "has ended"
    process.kill()
    raise NotStarted(f"nats-server {why}; its log, {log}, ends: {last or '(empty)'}")
