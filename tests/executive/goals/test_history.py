"""Goals of a killed server, and the start pose of the next one."""

import dataclasses
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

import logs
from executive.api import Policy
from executive.api.outcome import GoalState
from executive.cli.main import cli
from executive.errors import PoseUnconfirmed
from executive.goals.start_pose import StartPose
from hardware import DescriptionError, Robot, State, load_robot
from tests.conftest import Rig, RigMaker
from tests.support.servers.server_acts import at_frame


@pytest.fixture
def killed(server: RigMaker, tmp_path: Path) -> tuple[Path, str]:
    """A folder as a server leaves it that is killed on the way, and the goal's name."""
    folder = tmp_path / "left"
    arm = server()

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 12:
            arm.executive._recordings.caught_up(5.0)
            folder.mkdir()
            for path in tmp_path.glob("*.mcap"):
                shutil.copy(path, folder)

    arm.on_record = watch
    goal = arm.executive.send(1).identity
    arm.executive.result(goal)
    return folder, goal


def again(rig: RigMaker, folder: Path) -> Rig:
    """A server that is started in that folder."""
    arm = rig(single_user=False, recordings=folder)
    arm.executive.start()
    return arm


def test_goals_that_were_cut_off_are_known(rig: RigMaker, killed: tuple[Path, str]) -> None:
    folder, goal = killed
    arm = again(rig, folder)
    with arm.clock.working():
        (status,) = arm.executive.goals()
        assert (status.identity, status.task, status.state) == (goal, 1, GoalState.ABORTED)
        outcome = arm.executive.result(goal, 0.0)
        assert (outcome.code, outcome.frames) == ("server.restarted", 12)
        assert outcome.cause
        assert "send the goal again" in outcome.cause.hint
        assert arm.executive.send(1, identity=goal).code == "goal.duplicate"
        assert (arm.opened, arm.frames) == (0, [])  # and it is not gone on with
        assert arm.executive.cancel(goal).code.name == "GOAL_TERMINATED"
        arm.executive.close()
    assert all(isinstance(done, logs.Summary) for done in logs.recover_all(folder))
    arm = again(rig, folder)  # a recording that was recovered says as little of an end
    with arm.clock.working():
        assert [status.identity for status in arm.executive.goals()] == [goal]
        arm.executive.close()


def test_open_recordings_are_not_read(server: RigMaker, rig: RigMaker, tmp_path: Path) -> None:
    arm = server()
    seen: list[int] = []

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(arm.recorded(logs.Sent)) == 12:
            seen.append(len(list(logs.closed_recordings(tmp_path, 0.0))))

    arm.on_record = watch
    assert arm.executive.result(arm.executive.send(1).identity).success
    arm.executive.close()
    assert seen == [0]
    assert len(list(logs.closed_recordings(tmp_path, 0.0))) == 2


def test_goals_that_waited_or_had_ended_are_known_too(
    server: RigMaker, rig: RigMaker, tmp_path: Path
) -> None:
    arm, folder = server(policy=Policy.QUEUE), tmp_path / "left"
    done, failed, canceled, cut, waiting, gone = (f"{number:032x}" for number in range(1, 7))

    def kill() -> None:
        arm.executive.send(2, identity=waiting)
        arm.executive.send(2, identity=gone)
        arm.executive.cancel(gone)
        arm.executive._recordings.caught_up(5.0)
        (ledger,) = tmp_path.glob("*-server.mcap")
        while gone not in {r.goal_id for r in logs.Recording(ledger).records(logs.Result)}:  # type: ignore[union-attr]
            pass  # until the recorder has written it
        folder.mkdir()
        for path in tmp_path.glob("*.mcap"):  # others are finished meanwhile
            shutil.copy(path, folder)

    for identity, task in ((done, 1), (failed, 7)):
        arm.executive.result(arm.executive.send(task, identity=identity).identity)
    at_frame(arm, len(arm.frames) + 5, lambda: arm.executive.cancel(canceled))
    arm.executive.result(arm.executive.send(2, identity=canceled).identity)
    at_frame(arm, len(arm.frames) + 5, kill)
    before = [arm.executive.result(identity) for identity in (done, failed, canceled)]
    arm.executive.result(arm.executive.send(1, identity=cut).identity)
    stamps = {status.identity: status.stamp_ns for status in arm.executive.goals()}

    after = again(rig, folder)
    with after.clock.working():
        known = {status.identity: status for status in after.executive.goals()}
        assert list(known) == [done, failed, canceled, cut, waiting, gone]
        assert {name: status.stamp_ns for name, status in known.items()} == stamps
        for identity, outcome in zip((done, failed, canceled), before, strict=True):
            found = after.executive.result(identity, 0.0)
            name = Path(outcome.recording).name
            assert Path(found.recording).name == name
            assert dataclasses.replace(found, recording="") == dataclasses.replace(
                outcome, recording=""
            )
        ends = [after.executive.result(name, 0.0).code for name in (cut, waiting, gone)]
        assert ends == ["server.restarted", "server.restarted", "goal.canceled"]
        assert after.executive.send(1, identity=waiting).code == "goal.duplicate"
        after.executive.close()


