"""`armtree teach`."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from hardware.printable import plural

from .jog import saving
from .settings import Whole, option
from .support.command_group import command
from .support.options import run_options, source_options, speed_option
from .terminal.streams import LastingStream

if TYPE_CHECKING:
    from collections.abc import Mapping

    from executive.api.events import Where
    from trees.writing.taught_task import TaughtTask

    from .jogging.arms import JogArm, OwnArm
    from .jogging.model import KeyCommand
    from .jogging.screen import Act

_ACTIVATE = "activate it: `armtree arm activate`"
_MEASURES_NOTHING = "This arm's servos measure nothing, so it cannot be moved by hand"
_TORQUE = "switches the torque off, to move the arm by hand, or on again"


@command()
@click.argument("number", type=Whole(0, 2**31 - 1))
@click.argument("name")
@speed_option
@option("server")
@source_options
@run_options
def teach(number: int, name: str, server: str | None, speed: float, **options: Any) -> None:
    """Teach a task: jog the arm from pose to pose, and take each pose as a step.

    The keys are those of `armtree jog`, and these:

    \b
      t  take this pose as a step
      w  add a wait, such as 500ms
      u  undo the last step
      f  torque off, to move the arm by hand; or on again
      r  record a path of the hand as a step; or end it

    f and r need servos that measure. They do not work on the arm of a server. A path is reduced to
    the fewest points that stay within 1 degree and 2 mm of it.

    The file is written at every step, so Ctrl-C or a closed terminal loses nothing. It is an
    ordinary task file in --trees, by default ./trees. Edit it in any editor.

    \b
    Example:
      armtree teach 5 fetch
    """  # noqa: D301
    from hardware import Ability, load_robot
    from trees.writing.taught_task import TaughtTask

    from .jogging.arms import OwnArm
    from .jogging.model import KeyCommand
    from .jogging.run_jog import run_jog
    from .support.server_requests import find_server

    robot, folder = load_robot(options["robot"]), options["trees"] or Path("trees")
    task = TaughtTask(robot, folder, number, name)

    def commands(arm: "JogArm") -> "dict[str, tuple[KeyCommand, Act]]":
        own, key = isinstance(arm, OwnArm), KeyCommand
        teaching = _Teaching(task, "move it first" if own else _ACTIVATE)
        if not (robot.can(Ability.TORQUE) and robot.can(Ability.MEASURE)):
            hidden = KeyCommand(), lambda _where, _text: _MEASURES_NOTHING
            by_hand = {"f": hidden, "r": hidden}
        else:
            hand = _Hand(arm, task) if isinstance(arm, OwnArm) else None
            switch, record = (hand.switch_torque, hand.record) if hand else (_refuse, _refuse)
            by_hand = {
                "f": (key("torque off, on", about=_TORQUE), switch),
                "r": (key("path", about="records a path of the hand, or ends it"), record),
            }
        return {
            "t": (key("take", about="takes this pose as a step"), teaching.take),
            "w": (key("wait", "How long, such as 500ms", "adds a wait"), teaching.wait),
            "u": (key("undo", about="removes the last step"), teaching.undo),
            **by_hand,
            **saving(robot, folder),
        }

    setup = {**options, "robot": robot, "trees": folder}
    url = find_server(server)
    try:
        status = run_jog(
            url,
            setup,
            speed,
            commands,
            title=f"armtree teach {name}",
            steps=lambda: [step.words for step in task.steps],
        )
    finally:
        terminal = LastingStream(sys.stdout)
        source = click.get_current_context().get_parameter_source
        typed = ParameterSource.COMMANDLINE
        names = (name for name in ("robot", "trees", "port") if source(name) is typed)
        given = {f"--{name}": options[name] for name in names}
        terminal.write(f"{summary(task, folder, server, url, given)}\n")
        terminal.flush()
    sys.exit(status)


def summary(
    task: "TaughtTask",
    folder: Path,
    server: str | None,
    url: str | None,
    given: "Mapping[str, object]",
) -> str:
    """Return a summary of the task, and the command that runs it on the same arm.

    Args:
        task: The task.
        folder: Folder of the user's task files.
        server: URL of the server, if the command names it.
        url: URL of the server that has the arm; None for an arm of this command.
        given: Options that the task needs on an arm of this command. Options with None are left
            out.
    """
    if not task.steps:
        return "No step was taken, so there is no new task"
    steps, number = plural(len(task.steps), "step"), task.path.stem.partition("_")[0]
    if (nodes := sum(len(step.nodes) for step in task.steps)) != len(task.steps):
        steps += f" ({plural(nodes, 'node')})"
    words = ["send", number, "--wait"] if url else ["run", number]
    for option_name, value in ({"--server": server} if url else given).items():
        words += [option_name, str(value)] if value else []
    next_step = "Next"
    if url and not _is_listed(task.path, url):
        start = shlex.join(["--trees", str(folder)])
        next_step = f"The server does not list this task: start armtree serve with {start}. Then"
    return f"{task.path} has {steps}. {next_step}, type: armtree {shlex.join(words)}"


def _is_listed(path: Path, url: str) -> bool:
    """Return True if a server answers, and lists a task whose file has the name of this file."""
    from executive.client.synchronous import Client
    from executive.errors import ClientError

    try:
        with Client(url) as client:
            return any(Path(each.source).name == path.name for each in client.tasks())
    except ClientError:
        return False


class _Teaching:
    """The functions of the keys t, w and u, which change the steps of a task.

    Args:
        task: The task.
        way_out: Advice for an inactive arm.
    """

    def __init__(self, task: "TaughtTask", way_out: str) -> None:
        self._task, self._way_out = task, way_out

    def take(self, where: "Where", _text: str) -> str:
        """Take the pose of the arm as a step: the measured pose, if the driver measures it."""
        from hardware import NotActive

        if not (positions := where.measured or where.commanded):
            raise NotActive(f"The pose of an inactive arm is not known; {self._way_out}")
        step = self._task.move(positions)
        return self._taken(step.words) if step else "The arm has not moved since the last step"

    def wait(self, _where: "Where", text: str) -> str:
        """Add a wait."""
        return self._taken(self._task.wait(text).words)

    def undo(self, _where: "Where", _text: str) -> str:
        """Remove the last step."""
        step = self._task.undo()
        return f"Undone: {step.words}" if step else "There is no step to undo"

    def _taken(self, words: str) -> str:
        return f"Step {len(self._task.steps)}: {words}"


def _refuse(_where: "Where", _text: str) -> str:
    return "A server has this arm. To move it by hand, end armtree serve, then teach again"


class _Hand:
    """The functions of the keys f and r, for an arm that a person moves by hand."""

    def __init__(self, arm: "OwnArm", task: "TaughtTask") -> None:
        self._arm, self._task = arm, task
        self._recording = False

    def switch_torque(self, _where: "Where", _text: str) -> str:
        """Switch the torque on, or ask whether to switch it off."""
        from .jogging.screen import ConfirmationNeeded

        if not self._arm.by_hand:
            why = "The arm loses its torque and falls unless you hold it."
            raise ConfirmationNeeded(f"{why} Do you hold it?", self._release)
        self._arm.switch_torque(on=True)
        dropped = "; the path is dropped" if self._recording else ""
        self._recording = False
        return f"The arm holds{dropped}"

    def _release(self) -> str:
        self._arm.switch_torque(on=False)
        return "Move the arm by hand. t takes a pose, r starts and ends a path, f holds the arm"

    def record(self, _where: "Where", _text: str) -> str:
        """Start a path, or end it and take it as a step."""
        if not self._arm.by_hand:
            return "f switches the torque off, so that you can move the arm; r then records a path"
        self._recording = not self._recording
        if self._recording:
            self._arm.start_path()
            return "Move the arm; r ends the path"
        step = self._task.follow(self._arm.end_path())
        return f"Step {len(self._task.steps)}: {step.words}" if step else "The arm has not moved"
