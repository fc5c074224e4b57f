"""The rosbridge codec: what clients for the original robot send, and what they must get."""

import base64
import json
from typing import Any

import pytest
from hypothesis import given, strategies as st

from executive.api.joint_state import JointState
from executive.server.rosbridge import protocol as ros

GOAL = {
    "op": "send_action_goal",
    "id": "send_action_goal:/task_server:1",
    "action": "/task_server",
    "action_type": "arduinobot_msgs/action/ArduinobotTask",
    "args": {"task_number": 1},
}


def parsed(**fields: Any) -> ros.Message:
    return ros.parse(json.dumps(fields))


def test_a_goal() -> None:
    assert parsed(**GOAL) == ros.SendGoal(str(GOAL["id"]), 1, feedback=False)
    assert parsed(**GOAL, feedback=True) == ros.SendGoal(str(GOAL["id"]), 1, feedback=True)


def test_both_spellings_of_the_type_and_of_the_name() -> None:
    short = {**GOAL, "action_type": "arduinobot_msgs/ArduinobotTask", "action": "task_server"}
    assert parsed(**short) == parsed(**GOAL)


@pytest.mark.parametrize(
    ("arguments", "task"), [({}, 0), ([], 0), (None, 0), ([7], 7), ([7, "x"], 7)]
)
def test_arguments_as_rosbridge_reads_them(arguments: object, task: int) -> None:
    assert getattr(parsed(**{**GOAL, "args": arguments}), "task", None) == task
    without = {key: value for key, value in GOAL.items() if key != "args"}
    assert getattr(parsed(**without), "task", None) == 0


@pytest.mark.parametrize("number", ["9" * 5000, "-" + "9" * 60_000, "NaN", "1e999"])
def test_a_goal_with_an_impossible_number_is_answered_by_its_id(number: str) -> None:
    text = json.dumps({**GOAL, "args": {"task_number": "NUMBER"}}).replace('"NUMBER"', number)
    with pytest.raises(ros.BadGoal) as caught:
        ros.parse(text)
    assert caught.value.identity == GOAL["id"]
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"action": "/other"}, "no action"),
        ({"action_type": "arduinobot_msgs/action/Other"}, "is of type"),
        ({"args": "1"}, "task_number: N"),
        ({"args": 1}, "task_number: N"),
        ({"args": [{}]}, "int32"),
        ({"args": {"task_number": 1, "speed": 2}}, "task_number: N"),
        ({"args": {"task_number": True}}, "int32"),
        ({"args": {"task_number": 1.0}}, "int32"),
        ({"args": {"task_number": "1"}}, "int32"),
        ({"args": {"task_number": 2**31}}, "int32"),
        ({"feedback": 1}, "true or false"),
        ({"compression": "png"}, "compression"),
        ({"fragment_size": 100}, "fragments"),
    ],
)
def test_an_invalid_goal_can_be_answered_by_its_id(wrong: dict[str, Any], why: str) -> None:
    with pytest.raises(ros.BadGoal, match=why) as caught:
        parsed(**{**GOAL, **wrong})
    assert caught.value.identity == GOAL["id"]


@pytest.mark.parametrize(
    "text",
    ["", "[]", "1", "{}", '{"op": 1}', '{"op": ["a"]}', '{"op": "fragment"}', '{"op": "png"}',
     '{"op": "cancel_action_goal", "action": "/task_server"}',
     '{"op": "cancel_action_goal", "action": "/other", "id": "1"}',
     '{"op": "subscribe", "topic": "/other"}', '{"op": "subscribe"}',
     '{"op": "subscribe", "topic": "/joint_states", "type": "std_msgs/String"}',
     '{"op": "subscribe", "topic": "/joint_states", "throttle_rate": -1}',
     '{"op": "call_service", "service": "/x", "args": [1]}', '{"op": "call_service"}',
     '{"op": "publish", "id": 7}', '{"op": "subscribe", "op": "publish"}'],
)  # fmt: skip
def test_anything_else_is_an_error_status(text: str) -> None:
    with pytest.raises(ros.BadMessage) as caught:
        ros.parse(text)
    assert not isinstance(caught.value, ros.BadGoal)
    assert json.loads(ros.error_status(caught.value))["op"] == "status"


@given(
    st.dictionaries(
        st.sampled_from([*GOAL, "service", "topic", "type", "throttle_rate", "feedback"]),
        st.none() | st.integers() | st.text("a/", max_size=3) | st.booleans()
        | st.lists(st.integers())
        | st.sampled_from(["send_action_goal", "cancel_action_goal", "call_service", "subscribe",
                           "unsubscribe", "/task_server", "/joint_states"])
        | st.dictionaries(st.sampled_from(["task_number", "goal_info"]), st.integers()),
    )
)  # fmt: skip
def test_no_message_raises_anything_else(message: dict[str, Any]) -> None:
    try:
        ros.parse(json.dumps(message))
    except ros.BadMessage:
        return


