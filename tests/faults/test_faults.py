"""The faults of the quick selection, and the comparison of a board's log with a recording."""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest

from tests.faults.machine import Busy, measured
from tests.faults.process import kill, processes, until, variables_of
from tests.faults.row import Row, Scene, compare, inject, verify
from tests.faults.rows.host import shifts
from tests.faults.rows.planning import command_line
from tests.faults.run import PAGE, SOAK, examined, found, main, promised, rows
from tests.faults.soaking.figures import Sample, growth

PROGRAM = Path(__file__).with_name("run.py")
ONE, TWO, THREE = b"b090,s090,e090,g000,", b"b091,s090,e090,g000,", b"b092,s090,e090,g000,"


@pytest.mark.parametrize(
    ("board", "recording", "found"),
    [
        (ONE + TWO, ONE + TWO, (0, 0)),
        (ONE, ONE + TWO, (0, 1)),
        (ONE + TWO[:7], ONE + TWO, (0, 1)),
        (ONE + TWO, ONE, (1, 0)),
        (ONE + THREE, ONE + TWO + THREE, (0, 1)),
        (ONE + THREE + TWO, ONE + TWO + TWO, (1, 1)),
        (b"?" + ONE, ONE, (1, 0)),
    ],
)
def test_a_difference_between_board_and_recording_is_found(
    board: bytes, recording: bytes, found: tuple[int, int]
) -> None:
    assert compare(board, recording) == found


def test_every_row_has_its_name() -> None:
    names = [one.name for one in rows()]
    assert len(set(names)) == len(names) > 40


@pytest.mark.parametrize(
    ("unit", "figure", "busy", "held"),
    [
        ("ms", 50.0, Busy(0.0, 1.0), True),
        ("ms", 51.0, Busy(0.0, 9.0), False),
        ("ms", 51.0, Busy(0.001, 1.0), True),
        ("s", 51.0, Busy(9.0, 1.0), False),
        ("s", 100.0, Busy(0.0, 2.0), True),
        ("s", 101.0, Busy(0.0, 9.0), False),  # no limit is more than doubled
        ("ms", 101.0, Busy(0.2, 1.0), False),
        ("MiB", 51.0, Busy(9.0, 9.0), False),
    ],
)
def test_a_limit_of_time_is_extended_on_a_busy_machine(
    tmp_path: Path, unit: str, figure: float, busy: Busy, held: bool
) -> None:
    scene = Scene(tmp_path, "")
    scene.figure(figure)
    one = Row("a", "b", "c", lambda _: None, limit=50, unit=unit)
    assert found(one, [scene], 1.0, busy).held is held


def test_each_kind_of_figure_has_the_limit(tmp_path: Path) -> None:
    """Few slow ones do not hide among many quick ones."""
    scene = Scene(tmp_path, "")
    for _ in range(500):
        scene.figure(1.0, "standing")
    scene.figure(51.0, "in motion")
    one = Row("a", "b", "c", lambda _: None, limit=50, unit="ms")
    finding = found(one, [scene], 1.0, Busy(0.0, 1.0))
    assert (finding.held, finding.p99, finding.median) == (False, 51.0, 1.0)


@pytest.mark.parametrize(
    ("times", "gain"),
    [
        ([5.0, 5.1, 5.2, 5.3, 5.4], 0.0),
        ([5.0, 5.19, 5.2, 5.3, 5.4], 0.09),  # a frame that was late
        ([5.0, 5.5, 5.6, 5.7, 5.8], 0.0),  # the rest is later
        ([5.0, 5.5, 5.5, 5.5, 5.5], 0.3),  # a burst
    ],
)
def test_a_burst_is_found(times: list[float], gain: float) -> None:
    """Two motions; the last one is incomplete."""
    motions = [[0.0, 0.1, 0.2, 0.3, 0.4], [0.0, 0.1]]
    found = [each for each, _ in shifts([*times, 7.0], motions)]
    assert len(found) == 6
    assert max(found) == pytest.approx(gain)


def test_what_fails_at_the_end_is_a_problem_and_nothing_is_left(tmp_path: Path) -> None:
    cleaned = list[str]()

    def wrong(scene: Scene) -> None:
        scene.cleanup.callback(cleaned.append, "cleaned")
        scene.finish = lambda: 1 / 0  # type: ignore[method-assign,assignment]

    scene = inject(Row("a", "b", "c", wrong), tmp_path / "a", "")
    assert scene.problems == ["at the end: ZeroDivisionError: division by zero"]
    assert cleaned == ["cleaned"]


