"""The bytes of messages are those of rosbags, which reads and writes any type of ROS 2."""

from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from logs.records.cdr import Message, decode, encode
from logs.records.ros_types import Field, fields, schema
from logs.records.topics import TOPICS

NAMES = sorted({topic.type for topic in TOPICS})


@pytest.fixture(scope="module")
def rosbags() -> Typestore:
    store = get_typestore(Stores.EMPTY)
    for name in NAMES:
        new = get_types_from_msg(schema(name), name)
        store.register({each: new[each] for each in new.keys() - store.fielddefs.keys()})
    return store


def example(name: str, size: int) -> Message:
    """A message of a type; its texts and sequences have a size."""
    return Message(**{field.name: values(field, size) for field in fields(name)})


def values(field: Field, size: int) -> Any:
    if field.length is None:
        return value(field, size)
    found = [value(field, size) for _ in range(field.length or size)]
    if field.type == "uint8":
        return bytes(found)
    return tuple(found) if field.type == "float64" else found


def value(field: Field, size: int) -> Any:
    if field.is_message:
        return example(field.type, size)
    return {"string": "é" * size, "float64": -0.1 * size}.get(field.type, 7 + size)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [0, 1, 2, 3, 5])
def test_rosbags_reads_and_writes_the_same_bytes(name: str, size: int, rosbags: Typestore) -> None:
    message = example(name, size)
    data = encode(name, message)
    read = rosbags.deserialize_cdr(data, name)
    assert bytes(rosbags.serialize_cdr(read, name)) == data
    for order in (True, False):
        assert (
            decode(name, bytes(rosbags.serialize_cdr(read, name, little_endian=order))) == message
        )


@pytest.mark.parametrize("name", NAMES)
def test_bytes_that_do_not_fit_are_refused(name: str) -> None:
    data = encode(name, example(name, 2))
    for length in range(len(data)):
        with pytest.raises(ValueError, match="too few"):
            decode(name, data[:length])
    assert decode(name, data + bytes(3)) == decode(name, data)
    with pytest.raises(ValueError, match="4 bytes follow its last field"):
        decode(name, data + bytes(4))


@pytest.mark.parametrize("name", ["std_msgs/msg/String", "tf2_msgs/msg/TFMessage"])
def test_a_length_beyond_the_end_takes_no_memory(name: str) -> None:
    with pytest.raises(ValueError, match="too few"):
        decode(name, b"\0\1\0\0" + b"\xff" * 8)


def test_a_type_that_no_recording_has_is_named() -> None:
    with pytest.raises(ValueError, match="the message type foo_msgs/msg/Foo is unknown"):
        decode("foo_msgs/msg/Foo", b"\0\1\0\0")
