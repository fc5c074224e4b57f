"""What a task requests, answered over a real socket."""

import json
import subprocess
import sys

import pytest

from armtree import Client
from executive.api.events import QuestionStatus
from executive.client.values import OpenQuestion
from executive.errors import Refused
from tests.support.servers.serving import Serve, Served

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]


def asked(client: Client) -> tuple[str, str]:
    """Run the task that asks; return its goal and its open question."""
    with client.events("question") as events:
        goal = client.send(14)
        question = next(events)
    assert isinstance(question, QuestionStatus)
    assert (question.text, question.choices, question.open) == ("Free?", ("yes", "no"), True)
    return goal, question.question_id


def armtree(served: Served, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "armtree", *words, "--server", served.server.url]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_the_task_continues_after_an_answer(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        goal, question = asked(client)
        assert client.questions() == (OpenQuestion(question, "Free?", ("yes", "no")),)
        assert client.answer(question, "Y") == "yes"
        assert client.result(goal).success
        assert client.questions() == ()
        with pytest.raises(Refused, match="is unknown or already answered"):
            client.answer(question, "yes")


def test_the_phase_while_a_question_is_open(serve: Serve) -> None:
    served = serve()
    with served.client() as client, client.events("feedback") as events:
        goal = client.send(14)
        reported = next(event for event in events if getattr(event, "phase", "") == "asking")
        assert client.status().phase == "asking"
        assert getattr(reported, "goal_id", "") == goal


def test_an_unwanted_answer_fails_the_task_and_an_invalid_one_is_refused(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        goal, question = asked(client)
        path = f"/api/questions/{question}/answer"
        status, error = served.ask("POST", path, {"answer": "perhaps"})
        assert (status, error["code"]) == (422, "goal.bad_answer")
        assert "perhaps is not an answer to: Free? [yes/no]" in error["message"]
        assert served.ask("POST", path, {"answer": "no"}) == (
            200,
            {"question_id": question, "answer": "no"},
        )
        assert client.result(goal).code == "task.condition"


def test_an_answer_needs_the_token_and_a_question(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        _, question = asked(client)
    path = f"/api/questions/{question}/answer"
    assert served.ask("POST", path, {"answer": "yes"}, token=False)[0] == 401
    status, error = served.ask("POST", "/api/questions/01234567/answer", {"answer": "yes"})
    assert (status, error["code"]) == (404, "goal.unknown_question")


def test_a_cancel_withdraws_the_question_with_an_event(serve: Serve) -> None:
    served = serve()
    with served.client() as client:
        goal, question = asked(client)
        with client.events("question") as events:  # a late subscriber receives open questions
            first = next(events)
            client.cancel(goal)
            second = next(events)
        assert isinstance(first, QuestionStatus)
        assert isinstance(second, QuestionStatus)
        assert (first.question_id, first.open) == (question, True)
        assert (second.question_id, second.open) == (question, False)
        assert client.questions() == ()


def test_the_command_answers(serve: Serve) -> None:
    served = serve()
    nothing = armtree(served, "answer", "yes")
    assert nothing.returncode == 2
    assert "there is no open question" in nothing.stderr
    assert armtree(served, "answer").stdout == "there is no open question\n"
    with served.client() as client:
        goal, question = asked(client)
        assert armtree(served, "answer").stdout == f"{question}  Free? [yes/no]\n"
        wrong = armtree(served, "answer", "01234567", "yes")  # not the answer to the other question
        assert wrong.returncode == 4
        assert "01234567 is unknown" in wrong.stderr
        listed = {"question_id": question, "text": "Free?", "choices": ["yes", "no"]}
        assert json.loads(armtree(served, "answer", "--json").stdout) == {"questions": [listed]}
        counts = json.loads(armtree(served, "answer", "y", "--json").stdout)
        assert counts == {"question_id": question, "answer": "yes"}
        assert client.result(goal).success


def test_the_command_that_waits_shows_the_question(serve: Serve) -> None:
    served = serve()
    command = [sys.executable, "-m", "armtree", "send", "14", "--wait", "--server"]
    with subprocess.Popen(
        [*command, served.server.url], stdout=subprocess.PIPE, text=True
    ) as waiting:
        assert waiting.stdout
        line = next(line for line in waiting.stdout if line.startswith("?"))
        assert line.startswith("? Free? [yes/no]  (armtree answer ")
        question = line.partition("armtree answer ")[2].split()[0]
        assert armtree(served, "answer", question, "yes").returncode == 0
        assert "SUCCEEDED" in waiting.stdout.read()


def test_json_output_contains_the_question(serve: Serve) -> None:
    served = serve()
    command = [sys.executable, "-m", "armtree", "send", "14", "--wait", "--json", "--server"]
    with subprocess.Popen(
        [*command, served.server.url], stdout=subprocess.PIPE, text=True
    ) as waiting:
        assert waiting.stdout
        events = map(json.loads, waiting.stdout)
        question = next(event for event in events if event["event"] == "question")
        assert question["choices"] == ["yes", "no"]
        with served.client() as client:
            client.answer(question["question_id"], "yes")
        assert list(events)[-1]["success"] is True
