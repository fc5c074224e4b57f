"""Readers of other projects open every recording and find all records in it."""

import json
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from ruamel.yaml import YAML

import logs
from logs import Description, LogLine, Record, Sent
from tests.logs.test_run import RUNS, lifecycle, record
from tests.logs.writing.test_compaction import run_journal
from tests.support.paths import EXAMPLES, PEERS, ROBOT_FILE
from tests.support.servers.javascript import without_node

pytestmark = pytest.mark.slow

WITHOUT = without_node("@mcap/core")
BAG = {
    "version",
    "storage_identifier",
    "duration",
    "starting_time",
    "message_count",
    "topics_with_message_count",
    "compression_format",
    "compression_mode",
    "relative_file_paths",
    "files",
    "custom_data",
    "ros_distro",
}
EXAMPLES = EXAMPLES / "recordings"
URDF = (ROBOT_FILE.with_suffix(".urdf")).read_text()


def between_runs() -> list[Record]:
    """A server's own recording."""
    reported = LogLine(0.5, 20, "executive.server", "Listening on 127.0.0.1, grüß Gott \ud800 \0")
    return [Description(0.0, URDF), *lifecycle(0.1), reported]


def killed(path: Path) -> None:
    """A recovered journal that was cut within a record."""
    run_journal(path, finish=False)
    path.write_bytes(path.read_bytes()[:-3])
    assert logs.recover(path)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Recordings of runs with every outcome, and some of real runs."""
    folder = tmp_path_factory.mktemp("runs")
    reported = {**RUNS, "server": between_runs()}
    made = {name: folder / f"{name}.mcap" for name in [*reported, "killed"]}
    for name, records in reported.items():
        record(made[name], records)
    killed(made["killed"])
    return made | {path.stem: path for path in EXAMPLES.glob("*.mcap")}


def ours(path: Path) -> tuple[dict[str, int], list[str], list[list[float]]]:
    """What we read: messages by topic, frames, and positions [rad]."""
    sent = [r for r in logs.Recording(path).records(Sent) if isinstance(r, Sent)]
    frames = [frame.data.decode() for frame in sent]
    positions = [list(frame.positions) for frame in sent if frame.joints]
    return Counter(message.topic for message in logs.read(path)), frames, positions


def test_rosbags(files: dict[str, Path]) -> None:
    for path in files.values():
        with AnyReader([path]) as reader:
            found: list[tuple[str, Any]] = [
                (connection.topic, reader.deserialize(data, connection.msgtype))
                for connection, _, data in reader.messages()
            ]
        frames = [message.text for topic, message in found if topic == "/serial/tx"]
        joints = [list(message.position) for topic, message in found if topic == "/joint_states"]
        assert (Counter(topic for topic, _ in found), frames, joints) == ours(path), path


def test_the_stock_reader_with_every_checksum(files: dict[str, Path]) -> None:
    for path in files.values():
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            summary = reader.get_summary()
            counts = Counter(channel.topic for _, channel, _ in reader.iter_messages())
            attached = {item.name: item.data for item in reader.iter_attachments()}
            assert {item.name for item in reader.iter_metadata()} >= {"armtree"}
        assert summary is not None
        assert summary.statistics is not None
        assert counts == ours(path)[0], path
        assert counts.total() == summary.statistics.message_count
        assert attached == logs.Recording(path).files


def test_the_decoder_of_mcap_itself(files: dict[str, Path]) -> None:
    for path in files.values():
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            found = [(each.channel.topic, each[3]) for each in reader.iter_decoded_messages()]
        frames = [message.text for topic, message in found if topic == "/serial/tx"]
        joints = [list(message.position) for topic, message in found if topic == "/joint_states"]
        assert (Counter(topic for topic, _ in found), frames, joints) == ours(path), path


def test_rosbag2_finds_the_fields_that_it_needs(files: dict[str, Path]) -> None:
    """rosbag2 is not installed here; these are the fields that it reads from a bare file."""
    yaml = YAML(typ="safe")
    for path in files.values():
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            summary = reader.get_summary()
            notes = {note.name: note.metadata for note in reader.iter_metadata()}
        assert summary is not None
        assert summary.statistics is not None
        assert all(index.message_index_offsets for index in summary.chunk_indexes), path
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            assert summary.schemas[channel.schema_id].encoding == "ros2msg"
            (qos,) = yaml.load(channel.metadata["offered_qos_profiles"])
            numbers = [qos[policy] for policy in ("history", "reliability", "liveliness")]
            assert numbers == [1, 1, 1]
            assert qos["durability"] in (1, 2)
            assert {"depth", "deadline", "lifespan", "liveliness_lease_duration"} <= qos.keys()
        if path.parent != EXAMPLES:  # they are older
            bag = yaml.load(notes["rosbag2"]["serialized_metadata"])
            assert bag["version"] == 8  # newer versions have names for these numbers
            assert bag.keys() == BAG


@pytest.mark.skipif(WITHOUT != "", reason=WITHOUT)
def test_the_readers_of_foxglove(files: dict[str, Path]) -> None:
    command = ["node", "read_mcap.mjs", *map(str, files.values())]
    ran = subprocess.run(
        command, cwd=PEERS, capture_output=True, text=True, timeout=60, check=False
    )
    assert ran.returncode == 0, ran.stderr
    for path, reported in zip(files.values(), json.loads(ran.stdout), strict=True):
        assert (reported["counts"], reported["frames"], reported["positions"]) == ours(path), path
        assert reported["indexed"] == sum(reported["counts"].values())
        kept = logs.Recording(path).files
        assert reported["attached"] == {name: len(data) for name, data in kept.items()}


@pytest.mark.skipif(
    not shutil.which("rerun"), reason="rerun-sdk is not installed: 170 MB for this test alone"
)
def test_rerun(files: dict[str, Path]) -> None:
    for path in files.values():
        subprocess.run(["rerun", "mcap", "check", str(path)], check=True, capture_output=True)
