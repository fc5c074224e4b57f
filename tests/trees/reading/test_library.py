"""Finding files: those that ship, and a folder of one's own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import TASKS
from trees import FileError, Library, UnknownTask
from trees.errors import DuplicateTask

TASK = "task: {number}\nname: x\ndescription: y\ntree: Succeed\n"
SUBTREE = "subtree: reach\ndescription: y\nports: {}\ntree: Succeed\n"


def write(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder


def test_what_ships() -> None:
    library = Library()
    assert library.numbers() == [0, 1, 2]
    assert [library.task(n).name for n in library.numbers()] == ["home", "pick", "rest"]
    assert library.draft("reach")[0].parameters.keys() == {"arm", "gripper"}


def test_a_folder_on_top(tmp_path: Path) -> None:
    library = Library(write(tmp_path, "007_x.yaml", TASK.format(number=7)))
    assert library.numbers() == [0, 1, 2, 7]
    assert library.task(7).path == tmp_path / "007_x.yaml"


def test_the_shipped_folder_counts_once(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(TASKS)
    for shipped in (TASKS, TASKS / "arduinobot", tmp_path / "link"):
        assert Library(shipped).numbers() == [0, 1, 2]


def test_tasks_and_poses_belong_to_a_robot(tmp_path: Path) -> None:
    (tmp_path / "lift").mkdir()
    (tmp_path / "other").mkdir()
    write(tmp_path, "4_x.yaml", TASK.format(number=4))
    write(tmp_path / "lift", "5_x.yaml", TASK.format(number=5))
    write(tmp_path / "lift", "poses.yaml", "poses: {low: {height: 0}}\n")
    write(tmp_path / "other", "6_x.yaml", "no YAML: [")
    lift = Library(tmp_path, "lift")
    assert (lift.numbers(), list(lift.poses()[0]), lift.mistakes) == ([4, 5], ["low"], [])
    assert "open_gripper" not in lift.subtrees()
    assert Library(None, "lift").numbers() == []
    assert Library(tmp_path).numbers() == [0, 1, 2, 4]


def test_poses_of_no_folder_are_for_the_shipped_robot(tmp_path: Path) -> None:
    write(tmp_path, "poses.yaml", "poses: {left: {joint_1: 0}}\n")
    assert "left" in Library(tmp_path).poses()[0]
    so101 = Library(tmp_path, "so101")
    assert "joint_1" not in so101.poses()[0].get("left", {})
    (note,) = so101.notes
    assert "poses.yaml: is not read: its poses are for the arduinobot; the poses of the" in str(
        note
    )


@pytest.mark.parametrize("name", ["", ".", "..", "../tasks", "a/b", "x" * 1000, "\0"])
def test_a_robot_of_any_name_has_no_tasks_elsewhere(tmp_path: Path, name: str) -> None:
    assert Library(tmp_path, name).numbers() == []


def test_a_shipped_task_is_unknown_to_another_robot() -> None:
    with pytest.raises(UnknownTask, match=r"none\. No task is for the robot lift; `armtree new`"):
        Library(None, "lift").task(0)


def test_an_unknown_number() -> None:
    for number in (3, -1, 10**30):
        with pytest.raises(UnknownTask, match=f"Invalid task number {number}; there are 0, 1, 2"):
            Library().task(number)


def test_two_files_with_one_number(tmp_path: Path) -> None:
    with pytest.raises(
        DuplicateTask,
        match=r"01_x.yaml:1:1: task 1 is in two files, .*1_pick.yaml and .*01_x.yaml: "
        "add the line replaces: pick, or give this task another number, such as 3, in its file "
        r"name and at its key task\n    task: 1\n",
    ):
        Library(write(tmp_path, "01_x.yaml", TASK.format(number=1))).task(1)


def test_a_number_claimed_twice_costs_no_other(tmp_path: Path) -> None:
    write(tmp_path, "3_a.yaml", TASK.format(number=3))
    write(tmp_path, "3_b.yaml", "name: [")
    library = Library(write(tmp_path, "4_x.yaml", TASK.format(number=4)))
    assert library.task(4).number == 4
    assert library.numbers() == [0, 1, 2, 3, 4]
    with pytest.raises(
        DuplicateTask, match=r"3_a.yaml and .*3_b.yaml: give one of them another number, such as 5,"
    ):
        library.head(3)
    assert [m.place.path.name for m in library.mistakes] == ["3_b.yaml"]


def test_two_files_with_one_subtree(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"reach.yaml:1:1: subtree reach is in .* already"):
        Library(write(tmp_path, "reach.yaml", SUBTREE)).draft("reach")


@pytest.mark.parametrize("name", ["3.yaml", "3-x.yaml", "3_x.yml", "3x.yaml", "3_two words.yaml"])
def test_a_task_file_that_is_almost_named_like_one(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"named like 3_x\.yaml"):
        Library(write(tmp_path, name, TASK.format(number=3))).task(3)


def test_a_task_file_that_was_saved_as_a_text_is_a_note(tmp_path: Path) -> None:
    (note,) = Library(write(tmp_path, "3_x.yaml.txt", TASK.format(number=3))).notes
    assert note.message == "is not read, because its name ends in .txt; rename it to 3_x.yaml"


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    for name in ("README.md", "notes.txt", "3_wave.yaml.bak", "\u0663_x.yaml", ".hidden"):
        write(tmp_path, name, "")
    (tmp_path / "folder").mkdir()
    assert Library(tmp_path).numbers() == [0, 1, 2]


def test_a_number_that_the_file_contradicts(tmp_path: Path) -> None:
    library = Library(write(tmp_path, "3_x.yaml", TASK.format(number=4)))
    with pytest.raises(
        FileError, match=r"3_x.yaml:1:1: the file is named for task 3 but says task 4"
    ):
        library.task(3)


def test_a_subtree_that_the_file_contradicts(tmp_path: Path) -> None:
    text = "subtree: b\ndescription: y\nports: []\ntree: Succeed\n"
    library = Library(write(tmp_path, "a.yaml", text))
    _, (mistake,) = library.draft("a")
    assert "a.yaml:1:1: the file is named a.yaml but says subtree b" in str(mistake)


def test_folders_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name in ("none", "file", "loop"):
        with pytest.raises(FileError, match=f"{name}: there is no such folder") as refused:
            Library(tmp_path / name)
        assert refused.value.hint == "check the path of the folder"


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "3_folder.yaml").mkdir()
    (tmp_path / "4_loop.yaml").symlink_to(tmp_path / "4_loop.yaml")
    os.mkfifo(tmp_path / "5_pipe.yaml")
    (tmp_path / "6_gone.yaml").symlink_to(tmp_path / "gone")
    library = Library(tmp_path)
    for number in (3, 4, 5, 6):
        with pytest.raises(FileError, match=rf"{number}_\w+.yaml:1:1: "):
            library.task(number)


def test_a_list_of_tasks_needs_neither_skills_nor_py_trees() -> None:
    code = "import sys; from trees import Library; [Library().head(n) for n in Library().numbers()]"
    code += "; sys.exit({'numpy', 'py_trees', 'skills'} & set(sys.modules) or None)"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0


def test_an_unknown_task_may_be_of_another_robot_or_a_pose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "arm5").mkdir()
    (tmp_path / "arm5/1_grab.yaml").touch()
    (tmp_path / "arm5/7_lift.yaml").touch()
    library = Library(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        UnknownTask, match=r"^grab is a task of arm5: give its robot file with --robot$"
    ):
        library.number("grab")
    (tmp_path / "arm5.toml").touch()
    with pytest.raises(UnknownTask, match=r"^7 is a task of arm5: add --robot arm5.toml$"):
        library.path(7)
    with pytest.raises(
        UnknownTask, match="folded is a pose, not a task: run `armtree move folded`"
    ):
        library.number("folded")
    with pytest.raises(UnknownTask, match=r"^reach is a subtree, not a task: `subtree: reach` in"):
        library.number("reach")


@pytest.mark.parametrize("task", ["wave", 3])
def test_a_task_in_a_file_without_its_number_is_found(tmp_path: Path, task: str | int) -> None:
    library = Library(write(tmp_path, "wave.yaml", TASK.format(number=3)))
    why = r"wave\.yaml:1:1: this is a task; its file needs a name like 3_x\.yaml: rename it"
    with pytest.raises(FileError, match=why):
        library.path(library.number(task))
