"""Arguments that name a task, a recording, a port or a node, and their shell completion."""

import re
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from executive.cli.settings import find_setting

if TYPE_CHECKING:
    from hardware import Robot
    from trees import Library

_LARGEST = 2**31 - 1
_SHOWN = 50  # largest number of offered recordings

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def completing(names: Callable[[click.Context, str], Iterable[tuple[str, str]]]) -> Complete:
    """Return a function that completes a word.

    After an error, the function returns no completions: a shell would print the error into the
    line that the user edits.

    Args:
        names: Callback that gets a context and the typed part of a word. It returns possible names
            with their descriptions.
    """

    @wraps(names)
    def complete(
        context: click.Context, _parameter: click.Parameter, word: str
    ) -> list[CompletionItem]:
        try:
            found = [pair for pair in names(context, word) if pair[0] and pair[0].startswith(word)]
        except Exception:
            return []
        return [CompletionItem(name, help=about or None) for name, about in found]

    return complete


def check_goal_id(context: click.Context, parameter: click.Parameter, value: str) -> str:
    """Return the id of a goal. Raise a usage error for any other text."""
    if value and not re.fullmatch("[0-9a-f]{32}", value):
        why = "is not the id of a goal, which has 32 digits, 0 to 9 and a to f"
        raise click.BadParameter(f"{value!r} {why}")
    return value


def load_library(trees: Path | None, robot: Path | None) -> "tuple[Robot, Library]":
    """Return the robot of a robot file, and the library of its tasks.

    Raises:
        DescriptionError: The robot file or its URDF is wrong.
        FileError: The folder of tasks cannot be read.
    """
    from hardware import load_robot
    from trees import Library

    loaded = load_robot(robot)
    return loaded, Library(trees, loaded.name)


def first_motion(robot: "Robot") -> list[str]:
    """Return a command that works without a task: it moves the first joint a little."""
    joint = robot.actuated[0]
    step, unit = (0.005, "5mm") if joint.unit == "m" else (0.0873, "5deg")
    sign = "" if joint.boot + step <= joint.upper else "-"
    return ["move", f"{joint.name}+={sign}{unit}"]


def _chosen(context: click.Context) -> "tuple[Robot, Library]":
    """Return the robot and the library of --robot and --trees before the word, or of settings."""
    trees, robot = (
        context.params.get(name) or find_setting(context, name)[0] for name in ("trees", "robot")
    )
    return load_library(trees, robot)


