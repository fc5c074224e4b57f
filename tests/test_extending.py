"""One of each thing that people add. `trees/nodes/test_new_kind.py` adds a kind of control node."""

import json
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from armtree import Client
from executive.api import schemas
from executive.api.operations import OPERATIONS, Access, Operation
from executive.api.outcome import Cause, GoalState, Outcome
from executive.code_table import look_up
from executive.server.http.endpoints import Endpoints
from executive.testing import SimulatedArm
from tests.support.paths import ROOT
from tests.support.servers.serving import Serve
from trees.compile.port_types import known_skills

pytest_plugins = ["tests.support.servers.server_fixtures"]

TASK = "task: {number}\nname: {name}\ndescription: Try it.\ntree:\n  {tree}\n"


def test_a_task_is_one_file(tmp_path: Path) -> None:
    (tmp_path / "20_greet.yaml").write_text(
        TASK.format(number=20, name="greet", tree="Say: {text: hello}")
    )
    with SimulatedArm(trees=tmp_path) as arm:
        assert arm.run(20).success
        assert arm.said("greet") == ["hello"]


SHIPPED = [n for n, kind in known_skills().items() if kind.__module__.startswith("skills.")]
NAME = "|".join(SHIPPED)
LONG = "|".join(name for name in SHIPPED if re.search("[a-z][A-Z]", name))  # not words of English
# An import, a reference to a class, a name in quotes, in a path of nodes, or in a task file.
NAMED = re.compile(
    rf"""skills\.leaves|\b({LONG})\b|["'`]({NAME})["'`]|[./]({NAME})\b"""
    rf"""|\b({NAME})[.,(]|\(({NAME})\)|\b({NAME}):? ?\{{"""
)


def test_only_the_room_of_skills_names_one() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for room in ("executive", "hardware", "logs", "trees")
        for path in (ROOT / room).rglob("*.py")
        for line in path.read_text().splitlines()
        if NAMED.search(line.replace('"""', ""))
    ]
    assert found == []


@pytest.mark.parametrize(
    "line",
    [
        "from skills.leaves.execute import Execute",
        "class Replay(Execute):",
        "such as `pick/Execute`.",
        "    - Wait: {{duration: 200 ms}}",
        'arm.said("Say")',
        "suggest CheckHardware",
    ],
)
def test_a_skill_that_is_named_is_found(line: str) -> None:
    assert NAMED.search(line)


SKILL = """
from py_trees.common import Status
from skills import Skill

class CountJoints(Skill):
    '''Say how many joints the arm has.'''

    def on_start(self):
        self.feedback_message = f"{len(self.context.robot.actuated)} joints"
        return Status.SUCCESS
"""


def test_a_skill_is_one_class(tmp_path: Path) -> None:
    (tmp_path / "count.py").write_text(SKILL)
    (tmp_path / "21_count.yaml").write_text(
        TASK.format(number=21, name="count", tree="CountJoints: {}")
    )
    with SimulatedArm(trees=tmp_path, skills=tmp_path) as arm:
        assert arm.run(21).success
        assert arm.said("count") == ["4 joints"]


FAILURE = """
from skills import Skill, TaskFailed

class TooHot(TaskFailed):
    '''The motor is too hot.'''

    code = "task.test_too_hot"
    exit_status = 40
    hint = "let it cool down"

class MeasureHeat(Skill):
    '''Measure the temperature of the motors.'''

    def on_start(self):
        raise TooHot("71 degrees")
"""


def test_a_failure_is_one_exception_class(tmp_path: Path) -> None:
    (tmp_path / "heat.py").write_text(FAILURE)
    (tmp_path / "22_heat.yaml").write_text(
        TASK.format(number=22, name="heat", tree="MeasureHeat: {}")
    )
    with SimulatedArm(trees=tmp_path, skills=tmp_path) as arm:
        cause = arm.run(22).cause
    assert cause
    assert (cause.code, cause.hint) == ("task.test_too_hot", "let it cool down")
    assert cause.message == "The task failed: 71 degrees"
    known = look_up(cause.code)
    assert (known.exit_status, known.http_status) == (40, 422)


TOPIC = """
import sys
from dataclasses import dataclass
from pathlib import Path
from logs.records import conversions, topics

@dataclass(frozen=True, slots=True)
class Battery:
    time: float
    volts: float

row = topics.Topic(Battery, "/battery", "std_msgs/msg/String", conversions.every_field)
topics.TOPICS += (row,)

import logs

path = Path(sys.argv[1])
with logs.Recorder(path, 0, print) as recorder:
    recorder.put(Battery(1.0, 7.4))
print(logs.table(path, "/battery")["volts"], *logs.Recording(path).records(Battery))
"""


