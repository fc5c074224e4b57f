"""Events of goals that have ended, and the nodes of their trees."""

import json
from typing import Any

import pytest

from tests.support.servers.serving import Serve, Served

pytest_plugins = ["tests.support.servers.server_fixtures"]


def events(served: Served, goal: str, query: str = "") -> list[dict[str, Any]]:
    status, text = served.ask("GET", f"/api/goals/{goal}/events{query}", token=False)
    assert status == 200
    parts = text.decode().split("\n\n")[:-1]
    return [json.loads(part.partition("\ndata: ")[2]) for part in parts]


@pytest.mark.slow
def test_a_recording_is_sent_as_the_events_of_its_run(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        goal = client.send("home")
        client.result(goal)
    live = events(served, goal)
    kinds = {each["event"] for each in live}
    assert {"goal", "node", "feedback", "plan", "schedule", "sent", "status"} <= kinds
    assert live[-1]["result"]["state"] == "SUCCEEDED"
    times = [each["time_s"] for each in live[:-1]]
    assert times == sorted(times)
    chosen = events(served, goal, "?events=node,status")
    assert chosen == [each for each in live if each["event"] in ("node", "status")]
    assert [each["event"] for each in events(served, goal, "?events=status")] == ["status"]


def test_a_goal_that_runs_has_no_recorded_events(serve: Serve) -> None:
    served = serve()
    goal = served.executive.send(10).identity
    status, error = served.ask("GET", f"/api/goals/{goal}/events")
    assert (status, error["code"]) == (404, "request.not_found")
    assert served.ask("GET", f"/api/goals/{'0' * 32}/events")[0] == 404


def test_nodes_have_kinds_ports_and_lines(serve: Serve) -> None:
    served = serve(active=False)
    status, answer = served.ask("GET", "/api/tasks/14/nodes", token=False)
    (node,) = answer["nodes"]
    assert (status, node["path"], node["kind"], node["called_at"]) == (200, "ask", "Ask", "")
    assert (node["file"], node["line"]) == ("14_ask.yaml", 5)
    assert node["ports"]["question"] == "Free?"
    nodes = {node["path"]: node for node in served.ask("GET", "/api/tasks/1/nodes")[1]["nodes"]}
    called = {path: node["called_at"] for path, node in nodes.items() if node["called_at"]}
    assert "1_pick.yaml:" in next(iter(called.values()))
    assert served.ask("GET", "/api/tasks/99/nodes")[0] == 404
