"""rosbridge: unchanged clients of the original robot, and raw connections."""

import asyncio
import base64
import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Collection
from contextlib import AbstractContextManager, suppress
from typing import Any

import pytest
from starlette.websockets import WebSocket
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.frames import Frame, Opcode
from websockets.sync.client import ClientConnection, connect

from executive.goals import queue as goals
from executive.server import server
from executive.server.limits import connections, fair_queue
from executive.server.rosbridge import bridge, protocol as ros
from tests.support.paths import PEERS
from tests.support.servers.foreign_clients import UPGRADE, answer, raw
from tests.support.servers.javascript import without_node
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

NODE = ["node", "with_roslib.mjs"]
WITHOUT = without_node("roslib")
CLIENTS = [
    pytest.param([sys.executable, "with_roslibpy.py"], id="roslibpy"),
    pytest.param(NODE, id="roslib.js", marks=pytest.mark.skipif(WITHOUT != "", reason=WITHOUT)),
]


@pytest.mark.parametrize("client", CLIENTS)
def test_foreign_clients(serve: Serve, client: list[str]) -> None:
    served = serve(rosbridge=True)
    command = [*client, str(served.server.port)]
    ran = subprocess.run(
        command, cwd=PEERS, capture_output=True, text=True, timeout=60, check=False
    )
    assert ran.returncode == 0, ran.stderr
    reported = json.loads(ran.stdout)
    moved = reported["moved"]
    assert moved["end"] == {"kind": "result", "status": 4, "values": {"success": True}}
    assert moved["feedback"] == sorted(set(moved["feedback"]))
    assert moved["feedback"][0] == 0
    assert moved["feedback"][-1] == 100
    assert len(moved["feedback"]) > 10
    assert reported["busy"]["end"]["kind"] == "error"
    assert "goal.busy" in reported["busy"]["end"]["values"]
    assert reported["other"]["end"]["kind"] == "error"
    for name, status in (("failed", 6), ("canceled", 5), ("stopped", 5)):
        end = reported[name]["end"]
        if client is NODE:  # it reports all but SUCCEEDED as an error text
            assert end["kind"] == "error"
            assert '{"success":false}' in end["values"]
        else:
            assert end == {"kind": "result", "status": status, "values": {"success": False}}
    assert reported["many"] == [{"success": True}] * 50
    joints = reported["joints"]
    assert joints["name"] == [joint.name for joint in served.robot.joints]
    assert len(joints["position"]) == len(joints["name"])
    assert joints["header"]["stamp"]["sec"] > 1_600_000_000
    assert joints["header"]["frame_id"] == "commanded"
    statuses = [each["status"] for each in reported["status"]["status_list"]]
    assert statuses == [4, 6, 5, 5] + [4] * 50
    uuid = reported["status"]["status_list"][0]["goal_info"]["goal_id"]["uuid"]
    assert base64.b64decode(uuid).hex() == served.executive.goals()[0].identity


def websocket(served: Served, **headers: str) -> AbstractContextManager[ClientConnection]:
    url = f"ws://127.0.0.1:{served.server.port}/"
    return connect(url, additional_headers=headers, compression=None, open_timeout=10)


def say(connection: ClientConnection, **message: Any) -> None:
    connection.send(json.dumps(message))


def heard(connection: ClientConnection, operation: str) -> dict[str, Any]:
    while True:
        message: dict[str, Any] = json.loads(connection.recv(10))
        if message["op"] == operation:
            return message


def statuses(connection: ClientConnection) -> list[int]:
    """The next message of the status topic."""
    return [goal["status"] for goal in heard(connection, "publish")["msg"]["status_list"]]


def statuses_until_error(connection: ClientConnection) -> list[list[int]]:
    """All messages of the status topic until the answer to an invalid message."""
    reported: list[list[int]] = []
    while (message := json.loads(connection.recv(10)))["op"] == "publish":
        reported.append([goal["status"] for goal in message["msg"]["status_list"]])
    return reported


GOAL = {
    "op": "send_action_goal",
    "action": "/task_server",
    "action_type": "arduinobot_msgs/action/ArduinobotTask",
}


def test_it_is_off_by_default(serve: Serve) -> None:
    with pytest.raises(InvalidStatus), websocket(serve()):
        pass


