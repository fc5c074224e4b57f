"""What the key of an arm allows at a real nats-server."""

import asyncio
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from executive.fleet.connection import (
    JOBS,
    MEMBERS,
    RECORDS,
    Fleet,
    control_subject,
    job_subject,
    open_fleet,
)
from executive.fleet.errors import FleetRefused, NotConfirmed, NotStarted, UntrustedFleet
from executive.fleet.fleet_client import FleetClient
from executive.fleet.nats_server import NatsOptions, make_key, nats_server, own_credentials
from executive.fleet.values import Job, Member, to_bytes
from executive.fleet.worker import Worker
from hardware import RealClock
from tests.support.servers.free_port import free_port
from tests.support.servers.simulated_arms import SimulatedArm

pytestmark = pytest.mark.slow

CLOCK = RealClock()


@pytest.fixture
def options(tmp_path: Path) -> NatsOptions:
    """A fleet with the key of bench.0, in the file arm.nkey."""
    keys = tmp_path / "keys"
    keys.write_text(f"arm {make_key(tmp_path / 'arm.nkey')} bench.0  # the first\n")
    return NatsOptions(tmp_path / "fleet", port=free_port(), nkeys=keys)


def test_an_arm_with_its_key_runs_jobs_and_touches_no_other_arm(
    options: NatsOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = {"nkeys_seed": str(options.data.parent / "arm.nkey")}
    other = Member("bench.1", "http://other", "host", "e" * 32, 1)
    job = Job("a" * 32, "bench", 1, {}, 1)

    async def forbidden(fleet: Fleet) -> None:
        """What a stolen key tries."""
        nats = fleet.nats
        await nats.publish(f"$KV.{MEMBERS}.{other.arm}", b"", headers={"KV-Operation": "PURGE"})
        await nats.publish(job_subject("bench", "high", job.identity), to_bytes(job))
        await nats.publish(control_subject("stop"), b"{}")
        for act in ("PURGE", "DELETE"):
            for stream in (JOBS, f"KV_{MEMBERS}", f"KV_{RECORDS}"):
                await nats.publish(f"$JS.API.STREAM.{act}.{stream}", b"{}")
        await nats.flush()

    async def main() -> None:
        credentials = own_credentials(options)
        arm = SimulatedArm(duration=0.0)
        async with (
            open_fleet(options.url, "person", credentials=credentials) as fleet,
            open_fleet(options.url, "bench.0", lasting=True, credentials=key) as own,
            open_fleet(options.url, "bench.0", lasting=True, credentials=key) as stolen,
        ):
            client, worker = FleetClient(fleet, CLOCK), Worker(own, arm, "bench", "0", CLOCK)
            running = asyncio.create_task(worker.run())
            while not [row for row in await client.arms() if row.state == "ready"]:
                continue
            sent = await client.send(1, "bench", {})
            last = [each async for each in client.wait(sent.identity)][-1]
            assert (last.arm, last.state) == ("bench.0", "SUCCEEDED")
            await fleet.members.put(other.arm, to_bytes(other))
            await forbidden(stolen)
            assert [row.member.arm for row in await client.arms()] == ["bench.0", "bench.1"]
            assert await client.queued() == (0, [])
            assert [each.job for each in await client.records()] == [sent]
            assert arm.stops == 0

            async def confirm(message: object) -> None:
                reply = getattr(message, "reply", "")
                await stolen.nats.publish(f"{reply}.{other.arm}", b'{"error": ""}')

            await stolen.nats.subscribe(control_subject("stop"), cb=confirm)
            with pytest.raises(NotConfirmed, match=r"1 of 2 arms confirmed stop; not .* bench\.1;"):
                await client.stop()
            assert arm.stops == 1
            worker.end()
            await running

    with nats_server(options, CLOCK):
        asyncio.run(asyncio.wait_for(main(), 40))


@pytest.mark.parametrize("line", ["arm UABC", "arm UABC bench", "arm UABC bench.0 x", "person U"])
def test_a_line_of_the_keys_that_is_not_one_is_named(options: NatsOptions, line: str) -> None:
    assert options.nkeys
    options.nkeys.write_text(f"# keys\n{line}\n")
    words = re.escape("keys:2: expected `operator KEY` or `arm KEY POOL.NAME`")
    with pytest.raises(NotStarted, match=words), nats_server(options, CLOCK):
        pass


def test_a_fleet_with_tls_needs_its_certificate_and_a_key(
    options: NatsOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    certificate, key = self_signed(tmp_path)
    options = replace(options, certificate=certificate, key=key)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("executive.fleet.connection._CLOSE_SECONDS", 0.1)

    async def connect(url: str = options.url) -> None:
        async with asyncio.timeout(10), open_fleet(url, "bench.0"):
            pass

    with nats_server(options, CLOCK):
        with pytest.raises(UntrustedFleet, match="ARMTREE_FLEET_CA"):
            asyncio.run(connect())
        monkeypatch.setenv("ARMTREE_FLEET_CA", str(certificate))
        with pytest.raises(UntrustedFleet, match=r"'localhost'; .* name of the certificate"):
            asyncio.run(connect(f"tls://localhost:{options.port}"))
        with pytest.raises(FleetRefused):
            asyncio.run(connect())
        monkeypatch.setenv("ARMTREE_FLEET_NKEY", str(tmp_path / "arm.nkey"))
        asyncio.run(connect())


def test_half_of_tls_is_refused(options: NatsOptions, tmp_path: Path) -> None:
    with pytest.raises(NotStarted, match="--tls-key"):
        replace(options, certificate=tmp_path / "gone").check()
    with pytest.raises(FileNotFoundError, match="gone"):
        replace(options, certificate=tmp_path / "gone", key=tmp_path / "gone").check()


def self_signed(folder: Path) -> tuple[Path, Path]:
    """Write a certificate for 127.0.0.1, and its private key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "fleet")])
    now = datetime.now(UTC)
    here = x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))])
    certificate = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=1))
        .add_extension(here, critical=False)
        .sign(key, hashes.SHA256())
    )
    files = folder / "certificate.pem", folder / "key.pem"
    files[0].write_bytes(certificate.public_bytes(Encoding.PEM))
    files[1].write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    return files
