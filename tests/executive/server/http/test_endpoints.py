"""The endpoints of the HTTP interface, over a real socket."""

import gzip
import http.client
import json
import threading
from typing import Any

import pytest

import logs
from executive.api import Policy
from executive.api.operations import OPERATIONS
from executive.api.outcome import Acceptance, GoalStatus
from executive.server.http import endpoints as api
from hardware import State
from logs.writing import recorder
from skills.leaves.wait import Wait
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

UNKNOWN_ID = "0123456789abcdef" * 2


def send(served: Served, task: int | str, **body: Any) -> str:
    status, reported = served.ask("POST", "/api/goals", {"task": task, **body})
    assert status == 201, reported
    return str(reported["goal_id"])


def test_a_goal_from_its_start_to_its_result(serve: Serve) -> None:
    served = serve()
    goal = send(served, 11)
    status, result = served.ask("GET", f"/api/goals/{goal}/result")
    assert (status, result["state"], result["code"]) == (200, "SUCCEEDED", "ok")
    assert result["goal_id"] == goal
    # also later, and in lists
    assert served.ask("GET", f"/api/goals/{goal}/result?timeout=0")[1] == result
    assert served.ask("GET", f"/api/goals/{goal}")[1]["result"] == result
    assert [each["goal_id"] for each in served.ask("GET", "/api/goals")[1]["goals"]] == [goal]


def test_a_task_by_its_name(serve: Serve) -> None:
    served = serve()
    goal = send(served, "nothing")
    result = served.ask("GET", f"/api/goals/{goal}/result")[1]
    assert (result["task"], result["code"]) == (11, "ok")
    status, error = served.ask("POST", "/api/goals", {"task": "nothin"})
    assert (status, error["code"]) == (404, "goal.unknown_task")
    assert "did you mean nothing?" in error["message"]
    for wrong in ("", "1", "-1", None, True, [1]):
        status, error = served.ask("POST", "/api/goals", {"task": wrong})
        words = "task must be the number or the name of a task"
        assert (status, error["message"]) == (422, words)


def test_a_goal_that_moves_the_arm_reports_progress(serve: Serve) -> None:
    served = serve()
    moves = threading.Event()

    def watch(event: object) -> None:
        if isinstance(event, logs.Feedback) and event.percentage:
            moves.set()

    served.executive.subscribe(watch)
    goal = send(served, 1)
    assert moves.wait(30)
    status, error = served.ask("GET", f"/api/goals/{goal}/result?timeout=0.1")
    assert (status, error["code"]) == (409, "goal.result_timeout")
    now = served.ask("GET", "/api/status")[1]
    assert now["goal"]["goal_id"] == goal
    assert (now["arm"], now["phase"]) == ("active", "executing")
    assert 0 < now["percentage"] < 100
    assert served.ask("POST", f"/api/goals/{goal}/cancel")[1] == {"return_code": 0, "goals": [goal]}
    assert served.ask("GET", f"/api/goals/{goal}/result")[1]["state"] == "CANCELED"
    assert served.ask("POST", f"/api/goals/{goal}/cancel")[1]["return_code"] == 3
    assert served.ask("POST", f"/api/goals/{UNKNOWN_ID}/cancel")[1]["return_code"] == 2
    assert served.ask("POST", "/api/stop")[1] == {"return_code": 0, "goals": []}


def test_cancel_by_time_and_all(serve: Serve) -> None:
    served = serve(Policy.QUEUE)
    goals = [send(served, 10) for _ in range(3)]
    stamps = {g["goal_id"]: g["stamp_ns"] for g in served.ask("GET", "/api/goals")[1]["goals"]}
    reported = served.ask("POST", "/api/cancel", {"stamp_ns": stamps[goals[1]]})[1]
    assert reported == {"return_code": 0, "goals": goals[:2]}
    assert served.ask("POST", "/api/cancel", {})[1] == {"return_code": 0, "goals": goals[2:]}


def test_goal_ids_chosen_by_clients(serve: Serve) -> None:
    served = serve()
    assert send(served, 11, goal_id=UNKNOWN_ID) == UNKNOWN_ID
    status, error = served.ask("POST", "/api/goals", {"task": 11, "goal_id": UNKNOWN_ID})
    assert (status, error["code"]) == (409, "goal.duplicate")
    for wrong in ("", "x", UNKNOWN_ID.upper(), UNKNOWN_ID + "0"):
        status, error = served.ask("POST", "/api/goals", {"task": 11, "goal_id": wrong})
        words = "goal_id must be 32 lower-case hexadecimal digits"
        assert (status, error["message"]) == (422, words)