def test_a_problem_names_a_board_that_did_not_run(tmp_path: Path) -> None:
    def late(scene: Scene) -> None:
        board = scene.board()
        kill(board.pid, signal.SIGSTOP)
        time.sleep(0.2)  # noqa: TID251, so long it does not run
        kill(board.pid, signal.SIGCONT)
        scene.check(False, "late")

    scene = inject(Row("a", "b", "c", late), tmp_path / "a", "")
    first, second = scene.problems
    assert first == "late"
    assert second.startswith("the program of the board did not run for 0.")


VERIFY = """
import json, sys
for folder in sys.argv[2:-2]:
    holds, code = {"differs": (False, ""), "cut": (True, "log.truncated"), "well": (True, "")}[
        folder.split("/")[-3]
    ]
    found = {"path": f"{folder}/1.mcap", "verdicts": [{"holds": holds}], "code": code}
    print(json.dumps(found))
sys.exit(12)
"""


def test_one_command_verifies_the_recordings_of_a_row(tmp_path: Path) -> None:
    """What holds in one injection excuses no other."""
    wanted = [("well", 0), ("cut", 0), ("cut", 10), ("well", 10), ("differs", 10), ("none", 0)]
    asked = [Scene(tmp_path / name / str(status), "") for name, status in wanted]
    for one, (name, status) in zip(asked, wanted, strict=True):
        (one.folder / "recordings").mkdir(parents=True)
        if name != "none":
            (one.folder / "recordings" / "1.mcap").touch()
        one.verified(status)
    scene, begin = Scene(tmp_path, ""), (sys.executable, "-Ic", VERIFY)
    scene.armtree = partial(scene.armtree, argv=begin)  # type: ignore[method-assign]
    verify(asked, scene)
    scene.finish()
    assert scene.problems == []
    assert [one.problems for one in asked] == [
        [],
        ["replay --verify: {'1.mcap': 10}, not (0,)"],
        [],
        ["replay --verify: {'1.mcap': 0}, not (10,)"],
        ["replay --verify: {'1.mcap': 12}, not (10,)"],
        ["replay --verify: no recording, not (0,)"],
    ]


@pytest.mark.slow
def test_a_machine_is_measured() -> None:
    busy = measured()
    assert busy.delay > 0.0
    assert busy.slowdown >= 1.0


