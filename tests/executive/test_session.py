"""From a set-up to an executive: what starts at once, and ends with it."""

import os
from pathlib import Path

import pytest

from executive.session import open_executive
from executive.setup import Setup
from hardware.drivers.virtual.board_process import BoardProcess, VirtualLink
from hardware.errors import PortMissing


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
