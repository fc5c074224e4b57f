"""Task files that change while a server runs."""

import os
from pathlib import Path

import pytest

from executive.errors import NoSuchNode
from executive.goals.breakpoints import check_node
from hardware import Robot
from trees import FileError, UnknownTask
from trees.live_library import LiveLibrary

TASK = "task: 7\nname: say\ndescription: Say.\ntree:\n  Say: {text: %s}\n"


class Files:
    """A folder, and the library that looks at it."""

    def __init__(self, folder: Path, robot: Robot) -> None:
        self.path = folder / "7_say.yaml"
        self.path.write_text(TASK % "one")
        self.library = LiveLibrary(folder, robot)

    def says(self) -> str:
        """The text of the task, as a goal would get it now."""
        library, self.warning = self.library.for_task(7)
        assert library.for_task(7) == (library, "")  # in the middle of a goal it stays as it is
        task, mistakes = library.draft(7)
        assert mistakes == []
        return task.text.partition("text: ")[2].partition("}")[0]


@pytest.fixture
def files(tmp_path: Path, robot: Robot) -> Files:
    return Files(tmp_path, robot)


def test_a_change_shows_at_the_next_goal(files: Files) -> None:
    assert files.says() == "one"
    held, _ = files.library.for_task(7)
    files.path.write_text(TASK % "three")
    assert held.draft(7)[0].text == TASK % "one"
    assert files.says() == "three"


def test_where_a_goal_can_pause_is_known_of_the_tasks_there_are_now(
    files: Files, tmp_path: Path
) -> None:
    check_node(files.library, "say")
    check_node(files.library, "pick/parallel/PlanArm")
    with pytest.raises(NoSuchNode, match="no task is called hush"):
        check_node(files.library, "hush")
    (tmp_path / "8_hush.yaml").write_text("task: 8\nname: hush\ndescription: x\ntree: Succeed\n")
    check_node(files.library, "hush")


def test_a_folder_for_the_robot_may_come_later(files: Files, tmp_path: Path) -> None:
    assert 8 not in files.library.latest.names().values()
    (tmp_path / "arduinobot").mkdir()
    late = tmp_path / "arduinobot" / "8_hush.yaml"
    late.write_text("task: 8\nname: hush\ndescription: x\ntree: Succeed\n")
    assert files.library.latest.names()["hush"] == 8


def test_a_default_folder_may_come_later(tmp_path: Path, robot: Robot) -> None:
    default = tmp_path / "trees"
    library = LiveLibrary(None, robot, default)
    assert (library.folder, 8 in library.latest.numbers()) == (None, False)
    default.mkdir()
    (default / "8_hush.yaml").write_text("task: 8\nname: hush\ndescription: x\ntree: Succeed\n")
    assert library.latest.names()["hush"] == 8
    assert library.folder == default
    assert 8 not in LiveLibrary(None, robot).latest.numbers()


def test_a_change_by_renaming_too(files: Files, tmp_path: Path) -> None:
    assert files.says() == "one"
    other = tmp_path / "new"
    other.write_text(TASK % "two")
    os.utime(other, ns=(files.path.stat().st_mtime_ns,) * 2)
    other.replace(files.path)
    assert files.says() == "two"


@pytest.mark.parametrize(
    "wrong",
    ["task: 7\nname: [", TASK % "$unknown", "task: 8\n", "", "task: 7\nname: x\ntree: {}\n"],
)
def test_a_wrong_one_is_reported_and_the_last_good_one_kept(files: Files, wrong: str) -> None:
    files.path.write_text(wrong)
    assert files.says() == "one"
    assert "Task 7 runs in its last valid version" in files.warning
    assert "7_say.yaml" in files.warning
    files.path.write_text(TASK % "two")
    assert files.says() == "two"
    assert not files.warning
    files.path.write_text(wrong)
    assert files.says() == "two"


def test_one_that_a_skill_refuses_is_wrong_too(files: Files, robot: Robot, tmp_path: Path) -> None:
    refused = "task: 7\nname: say\ndescription: x\ntree: {Attach: {body: b, link: nolink}}\n"
    files.path.write_text(refused)
    assert files.says() == "one"
    assert "the robot has no link nolink" in files.warning
    never_right = LiveLibrary(tmp_path, robot)  # then the goal says it, with its own code
    assert never_right.for_task(7)[0].draft(7)[0].text == refused


def test_so_are_a_subtree_and_poses_that_became_wrong(files: Files, tmp_path: Path) -> None:
    files.path.write_text("task: 7\nname: go\ndescription: Go.\ntree:\n  subtree: mine\n")
    mine = tmp_path / "mine.yaml"
    mine.write_text("subtree: mine\ndescription: Mine.\nports: {}\ntree:\n  Succeed: {}\n")
    good, _ = files.library.for_task(7)
    mine.write_text("subtree: mine\ntree: 3\n")
    assert files.library.for_task(7)[0].draft(7) == good.draft(7)
    mine.unlink()
    assert files.library.for_task(7)[0].draft(7) == good.draft(7)


def test_one_that_never_was_right_is_refused(files: Files) -> None:
    files.path.with_name("8_say.yaml").write_text("task: 8\nname: [")
    with pytest.raises(FileError):
        files.library.for_task(8)


@pytest.mark.parametrize("wrong", ["7_other.yaml", "say.yml", "mine.yaml", "8_x.yaml"])
def test_a_file_costs_only_its_own_number(files: Files, tmp_path: Path, wrong: str) -> None:
    (tmp_path / "9_say.yaml").write_text((TASK % "nine").replace("task: 7", "task: 9"))
    (tmp_path / wrong).write_text(TASK % "two")
    library, warning = files.library.for_task(9)
    assert library.draft(9)[0].text.endswith("nine}\n")
    assert not warning
    assert files.says() == "one"
    assert bool(files.warning) == wrong.startswith("7")
    rows = {row["task"]: bool(row["wrong"]) for row in files.library.listed()}
    assert not rows[9]
    assert rows[7] == wrong.startswith("7")
    assert rows.get(8, False) == wrong.startswith("8")


def test_tasks_go_on_as_they_were_without_their_folder(files: Files, tmp_path: Path) -> None:
    tmp_path.rename(tmp_path.with_name("away"))
    assert files.says() == "one"
    assert "there is no such folder" in files.warning
    with pytest.raises(FileError):
        files.library.listed()


def test_one_that_is_gone_is_gone_and_a_new_one_is_there(files: Files, tmp_path: Path) -> None:
    assert files.says() == "one"
    files.path.rename(tmp_path / "8_say.yaml")
    with pytest.raises(UnknownTask):
        files.library.for_task(7)
    (tmp_path / "8_say.yaml").write_text((TASK % "two").replace("task: 7", "task: 8"))
    assert files.library.for_task(8)[0].draft(8)[0].number == 8
    assert 8 in {row["task"] for row in files.library.listed()}


@pytest.mark.parametrize("number", [9, 77])
def test_an_error_that_is_raised_often_keeps_nothing_alive(files: Files, number: int) -> None:
    """A traceback holds the frames of its callers, and a server raises an error again."""
    files.path.with_name("9_say.yaml").write_text("task: 9\nname: [")

    def frames() -> int:
        with pytest.raises(FileError if number == 9 else UnknownTask) as caught:
            files.library.for_task(number)
        return len(caught.traceback)

    assert frames() == frames() == frames()
