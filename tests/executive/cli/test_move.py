"""`armtree move`, `home`, `where` and `stop`, as a user types them."""

import json
from pathlib import Path

import pytest

from executive.api.events import Where
from executive.cli.move import _where_lines
from hardware import State
from tests.support.command_line.typed import typed as type_command
from tests.support.paths import DATA
from tests.support.servers.serving import Serve, Served, Typed

pytest_plugins = ["tests.support.servers.server_fixtures"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory on a machine without a server."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (("joint_9=1",), 4, "joint_9 is not an actuated joint"),
        (("joint_1=70dg",), 4, "did you mean 70 deg? [goal.bad_target]"),
        (("joint_1=100deg",), 4, "is outside its limits, -90 deg to 90 deg [goal.out_of_bounds]"),
        (("foldd",), 4, "did you mean folded? Or give JOINT=VALUE"),
        (("--by", "folded"), 4, "folded is a pose, not a change"),
        (("0.1", "0.1"), 4, "such as 0.1 0.1 8cm. Or name what moves: JOINT=VALUE or width=20mm"),
        (("open", "closed"), 4, "open and closed move joint_4 to different positions; give one"),
        (("9", "9", "9m"), 4, "point 9 m is far beyond the reach of this arm, 0.26 m [goal."),
        (("300", "0", "100"), 4, "of this arm, 0.26 m; did you mean 300mm 0 100mm? [goal."),
        (("--by", "10", "0", "1cm"), 4, "did you mean 10mm 0 1cm? [goal."),
        pytest.param(("0.5", "0", "0.1"), 5, "The tool cannot reach", marks=pytest.mark.slow),
        pytest.param(("--by", "0", "0", "50cm"), 5, "cannot reach (", marks=pytest.mark.slow),
    ],
)
def test_a_wrong_move_opens_no_port(
    folder: Path, words: tuple[str, ...], status: int, why: str
) -> None:
    found, out, error = type_command(folder, "move", *words, "--port", "virtual")
    assert (found, error) == (status, "")
    assert why in out
    assert out.startswith("move not started: ")
    assert "Starts at" not in out
    assert list(folder.glob("*.mcap")) == []


def test_a_recovered_recording_is_reported_once(folder: Path) -> None:
    recording = folder / "20260101T000000.000Z-1.mcap"
    recording.touch()
    out, error = type_command(folder, "move", "9", "9", "9m", "--port", "virtual")[1:]
    assert (out + error).count(f"{recording.name}: was empty and is removed") == 1


def test_only_what_the_arm_has_is_offered(folder: Path) -> None:
    """This arm has one pose and no gripper."""
    status, out, _ = type_command(folder, "move", "foldd", "--robot", str(DATA / "endless.toml"))
    assert status == 4
    offered = "there is only home. Or give JOINT=VALUE, JOINT+=CHANGE or x y z of the tool [goal."
    assert f"'foldd' is not a pose; {offered}" in out
    out = type_command(folder, "move", "0.1", "0.1", "--robot", str(DATA / "endless.toml"))[1]
    assert "Or name what moves: JOINT=VALUE [goal." in out


def test_an_unknown_option_is_no_number(folder: Path) -> None:
    status, _, error = type_command(folder, "move", "--sped", "0.1")
    assert (status, "No such option '--sped'" in error) == (2, True)


def test_without_a_server_or_a_recording_no_pose_is_known(folder: Path) -> None:
    for words in (("where",), ("stop",)):
        status, out, error = type_command(folder, *words)
        assert (status, out) == (13, "")
        assert "server.unreachable" in error


@pytest.mark.slow
def test_where_after_a_move_is_its_target(folder: Path) -> None:
    """The last frame leaves before the motion ends; both are 70 servo degrees."""
    assert type_command(folder, "move", "joint_1=70.9deg", "--port", "virtual")[0] == 0
    status, out, _ = type_command(folder, "where")
    assert (status, out.splitlines()[1]) == (0, "joint_1         70.9 deg commanded")


@pytest.mark.slow
def test_a_move_without_a_server_says_where_it_starts(folder: Path) -> None:
    start = "Starts at joint_1 0.0 deg, joint_2 0.0 deg, joint_3 0.0 deg, joint_4 0.0 deg; `arm"
    for change in ("2deg", "3deg"):
        status, out, _ = type_command(folder, "move", "--by", f"joint_1={change}")
        assert (status, start in out) == (0, True)
    assert "joint_1          3.0 deg" in type_command(folder, "where")[1]


