"""The nodes of tasks, for clients of the server."""

from tests.support.servers.serving import Serve

pytest_plugins = ["tests.support.servers.server_fixtures"]


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
