"""Boards with AVR code, built once a session."""

from collections.abc import Iterator

import pytest

from tests.avr import rig
from tests.avr.rig import AvrBoard, Built, MakeBoard


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return rig.build(tmp_path_factory.mktemp("avr"))


@pytest.fixture
def board(built: Built) -> Iterator[MakeBoard]:
    """Makes boards in simulated time."""
    boards: list[AvrBoard] = []

    def make(firmware: str = "armtree", boot_time: float = 1.0) -> AvrBoard:
        boards.append(AvrBoard(built, firmware, boot_time))
        return boards[-1]

    yield make
    for made in boards:
        made.close()