@pytest.mark.slow
def test_where_aligns_long_names() -> None:
    positions = {"shoulder_pitch": 0.0, "elbow": 1.0}
    units = dict.fromkeys(positions, "rad")
    found = Where(State.ACTIVE, units, commanded=positions, measured=None, tool=(0.1, 0.0, 0.2))
    arm, shoulder, elbow, tool = _where_lines(found, "a test")
    assert arm.index("active") == tool.index(found.tool_words) == len("shoulder_pitch ")
    assert shoulder.index("deg") == elbow.index("deg")


@pytest.mark.slow  # a motion in real time
def test_where_shows_the_width_that_a_move_takes(folder: Path) -> None:
    assert type_command(folder, "move", "width=20mm", "--port", "virtual")[0] == 0
    assert type_command(folder, "where")[1].splitlines()[-1] == "width            20.0 mm"
    where = json.loads(type_command(folder, "where", "--json")[1])
    assert where["width"] == pytest.approx(0.02)


@pytest.mark.slow
def test_moves_on_the_server_of_this_machine(serve: Serve, folder: Path) -> None:
    served = serve()
    status, out, _ = type_command(folder, "move", "--by", "joint_1=-5deg")
    assert status == 0
    assert out.startswith(f"Server {served.server.url}\nmove by joint_1=-5deg\n")
    status, out, _ = type_command(folder, "where")
    assert out.startswith(
        f"arm         active, by server {served.server.url}\njoint_1         -5.0 deg commanded"
    )
    assert json.loads(type_command(folder, "home", "--json")[1].splitlines()[-1])["success"]
    where = json.loads(type_command(folder, "where", "--json")[1])
    assert where["commanded"] == {"joint_1": 0.0, "joint_2": 0.0, "joint_3": 0.0, "joint_4": -0.7}
    assert where["measured"] is None
    status, out, error = type_command(folder, "move", "joint_1=100deg")
    assert (status, error) == (4, "")
    assert out == (
        f"Server {served.server.url}\nmove not started: joint_1 = 100 deg is outside its limits, "
        "-90 deg to 90 deg [goal.out_of_bounds]\n"
    )
    status, out, _ = type_command(folder, "move", "0.5", "0", "0.1")
    assert (status, out.count("cannot reach"), out.count("choose a point")) == (5, 1, 1)


@pytest.mark.parametrize("command", [("move", "folded"), ("home",), ("jog",), ("teach", "5", "a")])
@pytest.mark.parametrize("speed", ["300", "0", "nan", "-1"])
def test_a_speed_is_a_share(folder: Path, command: tuple[str, ...], speed: str) -> None:
    status, out, error = type_command(folder, *command, "--port", "virtual", "--speed", speed)
    assert (status, out) == (2, "")
    assert error.startswith(f"Error: --speed: {speed} is ")
    assert error.endswith(f"; see armtree {command[0]} --help [usage]\n")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("speed", "why"),
    [
        ("20%", "20% is not a finite number; did you mean 0.2? [usage]"),
        ("20", "20 is more than 1; did you mean 0.2? [usage]"),
        ("2", "2 is more than 1; see armtree move --help [usage]"),
        ("200%", "200% is not a finite number; see armtree move --help [usage]"),
    ],
)
def test_a_speed_in_percent_is_corrected(folder: Path, speed: str, why: str) -> None:
    assert (
        f"--speed: {why}"
        in type_command(folder, "move", "joint_1=0", "--port", "virtual", "--speed", speed)[2]
    )


def test_a_move_needs_an_active_arm(typed: tuple[Served, Typed]) -> None:
    _, type_in = typed
    status, out, _ = type_in("move", "folded")
    assert status == 6
    refused = (
        "the arm is inactive; activate it first [hw.not_active]\n  -> `armtree arm activate`\n"
    )
    assert refused in out
    assert "The pose of an inactive arm is not known" in type_in("where")[1]


