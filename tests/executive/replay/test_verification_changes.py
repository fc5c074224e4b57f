"""A recording with a single change and valid checksums never passes."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from executive.replay.verification import verify
from logs.reading.digests import changed_part as changed_in
from logs.records.cdr import decode, encode
from logs.records.file_format import DIGESTS
from tests.conftest import RigMaker
from tests.executive.goals.test_pause import at_frame, pause_for
from tests.executive.replay.test_verification import checks, field, picked
from tests.support.paths import EXAMPLES
from tests.support.recordings.alterations import (
    Change,
    altered,
    each,
    records_of,
    retold,
    rewritten,
)
from tests.support.recordings.compact import compact
from tests.support.recordings.single_changes import single_changes

pytestmark = pytest.mark.slow

EXAMPLE = EXAMPLES / "recordings" / "7_measure.mcap"

# Values that follow from nothing else in a recording: only its digests show a change of them.
BY_DIGEST_ALONE = """\
.* (publish_time|sequence)|/robot_description log_time|file .* (time|name)
file .*\\.yaml (data|left out)|note (configuration|versions) .*
/(lifecycle|rosout|tree|result) left out|/rosout \\.(name|msg)|/tree \\.data\\..*
/goal \\.data\\.name|/progress \\.data\\.(phase|node|attempt)
/plan/\\w+ \\.data\\.(milliseconds\\..*|message)|/plan/gripper \\.data\\.start\\.joint_[123]
/schedule \\.data\\.(groups\\[-1\\] left out|together)
/result \\.data\\.(message|duration|node|joint|value|limit|hint)"""


def test_every_single_change_of_a_finished_recording_is_found(rig: RigMaker) -> None:
    path = picked(rig())
    records, count, held = records_of(path), 0, []
    for name, changed in single_changes(records):
        count += 1
        if not changed_in(rewritten(path, changed, digests=True)):
            held.append(name)
    assert count > 90
    assert held == []


NOTES = "armtree", "robot", "configuration", "versions", "rosbag2"


@pytest.mark.parametrize("removed", [(), ("configuration", "rosbag2"), NOTES[2:], NOTES])
def test_no_other_note_excuses_that_the_digests_are_missing(
    rig: RigMaker, removed: tuple[str, ...]
) -> None:
    path = picked(rig())
    kept = [one for one in records_of(path) if getattr(one, "name", "") not in removed]
    verification = verify(rewritten(path, kept))
    assert not verification.holds, verification.text()
    assert changed_in(path) == "note digests"


@pytest.mark.parametrize("digests", [True, False])
def test_a_finished_recording_needs_its_digests_and_its_result(
    rig: RigMaker, digests: bool
) -> None:
    path = picked(rig())
    records = records_of(path)
    bare = verify(rewritten(path, records))
    assert (checks(bare), bare.holds, bare.code) == ([True, True], False, "replay.differs")
    assert bare.error == "note digests was changed or removed after the run"
    result = next(each.id for each in records if getattr(each, "topic", "") == "/result")
    kept = [each for each in records if getattr(each, "channel_id", -1) != result]
    unended = verify(rewritten(path, kept, digests))
    assert (checks(unended), unended.code) == ([False, True], "replay.differs")
    assert unended.checks[0].words == "the goal of task 1 has no result"


def test_every_single_change_is_found(tmp_path: Path) -> None:
    path = Path(shutil.copy(EXAMPLE, tmp_path))
    records, unseen, by_digest = records_of(path), [], BY_DIGEST_ALONE.replace("\n", "|")
    for name, changed in single_changes(records):
        if not changed_in(rewritten(path, changed, digests=True)):
            unseen.append(name)
        bare = verify(rewritten(path, changed))
        assert not bare.holds, name
        held = bare.checks and all(check.holds for check in bare.checks)
        if held and not re.fullmatch(by_digest, name):
            unseen.append(f"{name}, without digests")
    assert unseen == []


def decoded(topic: str, type_: str, change: Change, number: int = 1) -> Change:
    """Changes one decoded message of a topic."""

    def tell(record: Any) -> None:
        message = decode(type_, record.data)
        change(message)
        record.data = encode(type_, message)

    return each([topic], tell, number)


def flip_text(frame: Any) -> None:
    frame.text = frame.text.replace("9", "8")


def move_link(transforms: Any) -> None:
    transforms.transforms[1].transform.translation.x += 0.01


def bend(trajectory: Any) -> None:
    point = trajectory.points[3]
    point.positions = tuple(position + 0.01 for position in point.positions)


def get_on(feedback: Any) -> None:
    feedback.percentage += 1


def nudge(state: Any) -> None:
    state.position = (state.position[0] * (1 + 1e-9), *state.position[1:])


def rename(state: Any) -> None:
    state.name[0] = "joint_9"


@pytest.mark.parametrize(
    ("change", "held", "words"),
    [
        (
            decoded("/serial/tx", "arduinobot_msgs/msg/SerialFrame", flip_text, 3),
            [False, True],
            "message 3 on /serial/tx: text is 'b0",
        ),
        (
            decoded("/tf", "tf2_msgs/msg/TFMessage", move_link),
            [False, True],
            "message 1 on /tf: transforms[1].transform.translation.x is ",
        ),
        (
            decoded("/plan/arm/trajectory", "trajectory_msgs/msg/JointTrajectory", bend),
            [True, False],
            "message 1 on /plan/arm/trajectory: points[3].positions[0] is ",
        ),
        (
            decoded("/feedback", "arduinobot_msgs/msg/TaskFeedback", get_on),
            [False, True],
            "message 1 on /feedback: percentage is 1, its record has 0",
        ),
        (
            decoded("/joint_states", "sensor_msgs/msg/JointState", nudge, 5),
            [False, True],
            "frame 5: joint_1 at ",
        ),
        (
            decoded("/joint_states", "sensor_msgs/msg/JointState", rename, 5),
            [False, True],
            "was sent for the joints joint_9, joint_2",
        ),
        (retold("/result", field("state", to="CANCELED")), [False, True], "the result is CANCELED"),
        (
            retold("/result", field("success", to=False)),
            [False, True],
            "success False and the code ok",
        ),
        (
            retold("/result", field("code", to="internal")),
            [False, True],
            "True and the code internal",
        ),
        (retold("/plan/arm", field("group", to="leg")), [False, False], "the group leg is recor"),
        (
            retold("/plan/arm", field("start", to={})),
            [False, False],
            "the recorded start has the joints ",
        ),
        (
            retold("/progress", field("percentage", to=2**70)),
            [False, True],
            "cannot be converted again",
        ),
        (retold("/schedule", field("duration", to=1e8)), [False, False], "s is recorded with 3"),
    ],
)
def test_a_contradiction_is_named(
    rig: RigMaker, change: Change, held: list[bool], words: str
) -> None:
    verification = verify(altered(picked(rig()), change))
    assert checks(verification) == held, verification.text()
    assert words in verification.text()


def test_a_result_that_differs_from_the_tree(rig: RigMaker) -> None:
    def cancel(result: dict[str, Any]) -> None:
        result.update(state="CANCELED", success=False, code="goal.canceled")

    verification = verify(altered(picked(rig()), retold("/result", cancel)))
    assert checks(verification) == [False, True]
    assert "the result is CANCELED, but the tree ended with SUCCESS" in verification.text()


@pytest.mark.parametrize(
    ("topic", "places", "value"),
    [
        ("/plan/arm", ("times",), [0.0]),
        ("/plan/arm", ("positions", 3), [0.0]),
        ("/plan/arm", ("start",), []),
        ("/plan/arm", ("duration",), "long"),
        ("/schedule", ("samples", 3), [0.0]),
        ("/schedule", ("frames",), []),
        ("/serial/timing", ("time",), float("nan")),
        ("/progress", ("goal_id",), "x"),
        ("/result", ("frames",), None),
    ],
)
def test_an_invalid_field_is_refused_with_its_name(
    rig: RigMaker, topic: str, places: tuple[Any, ...], value: Any
) -> None:
    verification = verify(altered(picked(rig()), retold(topic, field(*places, to=value))))
    assert not verification.holds
    assert "is invalid; another program recorded it" in verification.text()


def test_a_wrong_value_of_a_firmware_is_refused(rig: RigMaker) -> None:
    path = picked(rig())
    wrong = [('"ring": 63', new) for new in ('"ring": "6"', '"ring" 63', '"ring": -1')]
    wrong += [('"rate": 10.0', f'"rate": {rate}') for rate in ("1e12", "0", "-1", "NaN")]
    for old, new in wrong:

        def change(record: Any, old: str = old, new: str = new) -> None:
            if type(record).__name__ == "Metadata" and record.name == "robot":
                assert old in record.metadata["firmware"]
                record.metadata["firmware"] = record.metadata["firmware"].replace(old, new)

        verification = verify(altered(path, change))
        assert (checks(verification), verification.code) == ([], "log.unreadable")
        assert "holds an invalid robot" in verification.error


def test_a_change_after_the_run_is_named(rig: RigMaker, tmp_path: Path) -> None:
    path = picked(rig())
    assert verify(path).holds
    log = retold("/plan/arm", field("milliseconds", "ends", to=0.1))
    verification = verify(altered(path, log, digests=True))
    assert checks(verification) == [True, True]
    assert (verification.holds, verification.code) == (False, "replay.differs")
    assert verification.text().endswith("  /plan/arm was changed or removed after the run")
    verification = verify(altered(path, retold("/plan/arm", field("seed", to=2)), digests=True))
    words = "seed: the goal has 1, but the group arm was planned with 2"
    assert verification.checks[1].source == words
    verification = verify(
        altered(path, retold("/plan/arm", field("duration", to=9.0)), digests=True)
    )
    assert verification.checks[1].source == (
        "the recording: /plan/arm was changed or removed after the run"
    )


def test_topics_that_an_older_armtree_did_not_know_are_not_missing(rig: RigMaker) -> None:
    path = picked(rig())
    records = records_of(path)
    gone = {
        r.id for r in records if type(r).__name__ == "Channel" and r.topic in ("/tf", "/rosout")
    }
    new = ("configuration", "rosbag2", DIGESTS)  # notes
    kept = [
        r
        for r in records
        if (r.id if type(r).__name__ == "Channel" else getattr(r, "channel_id", -1)) not in gone
        and not (type(r).__name__ == "Metadata" and r.name in new)
    ]
    compact(rewritten(path, kept))  # it writes digests of what is left
    verification = verify(path)
    assert verification.holds, verification.text()


def test_the_rest_of_a_paused_motion_that_begins_elsewhere_is_found(rig: RigMaker) -> None:
    arm = rig()
    at_frame(arm, 9, pause_for(arm, 2.0))
    moved = retold("/schedule", lambda reported: reported["start"].update(joint_1=0.5), 2)
    verification = verify(altered(picked(arm), moved))
    assert not verification.holds
    assert "joint_1 is not at the start of the motion" in verification.text()