def test_a_fault_does_not_extend_its_own_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine is busy only while the fault is injected."""
    order = list[str]()

    def measure() -> Busy:
        order.append("measured")
        return Busy(0.0, 1.0)

    def inject(scene: Scene) -> None:
        order.append(scene.folder.name)
        scene.figure(51.0)

    monkeypatch.setattr("tests.faults.run.measured", measure)
    one = Row("a", "b", "c", inject, limit=50, unit="ms")
    alone = dataclasses.replace(one, name="d", alone=True)
    findings = examined([(alone, 2), (one, 1)], 1, tmp_path, keep=False, jobs=1)
    assert [each.held for each in findings] == [False, False]
    assert order == ["measured", "a-0", "measured", "d-0", "d-1"]


@pytest.mark.parametrize("alone", [False, True])
def test_no_row_runs_on_the_thread_that_a_signal_interrupts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: bool
) -> None:
    """There, a signal may come after a process has started, and before the row knows it."""
    threads = list[threading.Thread]()
    monkeypatch.setattr("tests.faults.run.measured", lambda: Busy(0.0, 1.0))
    one = Row("a", "b", "c", lambda _: threads.append(threading.current_thread()), alone=alone)
    examined([(one, 1)], 1, tmp_path, keep=False, jobs=1)
    assert len(threads) == 1
    assert threading.main_thread() not in threads


@pytest.mark.parametrize("part", [["--only", "limits"], ["--times", "1"], ["--quick"]])
def test_a_page_is_of_all_rows(tmp_path: Path, part: list[str]) -> None:
    with pytest.raises(SystemExit):
        main([*part, "--page", str(tmp_path / "page.md")])
    assert not list(tmp_path.iterdir())


def test_the_page_lists_the_rows_that_there_are() -> None:
    """`make faults` writes the page."""
    text, head = PAGE.read_text(), PROGRAM.with_name("page.md").read_text()
    assert text.startswith(head), "run `make faults`: tests/faults/page.md has changed"
    first, _, header, _, *table = text.removeprefix(head).partition(SOAK)[0].strip().splitlines()
    words = r"rows, seed \d+, \d+ minutes, \d+ cores, \w+ [\d.]+, load average [\d.]+\."
    assert re.fullmatch(f"{len(table)} {words}", first), "the page has what no program has written"
    assert header.startswith("| row |")
    lines = [line[2:].split(" | ") for line in table]
    listed = [
        (name, fault.partition("; here by ")[0], promise, limit)
        for name, fault, promise, _times, _held, limit, *_ in lines
    ]
    there = [
        (f"`{one.name}`", one.fault, one.promise, promised(one.limit, one.worst, one.unit))
        for one in rows()
    ]
    assert listed == there, "run `make faults`: the rows have changed"


@pytest.mark.slow
def test_the_quick_selection_holds(tmp_path: Path) -> None:
    """What holds is asserted, not how quickly: other tests run at the same time."""
    found = tmp_path / "found.json"
    command = [sys.executable, str(PROGRAM), "--quick", "--json", str(found)]
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    assert found.exists(), run.stdout + run.stderr
    rows = json.loads(found.read_text())
    assert len(rows) > 2
    assert {row["row"]: row["problems"] for row in rows if row["problems"]} == {}, run.stdout


def under(folder: Path) -> list[int]:
    """The processes that a program of faults with this folder has started."""
    name = str(folder).encode()
    return [pid for pid in processes() if any(name in each for each in variables_of(pid))]


@pytest.mark.slow
@pytest.mark.parametrize("row", ["frozen-server", "many-goals", "starved"])
def test_sigterm_ends_all_that_was_started(tmp_path: Path, row: str) -> None:
    command = [sys.executable, str(PROGRAM), "--only", row]
    variables = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, env=variables, stdout=subprocess.DEVNULL) as program:
        until("a command", lambda: list(tmp_path.glob("*/*/*.out")))
        until("its process", lambda: len(under(tmp_path)) > 2)
        program.terminate()
        assert program.wait(60) == 130
    until("the end of all", lambda: not under(tmp_path))


@pytest.mark.slow
def test_sigterm_ends_a_soak(tmp_path: Path) -> None:
    """Also the hostile clients, which never end by themselves; this seed begins with them."""
    program = str(PROGRAM.with_name("soak.py"))
    command = [sys.executable, program, "--minutes=5", "--seed=509"]
    variables = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, env=variables, stdout=subprocess.DEVNULL) as soak:
        until("a flood", lambda: any("hostile.py" in command_line(one) for one in under(tmp_path)))
        soak.terminate()
        assert soak.wait(60) == 130
    until("the end of all", lambda: not under(tmp_path))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_short_soak_finds_nothing(tmp_path: Path) -> None:
    """One round."""
    found, program = tmp_path / "found.json", Path(__file__).with_name("soak.py")
    command = [sys.executable, str(program), "--minutes=0.1", "--seed=5", f"--json={found}"]
    run = subprocess.run(command, check=False, capture_output=True, text=True)
    assert found.exists(), run.stdout + run.stderr
    soak = json.loads(found.read_text())
    # Other tests run meanwhile.
    slow = [each for each in soak["problems"] if "of the stops" in each]
    assert [each for each in soak["problems"] if each not in slow] == []
    assert 0 < soak["stop_ms"]["median"] <= soak["stop_ms"]["p99"] <= soak["stop_ms"]["worst"]
    assert soak["recordings"] > 1
    assert sum(soak["acts"].values()) > 3
    assert soak["samples"][-1]["processes"] in (1, 2, 3)  # a planner, and a writer of recordings


def sample(descriptors: int) -> Sample:
    return Sample(1.0, 1, 1, 1, 60.0, 100.0, descriptors, 9, 2, 10, 0, 0)


@pytest.mark.parametrize(
    ("descriptors", "found"),
    [
        ([20] * 12, []),
        ([9, 14, 19, 20, 21, 19, 20, 21, 20, 19, 22, 21], []),
        (list(range(20, 32)), ["descriptors grows from 23.5 to 31"]),
        ([20, 30, 40], []),  # too few to know
        ([22] * 35 + [64] * 5, ["descriptors grows from 22 to 64"]),
        ([22] * 39 + [64], ["descriptors grows from 22 to 64"]),
    ],
)
def test_a_figure_that_grows_in_a_soak_is_found(descriptors: list[int], found: list[str]) -> None:
    assert growth([sample(each) for each in descriptors]) == found


@pytest.mark.parametrize(("rounds", "found"), [(15, []), (8, ["threads grows from 22 to 27"])])
def test_a_leak_of_a_thread_per_200_goals_is_found_in_a_soak(rounds: int, found: list[str]) -> None:
    """A round has about 25 goals. Pools start at most 3 threads after the first quarter."""
    samples = [dataclasses.replace(sample(22), threads=20 + n // rounds) for n in range(60)]
    assert growth(samples) == found
