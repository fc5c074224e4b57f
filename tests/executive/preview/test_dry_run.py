"""Dry runs and poses over HTTP: what a page asks before it moves the arm."""

import math
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import logs
from executive.api.events import Event
from executive.setup import Setup
from tests.support.servers import serving
from tests.support.servers.serving import Serve, Served
from trees.live_library import LiveLibrary

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]

COLLIDE = """task: 20
name: collide
description: Move, then collide.
parameters:
  far: {type: number, default: 20, max: 60, description: how far}
tree:
  sequence:
    - subtree: move_joints
      with: {joints: {joint_1: 30 deg}}
    - Say: {text: far, value: $far}
    - subtree: move_joints
      with: {joints: {joint_2: -90 deg, joint_3: -90 deg}}
"""


def planned(served: Served, task: int, **arguments: object) -> dict[str, Any]:
    status, found = served.ask("POST", "/api/plan", {"task": task, "arguments": arguments})
    assert status == 200, found
    return dict(found)


def kinds(found: dict[str, Any]) -> list[str]:
    return [e["event"] for e in found["events"] if e["event"] not in ("sent", "node")]


def test_a_dry_run_plans_the_frames_of_the_run_and_sends_none(serve: Serve) -> None:
    served = serve()
    sent: list[Event] = []
    served.executive.subscribe(sent.append)
    found = planned(served, 1)
    assert sent == []
    assert kinds(found)[0] == "goal"
    assert kinds(found)[-1] == "status"
    assert found["events"][-1]["state"] == "SUCCEEDED"
    served.executive.result(served.executive.send(1).identity)
    frames = [event.text for event in sent if isinstance(event, logs.Sent)]
    assert [event["data"] for event in found["events"] if event["event"] == "sent"] == frames
    times = [event["time_s"] for event in found["events"][1:-1]]
    assert times == sorted(times)


FAR = """
task: 21
name: far
description: Go far.
parameters:
  far: {type: angle, default: 60 deg, min: 0 deg, max: 170 deg, description: how far}
tree:
  sequence:
    - subtree: move_joints
      with: {joints: {joint_1: $far}}
"""


def test_a_dry_run_says_why_the_run_would_fail(serve: Serve) -> None:
    served = serve()
    (served.tasks / "20_collide.yaml").write_text(COLLIDE)
    found = planned(served, 20)
    assert kinds(found) == ["goal", "plan", "schedule", "plan", "status"]
    cause = found["events"][-1]["result"]["cause"]
    assert cause["code"] == "plan.goal_in_collision"
    assert cause["node"] == "collide/2:move_joints/Target"
    wrong = {"task": 20, "arguments": {"far": 80}}
    assert served.ask("POST", "/api/plan", wrong)[1]["code"] == "goal.bad_arguments"
    (served.tasks / "21_far.yaml").write_text(FAR)
    last = [each for each in planned(served, 21)["events"] if each["event"] == "sent"][-1]
    assert last["positions"][0] == pytest.approx(math.radians(60))
    wrong = {"task": 21, "arguments": {"far": "120 deg"}}
    error = served.ask("POST", "/api/plan", wrong)[1]
    limits = "joint_1 = 120 deg is outside its limits, -90 deg to 90 deg"
    assert (error["code"], error["message"]) == ("goal.bad_arguments", f"arguments: far: {limits}")
    assert error["argument"] == "far"
    assert planned(served, 11)["unknown"] == []
    served.executive.send(10)
    assert served.ask("POST", "/api/plan", {"task": 1})[1]["code"] == "goal.under_way"


def test_poses_are_listed_saved_and_recalled(serve: Serve) -> None:
    served = serve()
    move = {"to": ["joint_1=40deg"]}
    served.executive.result(served.ask("POST", "/api/move", move)[1]["goal_id"])
    saved = served.ask("POST", "/api/poses", {"name": "left"})[1]
    assert saved["positions"]["joint_1"] == pytest.approx(0.698, abs=0.02)
    assert "joint_4" not in saved["positions"]
    listed = served.ask("GET", "/api/poses")[1]["poses"]
    assert "left" in [each["pose"] for each in listed]
    assert "home" in [each["pose"] for each in listed]
    assert served.ask("POST", "/api/poses", {"name": "left"})[0] == 422
    assert served.ask("POST", "/api/poses", {"name": "left", "replace": True})[0] == 200
    removal = {"name": "left"}
    assert served.ask("POST", "/api/poses/remove", removal)[1]["source"] == saved["source"]
    assert served.ask("POST", "/api/poses/remove", removal)[0] == 404
    assert served.ask("POST", "/api/poses", {"name": "left"})[0] == 200
    assert served.ask("POST", "/api/poses", {"name": "x1", "group": "leg"})[0] == 422
    served.executive.result(served.ask("POST", "/api/move", {"to": ["home"]})[1]["goal_id"])
    served.executive.result(served.ask("POST", "/api/move", {"to": ["left"]})[1]["goal_id"])
    commanded = served.executive.where().commanded
    assert commanded
    assert commanded["joint_1"] == pytest.approx(saved["positions"]["joint_1"], abs=0.01)


def test_a_server_without_a_folder_makes_the_one_of_pose_save(
    serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    own = partial(LiveLibrary, default=Setup.own_trees)
    monkeypatch.setattr(serving, "LiveLibrary", lambda _, robot: own(None, robot))
    served = serve()
    assert served.ask("POST", "/api/poses/remove", {"name": "left"})[0] == 404
    source = served.ask("POST", "/api/poses", {"name": "left"})[1]["source"]
    assert source == "trees/arduinobot/poses.yaml"
    assert "left" in [each["pose"] for each in served.ask("GET", "/api/poses")[1]["poses"]]