def test_messages_that_need_no_answer_are_ignored() -> None:
    for operation in ("advertise", "unadvertise", "publish", "set_level"):
        assert parsed(op=operation, topic="/x") is None


def test_a_result() -> None:
    reported = json.loads(ros.result("7", 6, success=False))
    assert reported == {
        "op": "action_result",
        "id": "7",
        "action": "/task_server",
        "values": {"success": False},
        "status": 6,
        "result": True,  # false would make roslibpy call it an error and lose the status
    }


def test_a_refusal() -> None:
    reported = json.loads(ros.refusal("7", "no task 9"))
    assert (reported["result"], reported["status"], reported["values"]) == (False, 0, "no task 9")


def test_topics() -> None:
    assert parsed(op="subscribe", topic="joint_states", type="sensor_msgs/JointState") == (
        ros.Subscribe("/joint_states", 0.0)
    )
    throttled = parsed(op="subscribe", topic=ros.STATUS, throttle_rate=250)
    assert throttled == ros.Subscribe(ros.STATUS, 0.25)
    assert parsed(op="unsubscribe", topic="/joint_states") == ros.Unsubscribe("/joint_states")
    named = parsed(op="subscribe", topic=ros.STATUS, id="a")
    assert named == ros.Subscribe(ros.STATUS, 0.0, "a")
    named = parsed(op="unsubscribe", topic=ros.STATUS, id="a")
    assert named == ros.Unsubscribe(ros.STATUS, "a")


@given(st.binary(min_size=16, max_size=16), st.integers(0, 2**60), st.booleans())
def test_a_cancel_by_service_takes_ids_of_the_status_topic(
    identity: bytes, stamp_ns: int, as_list: bool
) -> None:
    reported = json.loads(ros.status_array([ros.goal_status(identity.hex(), stamp_ns, 2)]))
    info = reported["msg"]["status_list"][0]["goal_info"]
    if as_list:
        info["goal_id"]["uuid"] = list(base64.b64decode(info["goal_id"]["uuid"]))
    wanted = identity.hex() if any(identity) else ""
    assert ros.cancel_request(cancel({"goal_info": info})) == (wanted, stamp_ns)


def cancel(arguments: dict[str, Any]) -> ros.CallService:
    return ros.CallService("1", ros.CANCEL_SERVICE, arguments)


def test_an_empty_cancel_is_for_all_goals() -> None:
    assert ros.cancel_request(cancel({})) == ("", 0)  # what roslib.js sends for cancelAllGoals


@pytest.mark.parametrize(
    "arguments",
    [
        {"goal_info": 1},
        {"goal_info": {"goal_id": 3}},
        {"goal_info": {"goal_id": {"uuid": "!"}}},
        {"goal_info": {"goal_id": {"uuid": [1]}}},
        {"goal_info": {"goal_id": {"uuid": [999] * 16}}},
        {"goal_info": {"stamp": {"sec": "1"}}},
    ],
)
def test_an_invalid_cancel_is_refused(arguments: dict[str, Any]) -> None:
    with pytest.raises(ros.BadCall) as caught:
        ros.cancel_request(cancel(arguments))
    assert caught.value.call == cancel(arguments)


@pytest.mark.parametrize("wrong", ['"x": NaN', '"x": 1, "x": 1', '"x": 1e999'])
def test_invalid_json_is_answered_with_its_id(wrong: str) -> None:
    with pytest.raises(ros.BadGoal) as goal:
        ros.parse(f'{{"op": "send_action_goal", "id": "7", {wrong}}}')
    assert goal.value.identity == "7"
    with pytest.raises(ros.BadCall) as call:
        ros.parse(f'{{"op": "call_service", "id": "7", "service": "a", {wrong}}}')
    assert call.value.call == ros.CallService("7", "/a", {})
    with pytest.raises(ros.BadMessage, match="invalid JSON"):
        ros.parse(f'{{"op": "call_service", "id": 7, {wrong}}}')


def test_an_error_is_short() -> None:
    with pytest.raises(ros.BadGoal) as caught:
        parsed(**{**GOAL, "action": "x" * 60_000})
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(("measured", "name"), [(True, "measured"), (False, "commanded")])
def test_joint_states_say_whether_they_are_measured(measured: bool, name: str) -> None:
    state = JointState(measured, {"a": 0.5}, {"a": 0.1})
    message = ros.joint_state(0, state)
    assert message["header"]["frame_id"] == name
    assert [message[each] for each in ("name", "position", "velocity", "effort")] == [
        ["a"], [0.5], [0.1], []
    ]  # fmt: skip
