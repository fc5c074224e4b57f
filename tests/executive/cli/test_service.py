"""`armtree service`: what it shows, writes and runs."""

import os
import sys
from pathlib import Path

import pytest

from executive.cli import service
from executive.server.systemd import service_files
from executive.server.systemd.service_files import udev_rule, unit_text
from hardware.link.serial_ports import SerialPort
from tests.support.command_line.typed import typed
from tests.support.paths import ROOT

USB = "2341:0043"
BY_ID = "/dev/serial/by-id/usb-Arduino__www.arduino.cc__0043_95735353032351F0C1B2-if00"
PAGE = (ROOT / "docs" / "pages" / "how_to" / "service.md").read_text()


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with a board without a persistent name.

    Programs that change the system only note how they were called.
    """
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in ("useradd", "udevadm", "systemctl", "rm"):
        (programs / name).write_text(f'#!/bin/sh\necho "{name} $*" >> {tmp_path}/calls\n')
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(programs))
    monkeypatch.setattr(service_files, "UNIT", tmp_path / "armtree.service")
    monkeypatch.setattr(service_files, "RULE", tmp_path / "90-armtree.rules")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(sys, "prefix", "/opt/armtree")
    monkeypatch.setattr(sys, "base_prefix", "/usr")
    monkeypatch.chdir("/opt")
    (tmp_path / "ttyACM0").touch()
    boards(monkeypatch, tmp_path, "")
    return tmp_path


def boards(patch: pytest.MonkeyPatch, machine: Path, *names: str) -> None:
    """Connect equal boards: ttyACM0, ttyACM1 ... with these persistent names."""
    ports = [
        SerialPort(f"{machine}/ttyACM{k}", "Arduino Uno", USB, name) for k, name in enumerate(names)
    ]
    patch.setattr(service, "serial_ports", lambda: ports)


def install(machine: Path, *options: str) -> tuple[int, str, str]:
    return typed(machine, "service", "install", "--port", str(machine / "ttyACM0"), *options)


def remove(machine: Path) -> list[str]:
    """The calls of a removal."""
    assert typed(machine, "service", "remove", "--yes")[0] == 0
    return calls(machine)


def calls(machine: Path) -> list[str]:
    made = machine / "calls"
    return made.read_text().splitlines() if made.exists() else []


def test_a_dry_run_shows_all_and_changes_nothing(machine: Path) -> None:
    status, out, error = install(machine, "--dry-run", "--robot", "so101")
    assert (status, error) == (0, "")
    assert f"# {machine}/armtree.service\n[Unit]\n" in out
    assert "serve --port /dev/armtree --robot so101\n" in out
    assert "useradd --system --groups dialout armtree\n" in out
    assert calls(machine) == []
    assert not (machine / "armtree.service").exists()


def test_what_is_shown_is_done(machine: Path) -> None:
    status, out, _ = install(machine, "--yes")
    assert status == 0
    assert out.endswith("The service runs. Its log: journalctl -u armtree\n")
    unit = (machine / "armtree.service").read_text()
    rule = (machine / "90-armtree.rules").read_text()
    assert unit in out
    assert rule in out
    assert calls(machine) == [
        "useradd --system --groups dialout armtree",
        "udevadm control --reload",
        "udevadm trigger --action=add --subsystem-match=tty",
        "systemctl daemon-reload",
        "systemctl enable armtree.service",
        "systemctl restart armtree.service",
    ]


def test_a_virtual_board_needs_no_rule(machine: Path) -> None:
    status, out, _ = typed(machine, "service", "install", "--port", "virtual", "--dry-run")
    assert status == 0
    assert "serve --port virtual\n" in out
    assert "udev" not in out


def test_a_board_with_a_persistent_name_needs_no_rule(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An equal board has another persistent name."""
    boards(monkeypatch, machine, BY_ID, f"{BY_ID}-other")
    status, out, error = install(machine, "--dry-run")
    assert (status, error) == (0, "")
    assert f"serve --port {BY_ID}\n" in out
    assert "udev" not in out


@pytest.mark.parametrize("names", [("", ""), (BY_ID, "")])
def test_equal_boards_that_no_name_distinguishes_are_refused(
    machine: Path, monkeypatch: pytest.MonkeyPatch, names: tuple[str, ...]
) -> None:
    """Boards without a serial number have the same persistent name; only one of them gets it."""
    boards(monkeypatch, machine, *names)
    status, _, error = install(machine, "--yes")
    assert (status, calls(machine)) == (2, [])
    assert f"2 serial ports have the USB id {USB}" in error


