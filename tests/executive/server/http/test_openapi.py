"""The OpenAPI document against the server, by somebody else's reading of it."""

import subprocess
import sys
from pathlib import Path

import fastjsonschema
import pytest

import executive.server as server
from executive.server.http.operations import OPERATIONS
from tests.executive.server.rosbridge.test_bridge import GOAL, heard, say, websocket
from tests.support.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.server_fixtures"]

# These last as long as their client stays.
STREAMS = ("/api/events", "/api/goals/{goal_id}/hold")


def test_the_server_is_as_its_document_says(serve: Serve) -> None:
    served = serve(active=False)
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "run", f"{served.server.url}/openapi.json"),
        *("--header", f"Authorization: Bearer {served.server.token}"),
        *("--phases", "coverage,fuzzing", "--max-examples", "3", "--seed", "1", "--no-color"),
        *("--generation-database", "none", "--request-timeout", "10"),
        *(part for path in STREAMS for part in ("--exclude-path", path)),
    ]
    ran = subprocess.run(
        command, capture_output=True, text=True, timeout=300, cwd=served.folder, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Tested: 18" in ran.stdout


def test_a_path_tells_all_its_methods(serve: Serve) -> None:
    served = serve()
    assert served.ask("OPTIONS", "/api/goals")[0] == 405
    assert served.ask("HEAD", "/api/health")[0] == 200


def test_a_goal_of_rosbridge_is_answered_for_as_the_document_says(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as client:
        say(client, **GOAL, id="a", args={"task_number": -1})
        assert heard(client, "action_result")["status"] == 6
    (goal,) = served.ask("GET", "/api/goals")[1]["goals"]
    assert goal["task"] == -1
    document = served.ask("GET", "/openapi.json")[1]
    fastjsonschema.compile({**document, "$ref": "#/components/schemas/Goal"})(goal)


def test_the_page_lists_every_operation() -> None:
    page = (Path(server.__file__).parent / "README.md").read_text()
    rows = [f"| `{each.method} {each.path}` | {each.summary} |" for each in OPERATIONS.values()]
    assert [row for row in rows if row not in page] == []
