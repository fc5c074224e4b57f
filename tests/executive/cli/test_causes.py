"""A failure has the same cause in the terminal, in JSON, in the log and on the network."""

import json
import logging
import threading
from typing import Any

import pytest

import logs
from armtree import Client, ServerUnreachable
from tests.support.servers.serving import Served, Typed

pytest_plugins = ["tests.support.servers.server_fixtures"]

FAR = """\
task: 15
name: far
description: Further than the arm goes.
tree:
  subtree: reach
  with: {arm: {joint_1: 9, joint_2: 0, joint_3: 0}, gripper: {joint_4: 0, joint_5: 0}}
"""


def test_a_failure_is_reported_the_same_everywhere(
    typed: tuple[Served, Typed], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    served, type_in = typed
    served.executive.arm_to("activate")
    (served.tasks / "15_far.yaml").write_text(FAR)
    goal = type_in("send", "15")[1].strip()
    cause = served.ask("GET", f"/api/goals/{goal}/result")[1]["cause"]
    assert [cause[key] for key in ("code", "node", "joint", "value", "limit", "hint", "place")] == [
        *("goal.out_of_bounds", "far/CheckBounds", "joint_1", 9.0),
        *(pytest.approx(1.5707963), "choose a target within the limits"),
        "reach.yaml:11, used by 15_far.yaml:5",
    ]
    assert cause["argument"] == ""
    reported = type_in("send", "15", "--wait", "--json")[1].splitlines()
    assert json.loads(reported[-1])["cause"] == cause
    words = f"{cause['message']} [goal.out_of_bounds at far/CheckBounds]"
    assert "joint_1 = 515.66 deg is outside its limits" in words
    hint = "choose a target within the limits"
    assert f": {words}\n  -> {hint}\n" in type_in("send", "15", "--wait")[1]
    logged = [record.message for record in caplog.records]
    said = f"The goal for task 15 ({goal}) ended ABORTED: {words} -> {hint}"
    assert said in logged


TURN = """\
task: 16
name: turn
description: Turn joints.
parameters:
  near: {type: duration, default: 10 ms}
  to: {type: positions}
tree:
  sequence:
    - Wait: {duration: $near}
    - subtree: move_joints
      with: {joints: $to}
"""


def test_a_failure_names_the_argument_that_is_wrong(typed: tuple[Served, Typed]) -> None:
    served, _ = typed
    served.executive.arm_to("activate")
    (served.tasks / "16_turn.yaml").write_text(TURN)

    def cause(**arguments: str) -> Any:
        status, answer = served.ask("POST", "/api/goals", {"task": 16, "arguments": arguments})
        if status == 201:
            answer = served.ask("GET", f"/api/goals/{answer['goal_id']}/result")[1]["cause"]
        return answer["code"], answer["argument"], answer["joint"]

    assert cause(to="{joint_2: 0.1, joint_1: 9}") == ("goal.out_of_bounds", "to", "joint_1")
    assert cause(to="{joint_1: 1}", near="2 kg") == ("goal.bad_arguments", "near", "")
    assert cause(to="{joint_1: ") == ("goal.bad_arguments", "to", "")
    assert cause(near="1 s") == ("goal.bad_arguments", "to", "")
    assert cause(to="{joint_1: 1}", far="1") == ("goal.bad_arguments", "far", "")


def test_the_help_names_the_default(typed: tuple[Served, Typed]) -> None:
    words = " ".join(typed[1]("serve", "--help")[1].split())
    assert "[default: 900.0]" in words
    assert "None" not in words


def test_what_is_refused_has_its_code(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    type_in("send", "10")
    assert "is under way [goal.busy]\n  -> wait, or cancel" in type_in("send", "11")[2]
    words = "; legal: deactivate, shutdown [hw.transition_refused]\n"
    assert words in type_in("arm", "cleanup")[2]


def test_a_refused_goal_is_reported_with_its_hint(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")
    cause = served.ask("POST", "/api/goals", {"task": 9999})[1]
    assert (cause["code"], bool(cause["hint"])) == ("goal.unknown_task", True)
    said = f"Error: {cause['message']} [goal.unknown_task]\n  -> {cause['hint']}\n"
    for words in (("send", "9999"), ("send", "9999", "--wait")):
        assert type_in(*words) == (4, "", said)
    status, out, _ = type_in("send", "9999", "--wait", "--json")
    reported = json.loads(out.splitlines()[-1])
    wanted = {"event": "result", "task": 9999, "state": "ABORTED", "success": False}
    assert (status, reported) == (4, reported | wanted | {"code": cause["code"], "cause": cause})


def test_an_error_is_reported_in_json_too(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    served.executive.arm_to("activate")

    def reported(*words: str) -> tuple[int, str, str]:
        status, out, error = type_in(*words, "--json")
        (event,) = map(json.loads, out.splitlines())
        assert (event["event"], event["cause"]["message"]) == ("error", event["message"])
        assert event["message"] in error
        return status, event["code"], event["cause"]["code"]

    assert reported("send", "9999") == (4, *["goal.unknown_task"] * 2)
    assert reported("send", "11", "--wait", "--set", "x") == (4, *["goal.bad_arguments"] * 2)
    served.stop()
    for words in (("status",), ("watch",), ("cancel",), ("send", "1", "--wait")):
        assert reported(*words) == (13, *["server.unreachable"] * 2)


@pytest.mark.parametrize("url", ["localhost:1", "127.0.0.1", "ftp://localhost"])
def test_an_address_that_is_no_url_is_a_mistake_of_usage(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch, url: str
) -> None:
    _, type_in = typed
    wanted = f"{url!r} is not the URL of a server, such as http://arm:8765"
    ways = "; see armtree status --help [usage]\n"
    given = type_in("status", "--server", url)
    assert given == (2, "", f"Error: --server: {wanted}{ways}")
    monkeypatch.setenv("ARMTREE_SERVER", url)
    assert type_in("status") == (2, "", f"Error: ARMTREE_SERVER: {wanted}{ways}")
    with pytest.raises(ServerUnreachable, match=r"[^.]\. Start one with armtree serve"):
        Client(url).status()


@pytest.mark.parametrize("command", ["cancel", "pause"])
def test_a_recording_is_not_a_goal(typed: tuple[Served, Typed], command: str) -> None:
    words = f"'latest' names a recording, not a goal; for the running goal, type `armtree {command}"
    assert words in typed[1](command, "latest")[2]


def test_the_ways_to_a_server_elsewhere_are_named(
    typed: tuple[Served, Typed], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, type_in = typed
    monkeypatch.setenv("ARMTREE_TOKEN", "x")
    assert "; set ARMTREE_TOKEN, " in type_in("send", "11")[2]
    monkeypatch.setenv("ARMTREE_SERVER", "http://127.0.0.1:1")
    assert "--server URL or ARMTREE_SERVER" in type_in("status")[2]


def test_a_lost_port_is_named_until_the_arm_is_active_again(typed: tuple[Served, Typed]) -> None:
    served, type_in = typed
    assert "Fault" not in type_in("status")[1]
    served.executive.arm_to("activate")
    lost = threading.Event()

    def watch(event: object) -> None:
        if isinstance(event, logs.Transition) and event.goal == "unconfigured":
            lost.set()

    served.executive.subscribe(watch)
    served.link.unplug()
    assert lost.wait(30)
    fault = json.loads(type_in("status", "--json")[1])["fault"]
    assert (fault["code"], "board is gone" in fault["message"]) == ("hw.port_lost", True)
    said = f"Fault     {fault['message']} [hw.port_lost]\n          -> check the cable, then "
    assert said in type_in("status")[1]
    assert type_in("arm", "configure")[1] == "inactive\n"
    assert said in type_in("status")[1]
    assert type_in("arm", "activate")[1] == "active\n"
    assert "Fault" not in type_in("status")[1]
