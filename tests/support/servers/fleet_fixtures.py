"""Fixtures: a fleet without arms."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.fleet.nats_server import NatsOptions, nats_server
from hardware import RealClock
from tests.support.servers.free_port import free_port


@pytest.fixture
def options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> NatsOptions:
    monkeypatch.setattr("executive.fleet.worker._SPREAD", (0.0, 0.0))  # no test has many arms
    monkeypatch.setattr("executive.fleet.connection._RETRY_SECONDS", 0.1)
    return NatsOptions(tmp_path / "fleet", port=free_port())


@pytest.fixture
def url(options: NatsOptions) -> Iterator[str]:
    with nats_server(options, RealClock()):
        yield options.url