def test_a_topic_is_a_record_and_a_row(tmp_path: Path) -> None:
    command = [sys.executable, "-c", TOPIC, str(tmp_path / "run.mcap")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == ["[7.4] Battery(time=1.0, volts=7.4)"], done.stderr


# Five servos, joints and links of other names, another size, boxes for shapes.
CRANE = {"waist": "0 0 1", "shoulder": "0 1 0", "elbow": "0 1 0", "roll": "1 0 0", "jaw": "0 0 1"}
LINKS = ["stand", "post", "boom", "jib", "hook", "finger"]


def crane(folder: Path) -> Path:
    """A robot file in a folder, beside its URDF."""
    box = '<collision><origin xyz="0 0 0.02"/><geometry><box size="0.02 0.02 0.03"/></geometry>'
    links = "".join(f'<link name="{link}">{box}</collision></link>' for link in LINKS)
    limit = '<limit lower="-1.5" upper="1.5" effort="9" velocity="2"/>'
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{above}"/><child link="{below}"/>'
        f'<origin xyz="0 0 0.08"/><axis xyz="{axis}"/>{limit}</joint>'
        for (name, axis), above, below in zip(CRANE.items(), LINKS, LINKS[1:], strict=False)
    )
    (folder / "crane.urdf").write_text(f'<robot name="crane">{links}{joints}</robot>')
    tables = "".join(
        f"[joints.{name}]\nvelocity = 2.0\nacceleration = 4.0\nboot = 0.0\n"
        f'wire = {{ letter = "{name[0]}", sign = 1, offset_deg = 90, span_deg = 180, '
        "reversed = false }\n"
        for name in CRANE
    )
    neighbours = [list(pair) for pair in pairwise(LINKS)]
    (folder / "crane.toml").write_text(
        'name = "crane"\ndriver = "serial_servo"\nurdf = "crane.urdf"\n'
        '[serial]\nport = "virtual"\nbaud = 9600\nboot_wait_s = 2.0\nfirmware = "stock"\n'
        f'[groups]\narm = {[*CRANE][:-1]}\ngripper = ["jaw"]\n{tables}'
        f"[collision]\nmargin_m = 0.002\nfloor_ignores = []\nallowed = {neighbours}\n"
    )
    return folder / "crane.toml"


def test_an_arm_is_one_robot_file_with_its_urdf(tmp_path: Path) -> None:
    robot = crane(tmp_path)
    target = "{waist: 30 deg, shoulder: 40 deg, elbow: -20 deg, roll: 10 deg}"
    reach = f"{{subtree: reach, with: {{arm: {target}, gripper: {{jaw: -20 deg}}}}}}"
    (tmp_path / "23_lift.yaml").write_text(TASK.format(number=23, name="lift", tree=reach))
    with SimulatedArm(robot=robot, trees=tmp_path) as arm:
        assert arm.run(23).success
    servos = [(field[0], round(int(field[1:]), -1)) for field in arm.frames[-1].split(",")[:-1]]
    assert servos == [("w", 120), ("s", 130), ("e", 70), ("r", 100), ("j", 70)]


def test_a_server_operation_is_a_row_and_an_answer(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = Operation(
        "POST",
        Access.CHANGE,
        "/api/echo/{text}",
        "echo",
        "Repeat a text.",
        schemas.answer("Echo", text=schemas.TEXT),
        {"text": schemas.TEXT},
        schemas.body("times", times=schemas.COUNT),
    )

    async def echo(_: Endpoints, text: str, times: int) -> dict[str, Any]:
        return {"text": text * times}

    monkeypatch.setitem(OPERATIONS, "echo", row)
    monkeypatch.setattr(Endpoints, "echo", echo, raising=False)
    served = serve(active=False)
    assert served.ask("POST", "/api/echo/ha", {"times": 2})[1] == {"text": "haha"}
    assert served.ask("POST", "/api/echo/ha", {})[0] == 422
    assert served.ask("POST", "/api/echo/ha", {"times": 2}, token=False)[0] == 401
    document = served.ask("GET", "/openapi.json")[1]
    assert document["paths"]["/api/echo/{text}"]["post"]["summary"] == row.summary
    assert "Echo" in document["components"]["schemas"]

    class Caller(Client):  # the third place, for those who use it
        def echo(self, text: str, times: int) -> str:
            return self._call("echo", lambda answer: str(answer["text"]), text=text, times=times)

    with Caller(served.server.url) as client:
        assert client.echo("ha", 3) == "hahaha"


def test_a_field_of_an_outcome_is_one_of_its_class_and_one_of_its_record() -> None:
    cause = Cause("goal.busy", "Busy", "t/A", "joint_1", 2.0, 1.5, "wait")
    outcome = Outcome.of(3, GoalState.ABORTED, cause, 12, 0.25, "3.mcap")
    assert Outcome.from_record(outcome.to_record("0" * 32, 1.0), "3.mcap") == outcome
    plain = json.loads(json.dumps(outcome.to_json()))
    assert Outcome.from_json(plain) == outcome
    assert set(schemas.RESULT.schema["properties"]) == {"goal_id", *plain}
    assert set(schemas.ERROR.schema["properties"]) == set(plain["cause"])
