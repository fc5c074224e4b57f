"""From a set-up to an executive: what starts at once, and ends with it."""

import os
from pathlib import Path

import pytest

import logs
from executive.errors import BadWorldFile
from executive.session import open_executive
from executive.setup import Setup
from executive.task_runner import TaskRunner
from hardware import BoardLink, Robot, SimulatedClock
from hardware.drivers.virtual.board_process import BoardProcess, VirtualLink
from hardware.errors import PortMissing
from skills.motion import Pool
from tests.support.arms.virtual_boards import virtual_board


def test_the_virtual_board_of_a_single_user_starts_at_once_and_ends_with_the_executive(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    switch_on, boards = VirtualLink.switch_on, list[BoardProcess]()

    def note(link: VirtualLink) -> BoardProcess:
        boards.append(switch_on(link))
        return boards[-1]

    monkeypatch.setattr(VirtualLink, "switch_on", note)
    for single_user in (False, True):
        setup = Setup(port="virtual", recordings=tmp_path, single_user=single_user)
        with open_executive(setup):
            assert len(boards) == single_user
            for board in boards:
                os.kill(board.pid, 0)
    with pytest.raises(ProcessLookupError):
        os.kill(boards[0].pid, 0)


def test_a_server_reports_a_missing_port_and_starts(tmp_path: Path) -> None:
    port, said = str(tmp_path / "nope"), list[str]()
    with open_executive(Setup(port=port, recordings=tmp_path), report=said.append):
        assert [each.partition(";")[0] for each in said] == [f"There is no serial port {port}"]
    with (
        pytest.raises(PortMissing),
        open_executive(Setup(port=port, recordings=tmp_path, single_user=True), report=said.append),
    ):
        pass
    with open_executive(Setup(port=port, recordings=tmp_path, activate=True), report=said.append):
        assert len(said) == 1  # the activation reports it


def test_a_run_begins_in_the_world_of_its_file(
    robot: Robot, shared_clock: SimulatedClock, shared_pool: Pool, tmp_path: Path
) -> None:
    file = tmp_path / "world.yaml"
    file.write_text("- name: post\n  box: {size: [0.03, 0.03, 0.2]}\n  position: [1, 0, 0.1]\n")
    setup = Setup(robot=robot, recordings=tmp_path, single_user=True, world=file)
    link = BoardLink(virtual_board(robot), shared_clock)
    with (
        shared_clock.working(),
        open_executive(setup, clock=shared_clock, link=link, pool=shared_pool) as executive,
    ):
        executive.start()
        outcome = TaskRunner(executive).run(1)
    assert outcome.success
    (plan, *_) = logs.Recording(Path(outcome.recording)).records(logs.Plan)
    assert isinstance(plan, logs.Plan)
    assert [body["name"] for body in plan.world] == ["post"]


def test_a_world_file_that_is_wrong_ends_the_start(tmp_path: Path) -> None:
    file = tmp_path / "world.yaml"
    setup = Setup(port="virtual", recordings=tmp_path, world=file)
    with pytest.raises(BadWorldFile, match="cannot be read"), open_executive(setup):
        pass
    file.write_text("- name: beam\n  mesh: {path: none.stl}\n")
    with (
        pytest.raises(BadWorldFile, match=rf"world.yaml:2:3: The mesh {tmp_path}/none.stl"),
        open_executive(setup),
    ):
        pass


def test_a_server_uses_the_default_folder_as_soon_as_it_exists(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    with open_executive(Setup(port="virtual", recordings=tmp_path)) as executive:
        assert "left" not in executive.library.latest.poses()[0]
        folder = tmp_path / "trees" / "arduinobot"
        folder.mkdir(parents=True)
        (folder / "poses.yaml").write_text("poses:\n  left: {joint_1: 60 deg}\n")
        assert "left" in executive.library.latest.poses()[0]