@completing
def complete_task(context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    """Complete the name of a task."""
    for name, number in _chosen(context)[1].names().items():
        yield name, f"task {number}"


def _pose_names(library: "Library") -> set[str]:
    from executive.api.move import HOME

    return {HOME, *library.poses()[0]}


@completing
def complete_pose(context: click.Context, _word: str) -> Iterable[tuple[str, str]]:
    """Complete the name of a pose."""
    return ((name, "pose") for name in _pose_names(_chosen(context)[1]))


def _target_words(robot: "Robot", library: "Library") -> Iterator[tuple[str, str]]:
    """Yield the poses, `JOINT=` for each joint, and `width=`, each with a description."""
    from hardware.description.gripper import WIDTH

    yield from ((name, "pose") for name in _pose_names(library))
    yield from ((f"{joint.name}=", "joint") for joint in robot.actuated)
    if robot.gripper:
        yield f"{WIDTH}=", "distance between the fingers"


@completing
def complete_target(context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    """Complete a word of a target: the name of a pose, `JOINT=` or `width=`."""
    yield from _target_words(*_chosen(context))


@completing
def complete_own_pose(context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    """Complete the name of a pose in a file of the user."""
    _, library = _chosen(context)
    for file in library.draft_poses()[0]:
        if file.path.parent not in library.shipped:
            yield from ((name, "pose") for name in file.poses)


@completing
def complete_goal(context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    """Complete a word of a target, or the name of a task."""
    robot, library = _chosen(context)
    yield from _target_words(robot, library)
    yield from ((name, f"task {number}") for name, number in library.names().items())


@completing
def complete_node(context: click.Context, word: str) -> Iterator[tuple[str, str]]:
    """Complete the path of a node: first the name of its task, then the nodes of that task."""
    robot, library = _chosen(context)
    name, slash, _ = word.partition("/")
    if not slash:
        yield from ((f"{each}/", "") for each in library.names())
        return
    from trees.check import compile_task
    from trees.compile.node_paths import paths

    root = compile_task(robot, library, library.number(name)).root
    yield from ((path, "") for _, path in paths(root))


def recordings_folder(context: click.Context) -> Path:
    """Return the folder of the setting `recordings`.

    If it does not exist, return the working directory if that has recordings.
    """
    folder: Path = find_setting(context, "recordings")[0]
    here = Path()
    return here if not folder.is_dir() and any(here.glob("*.mcap")) else folder


@completing
def complete_recording(context: click.Context, word: str) -> Iterator[tuple[str, str]]:
    """Complete the name of a recording in the folder of recordings."""
    from logs import goal_title
    from logs.reading.find import LATEST, runs

    yield LATEST, "the last run"
    if word.startswith(LATEST):
        yield from ((f"{LATEST}:{name}", "") for name in _chosen(context)[1].names())
    folder = recordings_folder(context)
    yield from ((path.name, goal_title(task)) for _, task, path in islice(runs(folder), _SHOWN))


@completing
def complete_port(_context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    """Complete the name of a serial port."""
    from hardware import VIRTUAL, serial_ports

    yield VIRTUAL, "the virtual board"
    for port in serial_ports():
        yield port.device, port.name
        yield port.by_id, port.name


def complete_robot(
    context: click.Context, parameter: click.Parameter, word: str
) -> list[CompletionItem]:
    """Complete the name of a shipped robot, or a path."""
    return [CompletionItem(word, type="file"), *_shipped_robots(context, parameter, word)]


@completing
def _shipped_robots(_context: click.Context, _word: str) -> Iterator[tuple[str, str]]:
    from hardware import shipped_robots

    yield from ((name, "ships with armtree") for name in shipped_robots())


def _task_of_file(path: Path) -> str:
    """Return a message with the words to write instead of the path of a task's file."""
    from hardware import shipped_robots

    words = [path.stem.partition("_")[2] or path.stem]
    folder = path.parent.parent if path.parent.name in shipped_robots() else path.parent
    if folder != Path("trees") and (folder != Path() or path.exists()):
        words += ["--trees", str(folder)]
    return f"{path} is a file; a task has a number or a name: write {' '.join(words)}"


class TaskName(click.ParamType):  # type: ignore[type-arg]  # generic since click 8.4
    """The number or the name of a task. The task need not exist."""

    name = "task"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """Return the number as an integer, or the name. Raise a usage error for any other text."""
        text = str(value)
        if text.isdecimal() and len(text) < 20 and int(text) <= _LARGEST:
            return int(text)
        from logs.reading.find import LATEST  # numbers do not need it

        if text.partition(":")[0] == LATEST or text.endswith(".mcap"):
            self.fail(f"{text} is a recording: type armtree replay {text} --watch", param, ctx)
        if "=" in text:
            self.fail(f"{text} is a parameter of a task: write --set {text}", param, ctx)
        if "," in text:
            self.fail(f"write tasks without commas: {text.replace(',', ' ')}", param, ctx)
        if text.endswith((".yaml", ".yml")):
            self.fail(_task_of_file(Path(text)), param, ctx)
        if not text[:1].isalpha():
            why = f"{text!r} is neither the number of a task, from 0 to {_LARGEST}, nor a name"
            self.fail(why, param, ctx)
        return text

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the name of a task."""
        return complete_task(ctx, param, incomplete)


class RecordingName(click.Path):
    """A recording: a file, `latest`, `latest:TASK`, or the beginning of a recording's name."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path of the recording.

        Raises:
            NoSuchRecording: No recording has the name, or several recordings match it.
        """
        from logs import find_recording

        folder = recordings_folder(ctx or click.get_current_context())
        return find_recording(str(value), folder)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete a path, or the name of a recording."""
        files: list[CompletionItem] = super().shell_complete(ctx, param, incomplete)
        return [*files, *complete_recording(ctx, param, incomplete)]


class TaskOrRecording(click.ParamType):  # type: ignore[type-arg]
    """A task or a recording."""

    name = "task or recording"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str | Path:
        """Return the number or name of the task, or the path of the recording."""
        from logs.reading.find import is_recording_name

        kind = RECORDING if is_recording_name(str(value)) else TASK
        found: int | str | Path = kind.convert(value, param, ctx)
        return found

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete the name of a task, a path, or the name of a recording."""
        tasks = complete_task(ctx, param, incomplete)
        return [*RECORDING.shell_complete(ctx, param, incomplete), *tasks]


TASK_OR_RECORDING = TaskOrRecording()
TASK, RECORDING = TaskName(), RecordingName()