def test_a_robot_file_is_quoted_in_the_unit() -> None:
    robot = Path('/srv/50% "arm" $x/a.toml')
    line = next(
        x for x in unit_text(Path("/a/armtree"), "virtual", robot).splitlines() if "Ex" in x
    )
    quoted = r'"/srv/50%% \"arm\" $$x/a.toml"'
    assert line == f"ExecStart=/a/armtree serve --port virtual --robot {quoted}"


@pytest.mark.parametrize(
    "folder",
    ["/home/me", "/root", "/run/user/1000", "/tmp", "/var/tmp"],
)
def test_what_the_service_cannot_read_is_refused(
    machine: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    monkeypatch.setattr(sys, "base_prefix", f"{folder}/python")
    status, _, error = install(machine, "--yes")
    assert (status, calls(machine)) == (2, [])
    assert f"the service cannot read {folder}/python" in error
    status, out, error = install(machine, "--dry-run")
    assert (status, "ExecStart=" in out) == (0, True)
    assert f"This would be refused: the service cannot read {folder}/python" in error


def test_a_shipped_robot_is_no_file_of_the_current_folder(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(machine)  # a folder for temporary files, as pytest uses
    monkeypatch.setattr(service_files, "_HIDDEN", (f"{machine}/so101",))
    assert install(machine, "--dry-run", "--robot", "so101")[0] == 0


def test_a_removal_undoes_it(machine: Path) -> None:
    install(machine, "--yes")
    (machine / "calls").unlink()
    assert remove(machine) == [
        "systemctl disable --now armtree.service",
        f"rm -f {machine}/armtree.service {machine}/90-armtree.rules",
        "systemctl daemon-reload",
        "udevadm control --reload",
    ]


def test_a_removal_cleans_an_installation_that_failed(machine: Path) -> None:
    (machine / "90-armtree.rules").touch()
    assert remove(machine)[0] == f"rm -f {machine}/armtree.service {machine}/90-armtree.rules"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            lambda patch, machine: patch.setattr(os, "geteuid", lambda: 1),
            "this needs root; type: sudo /opt/armtree service install --port /",
        ),
        (lambda patch, machine: patch.setenv("PATH", "/none"), "not installed: systemctl, udevadm"),
        (
            lambda patch, machine: patch.setattr(sys, "prefix", "/root/env"),
            "is in a home or temporary folder",
        ),
        (lambda patch, machine: (machine / "ttyACM0").unlink(), "ttyACM0 does not exist; plug"),
        (
            lambda patch, machine: (machine / "bin" / "systemctl").write_text("#!/bin/sh\nexit 5"),
            "`systemctl daemon-reload` failed with status 5",
        ),
    ],
)
def test_what_prevents_it_is_named(
    machine: Path, monkeypatch: pytest.MonkeyPatch, change: object, why: str
) -> None:
    assert callable(change)
    change(monkeypatch, machine)
    status, _, error = install(machine, "--yes")
    assert status == 2
    assert why in error


def test_a_wrong_robot_is_not_installed(machine: Path) -> None:
    status, _, error = install(machine, "--yes", "--robot", "none.toml")
    assert (status, calls(machine)) == (3, [])
    assert "none.toml" in error


def test_an_answer_of_no_changes_nothing(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("click.confirm", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
    assert install(machine)[0] == 130
    assert calls(machine) == []


def test_the_page_shows_the_same_files() -> None:
    assert unit_text(Path("/opt/armtree/bin/armtree"), BY_ID) in PAGE
    assert udev_rule(USB) in PAGE


def test_the_page_promises_what_systemd_is_told() -> None:
    """The server reports at half of the watchdog's timeout: tests/executive/server/systemd."""
    lines = unit_text(Path("/a/armtree"), "virtual").splitlines()
    unit = dict(line.split("=", 1) for line in lines if "=" in line)
    assert unit["Type"] == "notify"  # else systemd does not listen to the reports
    assert unit["Restart"] == "on-failure"  # of a crash, and of a watchdog that ends
    seconds = int(unit["WatchdogSec"])
    assert f"again if the server crashes or hangs for {seconds} s." in PAGE
    reports = f"reports to systemd every {seconds / 2:g} s. If it does not for {seconds} s, systemd"
    assert reports in PAGE
