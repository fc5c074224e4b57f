"""The rows of operations: the document made from them, the server, and what answers."""

import inspect
import subprocess
import sys

import click
import fastjsonschema
import pytest

from executive.api.operations import OPERATIONS, Operation
from executive.cli.server_commands import arm
from executive.server.http.endpoints import Endpoints
from hardware import TRANSITIONS
from tests.executive.server.rosbridge.test_bridge import GOAL, heard, say, websocket
from tests.support.codes import all_codes
from tests.support.servers.serving import Serve

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

# These last as long as their client stays.
STREAMS = ("/api/events", "/api/goals/{goal_id}/hold")


# A schema knows no joints and poses of a robot, so the server may refuse what the schema allows.
SCHEMATHESIS = """
[[operations]]
include-path-regex = "/api/(move|plan|poses)$"
checks.positive_data_acceptance.expected-statuses = ["2xx", 404, 409, 422, 429]
"""


def test_the_server_conforms_to_its_document(serve: Serve) -> None:
    served = serve(active=False)
    settings = served.folder / "schemathesis.toml"
    settings.write_text(SCHEMATHESIS)
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(settings)),
        *("run", f"{served.server.url}/openapi.json"),
        *("--header", f"Authorization: Bearer {served.server.token}"),
        *("--phases", "coverage,fuzzing", "--max-examples", "3", "--seed", "1", "--no-color"),
        *("--generation-database", "none", "--request-timeout", "10"),
        *(part for path in STREAMS for part in ("--exclude-path", path)),
    ]
    ran = subprocess.run(
        command, capture_output=True, text=True, timeout=300, cwd=served.folder, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    # Schemathesis does not test the operation that returns the document.
    tested = [o for o in OPERATIONS.values() if o.path not in (*STREAMS, "/openapi.json")]
    assert f"Tested: {len(tested)}" in ran.stdout


def test_a_path_answers_other_methods(serve: Serve) -> None:
    served = serve()
    assert served.ask("OPTIONS", "/api/goals")[0] == 405
    assert served.ask("HEAD", "/api/health")[0] == 200


def test_a_goal_of_rosbridge_conforms_to_the_document(serve: Serve) -> None:
    served = serve(rosbridge=True)
    with websocket(served) as client:
        say(client, **GOAL, id="a", args={"task_number": -1})
        assert heard(client, "action_result")["status"] == 6
    (goal,) = served.ask("GET", "/api/goals")[1]["goals"]
    assert goal["task"] == -1
    document = served.ask("GET", "/openapi.json")[1]
    fastjsonschema.compile({**document, "$ref": "#/components/schemas/Goal"})(goal)


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_an_answer_takes_what_its_row_says(operation: Operation) -> None:
    method = inspect.signature(getattr(Endpoints, operation.name))
    taken = set(method.parameters) - {"self", "request"}
    keys = operation.body["properties"] if operation.body else {}
    client = {"client"} if operation.names_client else set()
    assert taken == {*operation.parameters, *keys, *client}
    assert ("request" in method.parameters) == operation.streams
    needed = {name for name in operation.parameters if operation.in_path(name)}
    needed |= set(operation.body.get("required", ())) if operation.body else set()
    empty = inspect.Parameter.empty
    assert {name for name in taken if method.parameters[name].default is empty} == needed


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_a_row_puts_each_argument_where_the_server_reads_it(operation: Operation) -> None:
    keys = list(operation.body["properties"]) if operation.body else []
    names = [*operation.parameters, *keys]
    path, query, body = operation.split(dict(zip(names, names, strict=True)) | {"other": None})
    in_path = [name for name in operation.parameters if operation.in_path(name)]
    assert path == operation.path.replace("{", "").replace("}", "")
    assert list(query) == [name for name in operation.parameters if name not in in_path]
    assert body == (None if operation.body is None else {key: key for key in keys})


def test_errors_of_a_row_are_codes_or_their_families() -> None:
    known = {part for code in all_codes() for part in (code, code.partition(".")[0])}
    assert {error for row in OPERATIONS.values() for error in row.errors} <= known


def test_the_command_offers_the_transitions_of_the_row() -> None:
    (choices,) = [each.type for each in arm.params if each.name == "transition"]
    assert isinstance(choices, click.Choice)
    assert tuple(choices.choices) == TRANSITIONS
