"""A file of any program is read with no more memory and time than its size justifies."""

import tracemalloc
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import logs
from logs.reading.mcap_records import HEAD, Decoder
from logs.reading.tolerant_reader import TolerantReader
from logs.views.narrative import narrative, overview
from tests.logs.test_run import RUNS, record
from tests.support.paths import EXAMPLES
from tests.support.recordings.alterations import records_of
from tests.support.recordings.bombs import BOMBS

pytestmark = pytest.mark.slow


@pytest.fixture(params=BOMBS)
def bomb(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(BOMBS[request.param]())
    return path


@pytest.fixture
def peak(bomb: Path) -> Iterator[None]:
    """After the bomb was made, at most 100 MB are allocated at once."""
    tracemalloc.start()
    yield
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 100e6


def test_a_message_is_copied_once() -> None:
    """A copy of megabytes holds up all other threads."""
    body = bytes(22) + b"x" * 8_000_000
    chunk = HEAD.pack(0x05, len(body)) + body
    decoder = Decoder()
    tracemalloc.start()
    message = decoder.message_at(chunk, 0, len(chunk))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message.data == body[22:]
    assert most < 1.5 * len(body)


@pytest.mark.usefixtures("peak")
def test_a_bomb_gives_few_records(bomb: Path) -> None:
    assert sum(1 for _ in TolerantReader(bomb)) < 15_000 + bomb.stat().st_size


@pytest.mark.usefixtures("peak")
def test_a_bomb_is_unreadable_or_cut(bomb: Path) -> None:
    with suppress(logs.LogError):
        assert overview(bomb).goal is None
    with suppress(logs.LogError):
        assert not list(narrative(bomb, everything=True))
    made = logs.recover(bomb)
    assert made is None or not made.whole
    assert logs.recover(bomb) is None


@pytest.mark.parametrize("compression", CompressionType)
def test_a_chunk_of_any_compression_is_read(tmp_path: Path, compression: CompressionType) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression)
        writer.start("ros2", "other")
        channel = writer.register_channel("/x", "cdr", 0)
        for number in range(100):
            writer.add_message(channel, number, b"the same" * number, number, number)
        writer.finish()  # type: ignore[no-untyped-call]
    reader = TolerantReader(path)
    found = [each.data for each in reader if type(each).__name__ == "Message"]
    assert found == [b"the same" * number for number in range(100)]
    assert reader.intact


def test_the_most_repetitive_recording_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    line = logs.LogLine(1.0, 20, "skill", "a" * 10_000)
    record(path, [*RUNS["ok"], *[line] * 3000])
    assert path.stat().st_size < 150_000
    assert sum(message.topic == "/rosout" for message in logs.read(path)) >= 3000


def test_records_are_those_that_the_library_reads() -> None:
    for path in sorted((EXAMPLES / "recordings").glob("*.mcap")):
        kinds = ("Index", "Statistics", "SummaryOffset")
        expected = [each for each in records_of(path) if not type(each).__name__.endswith(kinds)]
        assert list(TolerantReader(path)) == expected
        with path.open("rb") as stream:
            messages = [message for *_, message in make_reader(stream).iter_messages()]
        assert messages
