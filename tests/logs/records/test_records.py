"""Records of any content are read as they were written."""

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

import logs
from logs import NodeStatus, Record, Sent
from logs.writing.journal import Journal
from tests.logs.test_run import EPOCH_NS, order, rebuilt

TIMES = st.floats(0, 1e6)
ANGLES = st.floats(allow_nan=False)
JOINTS = st.lists(st.tuples(st.text("abc_123", min_size=1), ANGLES), max_size=6)


@st.composite
def sent_frames(draw: st.DrawFn) -> Sent:
    """Frames with any bytes, joints and schedule."""
    joints = draw(JOINTS)
    return Sent(
        draw(TIMES),
        draw(st.binary(max_size=80)),
        draw(st.none() | TIMES),
        draw(st.booleans()),
        tuple(name for name, _ in joints),
        tuple(angle for _, angle in joints),
    )


# Any text: a node's message may contain a file name with bytes that cannot be decoded.
TEXTS = st.text(st.characters(), max_size=30)
NODES = st.builds(NodeStatus, TIMES, TEXTS, TEXTS, st.sampled_from(["RUNNING", "INVALID"]), TEXTS)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.lists(sent_frames() | NODES, max_size=8))
def test_round_trip(records: list[Record]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        journal = Journal(path.open("xb"), EPOCH_NS)
        for record in records:
            journal.write(record)
        journal.finish()
        assert rebuilt(list(logs.read(path))) == sorted(records, key=order)
