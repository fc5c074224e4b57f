"""ROS 2 itself builds our message types, and computes the hashes that recordings have."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from logs.records import ros_types as module
from logs.records.ros_types import schema, type_hash
from logs.records.topics import TOPICS

WITHOUT = "the rosidl wheels are not installed; there are none but for x86-64 Linux"
MESSAGES = ("SerialFrame", "TaskFeedback", "MeasuredJoints")
UUID = "uint8[16] uuid\n"


def built(package: str, folder: Path, share: Path, includes: dict[str, Path]) -> dict[str, str]:
    """Build the `.msg` files of a package as rosidl does; return the hashes of its types."""
    adapter = pytest.importorskip("rosidl_adapter.msg", reason=WITHOUT)
    generator = pytest.importorskip("rosidl_generator_type_description", reason=WITHOUT)
    share.mkdir()
    idl = [
        adapter.convert_msg_to_idl(folder, package, path.relative_to(folder), share / "msg")
        for path in sorted(folder.glob("msg/*.msg"))
    ]
    arguments = share / "arguments.json"
    facts = {
        "package_name": package,
        "output_dir": str(share),
        "idl_tuples": [f"{share}:{path.relative_to(share)}" for path in idl],
        "include_paths": [f"{name}:{path}" for name, path in includes.items()],
    }
    arguments.write_text(json.dumps(facts))
    descriptions = map(Path.read_text, generator.generate_type_hash(str(arguments)))
    types = (json.loads(each)["type_hashes"][0] for each in descriptions)
    return {each["type_name"]: each["hash_string"] for each in types}


@pytest.mark.slow
def test_ros_2_builds_our_types(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "ours" / "msg", tmp_path / "theirs" / "msg"
    for each in (ours, theirs):
        each.mkdir(parents=True)
    (theirs / "UUID.msg").write_text(UUID)
    for name in MESSAGES:
        shutil.copy(Path(module.__file__).with_name(f"{name}.msg"), ours)
    uuids = tmp_path / "unique_identifier_msgs"
    built("unique_identifier_msgs", theirs.parent, uuids, {})
    package = tmp_path / "arduinobot_msgs"
    found = built("arduinobot_msgs", ours.parent, package, {uuids.name: uuids})
    names = [f"arduinobot_msgs/msg/{name}" for name in MESSAGES]
    assert found == {name: type_hash(name) for name in names}


def test_the_types_are_those_of_ros_2() -> None:
    """rosbags reads the same from our definitions as from its own standard types."""
    ros, ours = get_typestore(Stores.ROS2_JAZZY).fielddefs, dict[str, Any]()
    for topic in TOPICS:
        ours |= get_types_from_msg(schema(topic.type), topic.type)
    standard = {name: found for name, found in ours.items() if not name.startswith("arduinobot")}
    assert len(standard) > 15
    assert {name: ros[name] for name in standard} == standard