def test_stop_stops_every_server_of_this_machine(serve: Serve, folder: Path) -> None:
    servers = [serve(), serve()]
    goals = [served.executive.send(10).identity for served in servers]
    status, out, error = type_command(folder, "move", "folded")
    assert (status, "several servers run; give --server URL" in error) == (2, True)
    status, out, error = type_command(folder, "stop")
    assert (status, error) == (0, "")
    for served, goal in zip(servers, goals, strict=True):
        assert f"Stopped the arm of {served.server.url}; canceled {goal}" in out
        assert served.executive.result(goal).code == "goal.canceled"
    url = servers[0].server.url
    status, out, _ = type_command(folder, "stop", "--server", url, "--json")
    assert (status, json.loads(out)) == (0, {"server": url, "return_code": 0, "goals": []})


def test_every_command_finds_the_only_server_of_this_user(serve: Serve, folder: Path) -> None:
    """It need not listen on the default port."""
    served = serve()
    goal = served.executive.send(10).identity
    assert f"          {goal}\n" in type_command(folder, "status")[1]
    assert type_command(folder, "cancel", goal)[:2] == (0, f"canceling {goal}\n")
    serve()
    status, out, error = type_command(folder, "status")
    assert (status, out) == (2, "")
    assert "several servers run; give --server URL" in error


def test_of_several_servers_the_setting_chooses_one(
    serve: Serve, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    servers = [serve(), serve()]
    for served in servers:
        monkeypatch.setenv("ARMTREE_TCP_PORT", str(served.server.port))
        assert f"by server {served.server.url}" in type_command(folder, "where")[1]
    monkeypatch.setenv("ARMTREE_TCP_PORT", "9")
    assert "several servers run" in type_command(folder, "status")[2]


def test_a_stop_reports_the_server_that_does_not_answer(serve: Serve, folder: Path) -> None:
    serve()
    status, out, error = type_command(folder, "stop", "--server", "http://127.0.0.1:9")
    assert (status, out) == (13, "")
    assert "step" not in error


def test_a_server_with_another_robot_than_the_named_one_is_refused(
    serve: Serve, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The wrong arm would move."""
    served = serve()
    url, frames = served.server.url, served.executive.where()
    named = ("--robot", "so101")
    moves = (("move", "joint_1=5deg"), ("home",), ("jog",), ("teach", "5", "a"))
    others = (("where",), ("status", "--server", url), ("send", "10", "--server", url))
    for words in (*moves, *others):
        status, out, error = type_command(folder, *words, *named)
        assert (status, out) == (2, "")
        said = " ".join(error.split())
        assert said.startswith("Error: the server ")  # without the usage: it is spelt correctly
        assert f"the server {url} holds arduinobot, but --robot names so101" in said
        assert "armtree serve --robot so101" in said
        assert ("--port virtual" in said) == (words in moves)
    assert type_command(folder, "where", "--server", url, *named)[0] == 2
    monkeypatch.setenv("ARMTREE_ROBOT", "so101")
    assert "but ARMTREE_ROBOT names so101" in " ".join(type_command(folder, "home")[2].split())
    monkeypatch.delenv("ARMTREE_ROBOT")
    (folder / "armtree.toml").write_text('robot = "so101"\n')
    assert "armtree.toml:1 names so101" in " ".join(type_command(folder, "home")[2].split())
    assert served.executive.where() == frames
    assert type_command(folder, "where", "--robot", "arduinobot")[0] == 0
    # An arm without a driver can only be virtual, so it is certainly not the arm of the server.
    status, out, _ = type_command(folder, "move", "axis_9=1", "--robot", str(DATA / "endless.toml"))
    assert status == 4
    assert "axis_9 is not an actuated joint; there are bend, elbow, " in out


def test_a_stop_says_that_it_stopped_the_server_of_somebody_else(
    serve: Serve, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More stops are safe, but the user learns whose arm it was."""
    port = serve().server.port
    monkeypatch.setenv("ARMTREE_TCP_PORT", str(port))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder / "other"))
    status, out, error = type_command(folder, "stop")
    assert (status, error) == (0, "")
    stopped = (
        f"Stopped the arm of http://127.0.0.1:{port}, which another user or session started; no"
    )
    assert out.startswith(stopped)
    monkeypatch.delenv("ARMTREE_TCP_PORT")
    (folder / "armtree.toml").write_text(f"tcp_port = {port}\n")
    assert type_command(folder, "stop")[1].startswith(stopped)
    url = f"http://localhost:{port}"
    assert "another user" not in type_command(folder, "stop", "--server", url)[1]