def test_a_websocket_may_be_silent(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.1)
    with websocket(serve(rosbridge=True)) as client:
        with pytest.raises(TimeoutError):
            client.recv(0.3)
        say(client, **GOAL, id="a", args={"task_number": 11})
        assert heard(client, "action_result")["values"] == {"success": True}


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1"])
def test_a_foreign_page_is_refused(serve: Serve, origin: str) -> None:
    served = serve(rosbridge=True, origins=("http://friend.example",))
    with pytest.raises(InvalidStatus, match="403"), websocket(served, Origin=origin):
        pass
    for friend in ("http://friend.example", served.server.url):
        with websocket(served, Origin=friend) as connection:
            connection.send("?")
            assert heard(connection, "status")


def test_two_clients_may_use_the_same_id(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as one, websocket(served) as other:
        for connection in (one, other):
            say(connection, **GOAL, id="1", args={"task_number": 11})
            result = heard(connection, "action_result")
            assert (result["id"], result["values"]) == ("1", {"success": True})


def test_one_client_may_not_use_an_id_twice_at_once(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        say(connection, **GOAL, id="1", args={"task_number": 10}, feedback=True)
        heard(connection, "action_feedback")
        say(connection, **GOAL, id="1", args={"task_number": 11})
        # No result, which would end the first goal.
        assert "already" in heard(connection, "status")["msg"]
        say(connection, op="cancel_action_goal", id="1", action="/task_server")
        assert heard(connection, "action_result")["status"] == 5


def test_feedback_only_on_request(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        say(connection, **GOAL, id="1", args={"task_number": 11})
        assert json.loads(connection.recv(10))["op"] == "action_result"


def test_a_goal_continues_without_its_client(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        say(connection, **GOAL, id="1", args={"task_number": 10}, feedback=True)
        heard(connection, "action_feedback")
    (goal,) = served.executive.goals()
    assert goal.state.name == "EXECUTING"


def test_a_cancel_by_service_answers_as_ros_does(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        service = "/task_server/_action/cancel_goal"
        say(connection, op="call_service", id="a", service=service, args={})
        response = heard(connection, "service_response")
        assert response["values"] == {"return_code": 0, "goals_canceling": []}
        assert (response["id"], response["result"]) == ("a", True)
        unknown = {"goal_info": {"goal_id": {"uuid": [1] * 16}}}
        say(connection, op="call_service", id="b", service=service, args=unknown)
        assert heard(connection, "service_response")["values"]["return_code"] == 2
        say(connection, op="call_service", id="c", service="/rosapi/topics")
        assert heard(connection, "service_response")["result"] is False
        say(connection, op="call_service", id="d", service=service, args={"goal_info": 1})
        response = heard(connection, "service_response")
        assert (response["id"], response["result"]) == ("d", False)


def test_a_status_message_is_encoded_once_for_all_subscribers(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []
    array = ros.status_array

    def counted(goals: Collection[str]) -> str:
        made.append(len(goals))
        return array(goals)

    monkeypatch.setattr(ros, "status_array", counted)
    monkeypatch.setattr(goals, "KEPT", 2)
    served = serve(rosbridge=True)
    with contextlib.ExitStack() as stack:
        clients = [stack.enter_context(websocket(served)) for _ in range(5)]
        for client in clients:
            say(client, op="subscribe", topic=ros.STATUS)
            assert heard(client, "publish")["msg"] == {"status_list": []}
        for number in range(4):
            say(clients[0], **GOAL, id=str(number), args={"task_number": 11})
            assert heard(clients[0], "action_result")["status"] == 4
        for client in clients[1:]:
            for _ in range(12):
                last = heard(client, "publish")["msg"]["status_list"]
            assert [each["status"] for each in last] == [4, 4]
    assert len(made) <= 1 + 4 * 3
    assert max(made) <= 3


def test_clients_leave_a_limited_number_of_recordings(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bridge, "GOAL_RATE", (0.001, 3.0))
    served = serve(rosbridge=True)
    results = []
    for number in range(5):  # another connection does not help
        with websocket(served) as connection:
            say(connection, **GOAL, id=str(number), args={"task_number": 11})
            results.append(heard(connection, "action_result"))
    assert [each["result"] for each in results] == [True, True, True, False, False]
    assert "request.too_many" in results[-1]["values"]
    assert len(list(served.folder.glob("recordings/*-11.mcap"))) == 3
    with served.client() as client:  # the token has a limit of its own
        assert client.run(11).success


def test_every_status_is_published_even_if_several_come_at_once(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as first, websocket(served) as late:
        say(first, op="subscribe", topic=ros.STATUS)
        assert statuses(first) == []
        ended = threading.Event()
        served.server._loop.call_soon_threadsafe(ended.wait, 30.0)
        try:
            for _ in range(2):
                assert served.executive.result(served.executive.send(11).identity).success
        finally:
            ended.set()
        reported = [statuses(first) for _ in range(6)]
        assert reported == [[1], [2], [4], [4, 1], [4, 2], [4, 4]]
        say(late, op="subscribe", topic=ros.STATUS)
        assert statuses(late) == [4, 4]


def test_the_status_topic_lists_all_known_goals(serve: Serve) -> None:
    served = serve(active=False, rosbridge=True)
    for _ in range(160):
        served.executive.result(served.executive.send(11).identity)
    with websocket(served) as connection:
        say(connection, op="subscribe", topic=ros.STATUS)
        while (reported := statuses(connection)) != [6] * 160:
            assert len(reported) <= 160


def test_a_throttled_topic_sends_its_last_message(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        topic = "/task_server/_action/status"
        say(connection, op="subscribe", topic=topic, throttle_rate=300)
        assert heard(connection, "publish")["msg"] == {"status_list": []}
        say(connection, **GOAL, id="1", args={"task_number": 11})
        after = heard(connection, "publish")["msg"]["status_list"]
        assert [each["status"] for each in after] == [4]  # 1 and 2 came within the period


def test_subscribers_on_one_connection_are_independent(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:

        def at_a_goal() -> list[list[int]]:
            say(connection, op="nothing")
            assert statuses_until_error(connection) == []  # earlier messages are handled by now
            assert served.executive.result(served.executive.send(11).identity).success
            say(connection, op="nothing")
            return statuses_until_error(connection)

        for identity, throttle in (("a", 3_600_000), ("b", 0), ("c", 0)):
            say(connection, op="subscribe", topic=ros.STATUS, id=identity, throttle_rate=throttle)
            assert statuses(connection) == []
        say(connection, op="unsubscribe", topic=ros.STATUS, id="c")
        assert at_a_goal() == [[1], [2], [4]]
        say(connection, op="unsubscribe", topic=ros.STATUS, id="unknown")
        say(connection, op="unsubscribe", topic=ros.STATUS, id="b")
        assert at_a_goal() == []  # a's period is not over
        say(connection, op="subscribe", topic=ros.STATUS, id="b")
        assert statuses(connection) == [4, 4]
        say(connection, op="unsubscribe", topic=ros.STATUS)
        assert at_a_goal() == []


def test_subscribers_are_limited(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bridge, "MAX_SUBSCRIBERS", 2)
    with websocket(serve(rosbridge=True)) as connection:
        for identity in "aba":
            say(connection, op="subscribe", topic=ros.STATUS, id=identity)
            assert statuses(connection) == []
        say(connection, op="subscribe", topic=ros.STATUS, id="c")
        assert heard(connection, "status")["id"] == "c"


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"op": "png"}', '{"op": "subscribe", "op": 1}', b"\x00\xff"]
)
def test_an_invalid_message_is_answered_and_the_connection_stays(
    serve: Serve, text: str | bytes
) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        connection.send(text)
        assert heard(connection, "status")["level"] == "error"
        say(connection, **GOAL, id="1", args={"task_number": 11})
        assert heard(connection, "action_result")["values"] == {"success": True}


def test_a_message_that_is_too_long_ends_the_connection(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as connection:
        connection.send("x" * 65_537)
        with pytest.raises(ConnectionClosed):
            connection.recv(10)


def test_a_flood_of_messages_is_queued_and_delays_no_others(serve: Serve) -> None:
    served = serve(rosbridge=True)
    large = json.dumps({"op": "publish", **{str(number): 1 for number in range(6000)}})
    with websocket(served) as flooding, websocket(served) as other:
        for _ in range(4):
            flooding.send(large)
        say(flooding, op="nothing", id="last")
        for number in range(3):
            say(other, **GOAL, id=str(number), args={"task_number": 11})
            assert heard(other, "action_result")["values"] == {"success": True}
        say(other, op="nothing", id="done")
        assert heard(other, "status")["id"] == "done"
        assert heard(flooding, "status")["id"] == "last"


@pytest.mark.parametrize(
    "cancel",
    [
        {"op": "cancel_action_goal", "action": "/task_server", "id": "a"},
        {"op": "cancel_action_goal", "action": "/task_server", "id": "a" * 300},
        {"op": "call_service", "service": "/task_server/_action/cancel_goal"},
    ],
    ids=["by name", "by a long name", "all"],
)
def test_a_cancel_is_not_queued(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, cancel: dict[str, str]
) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as flooding, websocket(served) as client:
        goal = {"id": cancel.get("id", "a"), "args": {"task_number": 10}, "feedback": True}
        say(client, **GOAL, **goal)
        heard(client, "action_feedback")
        monkeypatch.setattr(fair_queue, "REST_FACTOR", 1e9)
        say(flooding, op="nothing")  # it is processed; the rest after it lasts for years
        heard(flooding, "status")
        for _ in range(100):
            say(flooding, op="nothing")
        say(client, **cancel)
        assert heard(client, "action_result")["status"] == 5
        served.stop()  # the queue would not process their closing for years


def test_messages_before_the_answer_to_the_handshake_are_refused(
    serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    served = serve(rosbridge=True)
    asks = ("GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", *UPGRADE, "")
    for length in (1, 3 * fair_queue.CHUNK):
        with raw(served, *asks, "x" * length) as connection:
            assert answer(connection).startswith(b"HTTP/1.1 400")
    assert not [each.message for each in caplog.records if each.exc_info]


def test_a_handshake_that_is_answered_after_the_end_of_the_server_is_no_error(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    begun, ended = threading.Event(), threading.Event()

    async def refuse(_: object, websocket: WebSocket) -> None:
        begun.set()
        await asyncio.to_thread(ended.wait)
        await websocket.close()

    class Ending(connections.WebSocketConnection):
        def shutdown(self) -> None:
            super().shutdown()
            ended.set()

    monkeypatch.setattr(bridge.RosbridgeServer, "serve", refuse)
    monkeypatch.setattr(server, "WebSocketConnection", Ending)
    served = serve(rosbridge=True)
    asks = ("GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", *UPGRADE, "")
    with raw(served, *asks) as connection:
        assert begun.wait(10)
        served.stop()
        assert answer(connection) == b""
    assert not [each.message for each in caplog.records if each.exc_info]


def test_a_client_that_does_not_read_is_dropped(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bridge, "MAX_UNSENT", 5)
    served = serve(rosbridge=True)
    with served.client() as client:
        for _ in range(10):
            client.run(11)
        with websocket(served) as connection, suppress(ConnectionClosed):
            for _ in range(900):  # each is answered with the status of ten goals
                say(connection, op="subscribe", topic="/task_server/_action/status")
            while connection.recv(10):
                pass
        assert connection.close_reason == "too slow"
        assert client.run(11).success


def test_a_client_that_leaves_while_it_is_dropped_is_no_error(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(bridge, "MAX_UNSENT", 40)
    monkeypatch.setattr(connections, "STALL_SECONDS", 0.5)
    served = serve(rosbridge=True)
    asks = ("GET / HTTP/1.1", f"host: 127.0.0.1:{served.server.port}", *UPGRADE, "")
    wish = {"op": "subscribe", "topic": "/task_server/_action/status"}
    frame = Frame(Opcode.TEXT, json.dumps(wish).encode()).serialize(mask=True)
    with served.client() as client:
        for _ in range(100):
            served.executive.result(served.executive.send(11).identity)
        with raw(served, *asks) as connection, suppress(OSError):
            assert b" 101 " in connection.recv(1000)
            connection.sendall(frame * 900)  # none of the answers is read
            while client.status() and served.server.connections > 1:
                pass
        assert client.run(11).success
    assert not [each.message for each in caplog.records if each.exc_info]