# The start pose


def unreset(robot: Robot) -> Robot:
    return dataclasses.replace(robot, serial=dataclasses.replace(robot.serial, resets=False))


@pytest.mark.slow
def test_a_pose_is_offered_and_confirmed(robot: Robot, rig: RigMaker, tmp_path: Path) -> None:
    arm = rig()
    (outcome,) = arm.run(1)
    with pytest.raises(
        PoseUnconfirmed, match=r"joint_1 -80\.2 deg.* pose \"last\" .* pose \"boot\""
    ):
        StartPose(unreset(robot), "/dev/ttyX", tmp_path, None).find()
    confirmed = StartPose(unreset(robot), "/dev/ttyX", tmp_path, "last").find()
    end = arm.recorded(logs.Schedule)[-1].samples[-1]
    assert confirmed == end
    assert StartPose(unreset(robot), "/dev/ttyX", tmp_path, "boot").find() == robot.boot_pose
    assert str(outcome.recording)


def test_a_run_starts_from_a_confirmed_pose(robot: Robot, rig: RigMaker) -> None:
    first = rig()
    first.run(1)
    second = rig(robot=unreset(robot), pose="last")
    (outcome,) = second.run(1)
    assert outcome.success
    assert second.frames == []  # it is there already


def test_a_later_activation_starts_from_the_last_commanded_pose(
    robot: Robot, server: RigMaker
) -> None:
    arm = server(robot=unreset(robot), pose="boot")
    assert arm.executive.result(arm.executive.send(1).identity).success
    left = arm.recorded(logs.Sent)[-1].positions
    arm.executive.arm_to("deactivate")
    with pytest.raises(
        PoseUnconfirmed, match=r"joint_1 -80\.2 deg.* pose \"last\" .* pose \"boot\""
    ):
        arm.executive.arm_to("activate")
    assert arm.executive.status().arm is State.INACTIVE
    assert arm.executive.arm_to("activate", "last") is State.ACTIVE
    assert tuple((arm.executive.status().commanded or {}).values()) == left
    count = len(arm.frames)
    assert arm.executive.result(arm.executive.send(1).identity).success
    assert len(arm.frames) == count  # it is there already
    arm.executive.arm_to("deactivate")
    assert arm.executive.arm_to("activate", "boot") is State.ACTIVE
    assert set((arm.executive.status().commanded or {}).values()) == {0.0}
    arm.executive.arm_to("deactivate")
    with pytest.raises(PoseUnconfirmed, match=r"joint_1 0\.0 deg"):
        arm.executive.arm_to("activate")


def test_there_is_nothing_to_confirm(robot: Robot, tmp_path: Path) -> None:
    with pytest.raises(PoseUnconfirmed, match="no recording holds a commanded pose") as offer:
        StartPose(unreset(robot), "/dev/ttyX", tmp_path, None).find()
    with pytest.raises(
        PoseUnconfirmed, match=r'board off and on.*confirm the pose "boot"'
    ) as refusal:
        StartPose(unreset(robot), "/dev/ttyX", tmp_path, "last").find()
    assert offer.value.hint == refusal.value.hint == "give --pose boot"


def test_a_board_that_resets_starts_in_its_boot_pose(robot: Robot, tmp_path: Path) -> None:
    assert StartPose(robot, "/dev/ttyX", tmp_path, None).find() == robot.boot_pose
    assert StartPose(unreset(robot), "virtual", tmp_path, None).find() == robot.boot_pose
    with pytest.raises(
        PoseUnconfirmed, match="is reset when the port opens, and the arm moves"
    ) as no:
        StartPose(robot, "/dev/ttyX", tmp_path, "last").find()
    assert no.value.hint == "leave out --pose last"


def robot_file(folder: Path, robot: Robot, line: str) -> Path:
    text = robot.path.read_text().replace("baud = 115200", f"baud = 115200\n{line}")
    for name in (robot.urdf.name,):
        shutil.copy(robot.urdf, folder / name)
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_the_robot_file_says_it(robot: Robot, tmp_path: Path) -> None:
    path = robot_file(tmp_path, robot, "reset_on_open = false")
    assert not load_robot(path).serial.resets
    assert robot.serial.resets
    path.write_text(path.read_text().replace('firmware = "stock"', 'firmware = "armtree"'))
    with pytest.raises(DescriptionError, match=r"reset_on_open: false is not allowed: opening"):
        load_robot(path)


def test_a_run_asks_before_it_opens_the_port(robot: Robot, tmp_path: Path) -> None:
    path = robot_file(tmp_path, robot, "reset_on_open = false")
    port = tmp_path / "port"
    command = ["run", "1", "--robot", str(path), "--port", str(port), "--recordings", str(tmp_path)]
    done = CliRunner().invoke(cli, command)
    assert done.exit_code == 6
    assert "armtree does not know the pose" in done.output
    done = CliRunner().invoke(cli, [*command, "--pose", "boot"])
    assert "There is no serial port" in done.output