def test_a_second_goal_is_refused_by_the_policy(serve: Serve) -> None:
    served = serve()
    send(served, 10)
    status, error = served.ask("POST", "/api/goals", {"task": 11})
    assert (status, error["code"]) == (409, "goal.busy")
    names = "code message node joint value limit hint place argument"
    assert error.keys() == {*names.split()}


def test_a_full_queue_refuses_goals(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.goals.queue.WAITING", 3)
    served = serve(Policy.QUEUE)
    send(served, 10)
    answers = [served.ask("POST", "/api/goals", {"task": 11}) for _ in range(9)]
    assert {(status, reported.get("code")) for status, reported in answers[5:]} == {
        (429, "goal.queue_full")
    }
    assert served.ask("POST", "/api/stop")[1]["return_code"] == 0


def test_arguments_are_checked(serve: Serve) -> None:
    served = serve()

    def result(**arguments: object) -> dict[str, Any]:
        goal = send(served, 12, arguments=arguments)
        found: dict[str, Any] = served.ask("GET", f"/api/goals/{goal}/result")[1]
        return found

    assert result(what="hello", often=2)["success"]
    assert result(often="3")["success"]
    for arguments in ({"often": 4}, {"other": 1}, {"what": [1, {"a": None}]}):
        body = {"task": 12, "arguments": arguments}
        status, error = served.ask("POST", "/api/goals", body)
        assert (status, error["code"]) == (409, "goal.bad_arguments")
        assert next(iter(arguments)) in error["message"]
        assert error["hint"]


def test_a_number_is_an_integer_however_it_is_written(serve: Serve) -> None:
    served = serve()
    goal = served.ask("POST", "/api/goals", b'{"task": 11.0}')[1]["goal_id"]
    result = served.ask("GET", f"/api/goals/{goal}/result")[1]
    assert (repr(result["task"]), result["recording"][-8:]) == ("11", "-11.mcap")


def test_a_late_subscriber_receives_nothing_of_ended_goals(serve: Serve) -> None:
    served = serve()
    with served.client() as client, client.events("goal", "status") as early:
        client.run(11)
        assert any(isinstance(event, GoalStatus) and event.outcome for event in early)
        with client.events() as late:
            goal = client.send(10)
            first = next(e for e in late if not isinstance(e, logs.Transition | logs.LogLine))
            assert isinstance(first, GoalStatus)
            assert first.identity == goal
            client.cancel(goal)


@pytest.mark.parametrize("kinds", ["nonsense", "result", "goal,nonsense"])
def test_unknown_kinds_of_events_are_refused(serve: Serve, kinds: str) -> None:
    status, error = serve().ask("GET", f"/api/events?events={kinds}")
    assert (status, error["code"]) == (422, "request.malformed")
    assert "goal, " in error["message"]


def test_a_failure_keeps_its_cause(serve: Serve) -> None:
    served = serve(active=False)
    goal = send(served, 1)
    result = served.ask("GET", f"/api/goals/{goal}/result")[1]
    assert (result["state"], result["code"]) == ("ABORTED", "hw.not_active")
    assert result["cause"]["hint"]
    status, error = served.ask("POST", "/api/goals", {"task": 99})
    assert (status, error["code"]) == (404, "goal.unknown_task")
    assert error["hint"]


def test_the_lifecycle(serve: Serve) -> None:
    served = serve(active=False)
    assert served.ask("POST", "/api/arm/activate")[1] == {"arm": "active"}
    status, error = served.ask("POST", "/api/arm/activate")
    assert (status, error["code"]) == (409, "hw.transition_refused")
    for transition, state in [
        ("deactivate", "inactive"),
        ("cleanup", "unconfigured"),
        ("configure", "inactive"),
        ("shutdown", "finalized"),
    ]:
        assert served.ask("POST", f"/api/arm/{transition}")[1] == {"arm": state}
    assert served.ask("POST", "/api/arm/explode")[0] == 422
    assert served.executive.status().arm is State.FINALIZED


def test_an_activation_that_was_sent_before_a_stop_is_refused_after_it(serve: Serve) -> None:
    served = serve(active=False)
    known = served.ask("GET", "/api/status")[1]["stops"]
    served.executive.cancel()
    status, error = served.ask("POST", "/api/arm/activate", {"stops": known})
    assert (status, error["code"]) == (409, "goal.sent_before_stop")
    assert served.executive.status().arm is State.INACTIVE
    assert served.ask("POST", "/api/arm/activate", {"stops": known + 1})[1] == {"arm": "active"}


def test_pause_and_resume(serve: Serve) -> None:
    served = serve()
    goal = send(served, 1)
    while served.ask("GET", f"/api/goals/{goal}")[1]["state"] == "ACCEPTED":
        pass
    assert served.ask("POST", f"/api/goals/{goal}/pause")[0] == 200
    assert served.ask("GET", "/api/status")[1]["paused"]
    assert served.ask("POST", f"/api/goals/{goal}/resume")[0] == 200
    status, error = served.ask("POST", f"/api/goals/{goal}/resume")
    assert (status, error["code"]) == (409, "goal.not_paused")
    assert served.ask("GET", f"/api/goals/{goal}/result")[1]["success"]
    assert served.ask("POST", f"/api/goals/{UNKNOWN_ID}/pause")[0] == 404


def test_a_breakpoint_and_a_step(serve: Serve) -> None:
    served = serve()
    with served.client() as client, client.events("feedback") as events:
        assert client.break_at("nothing") == ("nothing",)
        goal = client.send(11)
        assert any(event.phase == "paused" for event in events)  # type: ignore[union-attr]
        assert client.status().paused
        client.step(goal)
        assert client.result(goal, 5.0).success
        assert client.break_at("nothing", on=False) == ()


def test_events_reach_several_and_late_subscribers(serve: Serve) -> None:
    served = serve()
    with (
        served.client() as client,
        client.events() as everything,
        client.events("goal", "status") as few,
    ):
        goal = send(served, 10)
        assert next(e for e in few if getattr(e, "goal_id", "") == goal)
        assert any(isinstance(next(everything), GoalStatus) for _ in range(5))
        with client.events("node") as late:
            assert isinstance(next(late), logs.NodeStatus)
        served.ask("POST", "/api/stop")
        states: list[str] = []
        while states[-1:] != ["CANCELED"]:
            event = next(few)
            assert isinstance(event, GoalStatus)
            states.append(event.state.name)
        assert states[-2:] == ["CANCELING", "CANCELED"]


def test_a_request_that_waits_for_the_code_of_a_skill_does_not_disturb_the_end_of_the_server(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    stuck, leave = threading.Event(), threading.Event()

    def validate(robot: object, inputs: object) -> None:
        stuck.set()
        leave.wait(3)  # the server waits for it

    served = serve()
    monkeypatch.setattr(Wait, "validate", validate)

    def send_and_lose() -> None:
        with pytest.raises((OSError, http.client.HTTPException)):
            send(served, 10)

    client = threading.Thread(target=send_and_lose)
    client.start()
    assert stuck.wait(30)
    served.stop()
    client.join(30)
    leave.set()
    assert not [each for each in caplog.records if each.levelname == "ERROR"]


def test_metrics_are_valid_for_prometheus(serve: Serve) -> None:
    from prometheus_client.parser import text_string_to_metric_families

    served = serve()
    goal = send(served, 0)
    served.ask("GET", f"/api/goals/{goal}/result")
    status, text = served.ask("GET", "/metrics")
    assert status == 200
    families = {f.name: f for f in text_string_to_metric_families(text.decode())}
    states = {s.labels["state"]: s.value for s in families["armtree_arm_state"].samples}
    assert states["active"] == 1
    assert sum(states.values()) == 1
    (ended,) = [s for s in families["armtree_goals"].samples if s.name.endswith("_total")]
    assert (ended.labels, ended.value) == ({"state": "SUCCEEDED", "code": "ok"}, 1)
    (frames,) = [s for s in families["armtree_frames"].samples if s.name.endswith("_total")]
    assert frames.value == served.ask("GET", f"/api/goals/{goal}")[1]["result"]["frames"]
    joints = {s.labels["joint"] for s in families["armtree_commanded_radians"].samples}
    assert joints == {"joint_1", "joint_2", "joint_3", "joint_4"}


def test_invalid_tasks_are_listed_with_their_error(serve: Serve) -> None:
    served = serve()
    (served.tasks / "20_wrong.yaml").write_text("task: 20\nname: [")
    rows = {row["task"]: row for row in served.ask("GET", "/api/tasks")[1]["tasks"]}
    assert rows[12]["parameters"] == {"what": "text", "often": "number"}
    often = {"needed": False, "default": "1", "least": 1, "most": 3, "description": "how often"}
    assert often.items() <= rows[12]["inputs"]["often"].items()
    assert rows[0]["source"] == "shipped"
    assert "20_wrong.yaml" in rows[20]["wrong"]


def test_every_operation_is_answered_and_described(serve: Serve) -> None:
    served = serve()
    document = served.ask("GET", "/openapi.json")[1]
    paths = {(path, verb) for path, verbs in document["paths"].items() for verb in verbs}
    assert paths == {(each.path, each.method.lower()) for each in OPERATIONS.values()}
    assert document["openapi"] == "3.1.0"
    assert json.dumps(document)


def test_a_long_answer_is_compressed_for_clients_that_take_it(serve: Serve) -> None:
    served = serve()
    answers = {}
    for encoding in ("identity", "gzip"):
        connection = http.client.HTTPConnection("127.0.0.1", served.server.port)
        connection.request("GET", "/api/robot", headers={"accept-encoding": encoding})
        response = connection.getresponse()
        answers[response.getheader("content-encoding")] = response.read()
        connection.close()
    assert len(answers["gzip"]) < len(answers[None]) / 2
    assert gzip.decompress(answers["gzip"]) == answers[None]


def test_a_held_goal_is_canceled_when_its_hold_ends(serve: Serve) -> None:
    served = serve()
    status, error = served.ask("POST", "/api/goals", {"task": 10, "deadman": True})
    assert (status, error["code"]) == (409, "goal.not_held")
    with served.client() as client:
        with client.events() as events, client.hold(UNKNOWN_ID):
            client.send(10, goal_id=UNKNOWN_ID, deadman=True)
            reported = (event for event in events if isinstance(event, GoalStatus))
            states = [next(reported).state.name for _ in range(2)]
            assert states == ["ACCEPTED", "EXECUTING"]
        assert client.result(UNKNOWN_ID, 5.0).state.name == "CANCELED"
        assert client.run(11, deadman=True).success


def test_a_hold_that_ends_while_its_goal_is_sent(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve()
    reached, let_go, accept = threading.Event(), threading.Event(), served.executive.send

    def late(*goal: Any, **more: Any) -> Acceptance:
        reached.set()
        assert let_go.wait(10)
        return accept(*goal, **more)

    monkeypatch.setattr(served.executive, "send", late)
    with served.client() as client:
        body = {"task": 10, "goal_id": UNKNOWN_ID, "deadman": True}
        sending = threading.Thread(target=served.ask, args=("POST", "/api/goals", body))
        with client.hold(UNKNOWN_ID):
            sending.start()
            assert reached.wait(10)
        let_go.set()
        sending.join()
        assert client.result(UNKNOWN_ID, 5.0).state.name == "CANCELED"


def test_a_goal_continues_when_its_client_leaves(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        goal = client.send(10)
    assert served.ask("GET", f"/api/goals/{goal}")[1]["result"] is None


def test_many_clients_wait_for_one_result(serve: Serve) -> None:
    served = serve()
    goal = send(served, 10)
    found: list[str] = []

    def wait() -> None:
        found.append(served.ask("GET", f"/api/goals/{goal}/result")[1]["state"])

    waiting = [threading.Thread(target=wait) for _ in range(5)]
    for each in waiting:
        each.start()
    served.ask("POST", "/api/stop")
    for each in waiting:
        each.join(10)
    assert found == ["CANCELED"] * 5


def test_a_waiting_client_gets_a_result_that_is_not_kept(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits, wait_for = threading.Event(), api._before_leaving

    async def noted(*asked: Any) -> bool:
        waits.set()
        return await wait_for(*asked)

    monkeypatch.setattr(api, "_before_leaving", noted)
    served = serve()
    served.executive._queue.keep = 0.0
    goal = send(served, 10)
    found: list[tuple[int, Any]] = []

    def wait() -> None:
        found.append(served.ask("GET", f"/api/goals/{goal}/result"))

    waiting = threading.Thread(target=wait)
    waiting.start()
    assert waits.wait(10)
    served.ask("POST", "/api/stop")
    waiting.join(10)
    ((status, result),) = found
    assert (status, result["state"]) == (200, "CANCELED")
    assert served.ask("GET", f"/api/goals/{goal}/result")[0] == 404


def test_a_goal_is_answered_after_it_is_recorded(serve: Serve) -> None:
    served = serve()
    held, answered = threading.Event(), list[str]()
    recorder._queue("recorder").put(held.wait)
    asking = threading.Thread(target=lambda: answered.append(send(served, 10)))
    asking.start()
    while not served.executive.goals():
        asking.join(0.01)
    asking.join(0.1)
    assert answered == []
    held.set()
    asking.join(10)
    (path,) = (served.folder / "recordings").glob("*-server.mcap")
    reported = next(logs.read(path, ["/goal"])).fields()  # it is still being written
    assert answered == [reported["goal_id"]]


def test_subscribers_are_limited(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "MAX_SUBSCRIBERS", 1)
    served = serve()
    with served.client() as client, client.events():
        status, error = served.ask("GET", "/api/events")
        assert (status, error["code"]) == (429, "request.too_many")
