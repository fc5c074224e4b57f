"""A jog as a state machine: keys become small moves. It is independent of terminal and arm."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from textwrap import wrap
from typing import Self

from executive.api.events import Where
from executive.api.move import HOME, Move
from executive.cli.terminal.keyboard import DELETE, DOWN, ENTER, ESCAPE, LEFT, RIGHT, UP, key_name
from hardware import DISPLAY_UNITS
from hardware.loading.dataclass import dataclass
from hardware.printable import plural

STEPS = (0.1, 0.5, 1.0, 2.0, 5.0, 10.0)  # sizes of a step [deg] or [mm]
_POSES = {"h": HOME, "o": "open", "c": "closed"}
_TOOL = "xyz"
_UP, _DOWN = "tool up", "tool down"  # words for a move of the tool along z
_MESSAGE = 4  # a message takes at most the lines of the screen / _MESSAGE
_LISTED = 34  # smallest width of the list of axes, if the steps are beside it [columns]
_NAMED = 16  # smallest width of the name of an axis [columns]
_STEP = 24  # smallest width of a step [columns]
_ABOUT = "During a move, the last pressed key waits for the end of the move; a command waits, too"
_HARD = "\xa0"  # no-break space


@dataclass(frozen=True, slots=True)
class Axis:
    """What the arrow keys move: a joint, the tool along x, y or z, or a turn of the tool.

    Attributes:
        name: Name of the joint, or words such as `tool x` and `tool roll`.
        unit: Unit of the position, `rad` or `m`.
        column: Index of x, y or z for the tool; None for a joint or a turn.
        turn: `roll`, `pitch` or `yaw` for a turn; empty for others.
    """

    name: str
    unit: str
    column: int | None = None
    turn: str = ""

    @property
    def people_unit(self) -> str:
        """Unit for people, `deg` or `mm`."""
        return DISPLAY_UNITS[self.unit][1]

    def words(self, amount: float) -> tuple[str, ...]:
        """Return the target of a relative move by an amount [deg or mm], as in `armtree move`."""
        change = f"{amount:g}{self.people_unit}"
        if self.column is None:
            return (f"{self.turn or self.name}={change}",)
        return tuple(change if each == self.column else "0" for each in range(len(_TOOL)))

    def change(self, amount: float) -> str:
        """Return a move by an amount [deg or mm], for people, such as `tool down 10 mm`."""
        if self.column == len(_TOOL) - 1:
            return f"{_UP if amount > 0 else _DOWN} {abs(amount):g} {self.people_unit}"
        return f"{self.name} by {amount:+g} {self.people_unit}"

    def shown(self, where: Where) -> str:
        """Return the position on the axis for people, `?` if it is unknown; empty for a turn."""
        if self.turn:
            return ""
        if self.column is None:
            value = where.commanded[self.name] if where.commanded else None
        else:
            value = where.tool[self.column] if where.tool else None
        scale, unit = DISPLAY_UNITS[self.unit]
        if value is None:
            return f"{'?':>8} {unit}"
        return f"{scale * value:z8.1f} {unit}"


@dataclass(frozen=True, slots=True)
class Go:
    """Action: start a move.

    Attributes:
        move: The move.
        words: The move, for people.
    """

    move: Move
    words: str


@dataclass(frozen=True, slots=True)
class Stop:
    """Action: stop the arm at once."""


@dataclass(frozen=True, slots=True)
class Leave:
    """Action: leave the jog."""


@dataclass(frozen=True, slots=True)
class Call:
    """Action: call the command of a key.

    Attributes:
        key: The key.
        text: Text that was typed for the command.
    """

    key: str
    text: str


@dataclass(frozen=True, slots=True)
class Yes:
    """Action: call the function of the question, because the user pressed y."""


Action = Go | Stop | Leave | Call | Yes


@dataclass(frozen=True, slots=True)
class KeyCommand:
    """The command of a key. It does not move the arm.

    Attributes:
        title: Short description for the list of keys, such as `save pose`; empty to hide the key.
        prompt: Question shown before the user types a text; empty if the command takes none.
        about: Effect of the command, for the help that the key ? shows.
    """

    title: str = ""
    prompt: str = ""
    about: str = ""


@dataclass(frozen=True, slots=True)
class Jog:
    """The state of a jog. Every method returns a new state.

    Attributes:
        axes: Axes that can be moved.
        commands: Commands that do not move the arm, by key.
        speed: Share of the robot's speed, 0.01 to 1.
        gripper: True if the arm has a gripper.
        selected: Index of the axis that the arrows move.
        step: Index of the size of a step in `STEPS`.
        moving: The move under way, or None.
        waiting: The next move, or None. Only the last key pressed during a move counts, so that the
            arm stops soon after a key is released.
        calling: The command to execute when the arm is still, or None.
        dropped: Number of ignored keys during a move. It is kept until the next move or the first
            key after the move.
        lost: True if the server of the arm is lost. Only q then has an effect: it leaves the jog.
        prompt: Key of the command whose text is being typed, or empty.
        typed: Text that was typed so far.
        question: Question that y or n answers, or empty.
        message: Last message, for people.
        failed: True if the message is an error.
    """

    axes: Sequence[Axis]
    commands: Mapping[str, KeyCommand]
    speed: float = 1.0
    gripper: bool = True
    selected: int = 0
    step: int = 3
    moving: Go | None = None
    waiting: Go | None = None
    calling: Call | None = None
    dropped: int = 0
    lost: bool = False
    prompt: str = ""
    typed: str = ""
    question: str = ""
    message: str = ""
    failed: bool = False

    @classmethod
    def start(
        cls, where: Where, commands: Mapping[str, KeyCommand], speed: float, message: str
    ) -> Self:
        """Return the first state.

        Args:
            where: Position of the arm.
            commands: Commands that do not move the arm, by key.
            speed: Share of the robot's speed, 0.01 to 1.
            message: First message.
        """
        joints = [Axis(name, unit) for name, unit in where.units.items()]
        tool = (Axis(f"tool {name}", "m", column) for column, name in enumerate(_TOOL))
        turns = (Axis(f"tool {word}", "rad", turn=word) for word in where.turns)
        return cls((*joints, *tool, *turns), commands, speed, where.gripper, message=message)

    @property
    def axis(self) -> Axis:
        """The axis that the arrows move."""
        return self.axes[self.selected]

    def press(self, key: str) -> tuple["Jog", Action | None]:
        """Return the state after a key, and the action to execute, or None."""
        if self.lost:
            return self, Leave() if key == "q" else None
        if key == " ":
            return self._stopped(), Stop()
        if self.prompt or self.question:
            return self._type(key) if self.prompt else self._answer(key)
        if key == "q":
            return self, Leave()
        state = self if self.moving else replace(self, dropped=0)
        if key in self.commands:
            return state._call(key)
        if (selected := self._chosen(key)) is not None:
            return replace(state, selected=selected).said(""), None
        if key in ("+", "=", "-"):
            step = self.step + (-1 if key == "-" else 1)
            return replace(state, step=min(max(step, 0), len(STEPS) - 1)).said(""), None
        if go := self._go(key):
            return state._pressed(go)
        return state._explained(key), None

    def _stopped(self) -> "Jog":
        """Return the state after a space. An open prompt stays open.

        If a prompt is open and the arm is still, the space becomes part of the typed text.
        """
        if self.prompt and not self.moving:
            return replace(self, typed=f"{self.typed} ")
        stopped = replace(self, waiting=None, calling=None, dropped=0)
        # The end of the move confirms the stop.
        said = f"{'Stopping' if self.moving else 'Stopped'}{self._undone}"
        if self.prompt:
            return stopped.said(f"{said}; the space is not in the text; Escape ends the text")
        return stopped._closed().said(said)

    def _explained(self, key: str) -> "Jog":
        """Return the state after any other key: help or an error. Escape clears the message."""
        if key == ESCAPE:
            return self.said("")
        if key == "?":
            about = (f"{key} {each.about}" for key, each in self.commands.items() if each.about)
            return self.said(". ".join([*about, _ABOUT]))
        if key.isdecimal():
            joints = ", ".join(axis.name for axis in self.axes[: min(self._joints, 9)])
            why = f"there is no joint {key}; 1 to {min(self._joints, 9)} choose {joints}"
            return self.said(why, failed=True)
        return self.said(f"{key_name(key)} is not a key of jog; ? shows help", failed=True)

    def ended(self, message: str, failed: bool) -> tuple["Jog", Action | None]:
        """Return the state after the end of the current move, and the action to execute, or None.

        Args:
            message: Message about a failed or stopped move; empty if the move succeeded. A message
                drops the waiting move and the waiting command.
            failed: True if the move failed.
        """
        state = replace(self, moving=None, waiting=None)
        if message:
            said = message if self._undone in message else f"{message}{self._undone}"
            return replace(state, calling=None).said(said, failed), None
        if self.waiting:
            return state._started(self.waiting)
        return replace(state, calling=None), self.calling

    def lose(self, why: str) -> "Jog":
        """Return the state after the server of the arm is lost.

        Args:
            why: Reason of the loss, for people.
        """
        state = replace(self, lost=True, moving=None, waiting=None, calling=None, dropped=0)
        return state._closed().said(why, failed=True)

    def ask(self, question: str) -> "Jog":
        """Return the state with a question. Only y, n, Escape and space then have an effect."""
        return replace(self, question=question).said("")

    def said(self, message: str, failed: bool = False) -> "Jog":
        """Return the state with a message."""
        return replace(self, message=message, failed=failed)

    def refused(self, call: Call, why: str) -> "Jog":
        """Return the state after a failed command. If it has a prompt, the prompt opens again.

        The prompt then has the typed text.
        """
        if not self.commands[call.key].prompt:
            return self.said(why, failed=True)
        state = replace(self, prompt=call.key, typed=call.text)
        return state.said(f"{why}; Escape ends the text", failed=True)

    def lines(
        self, where: Where, width: int, rows: int, title: str, steps: Sequence[str] | None = None
    ) -> Iterator[tuple[str, bool]]:
        """Return the lines of the screen, each with True if it belongs to an error.

        Args:
            where: Position of the arm.
            width: Number of columns.
            rows: Number of lines. On a low screen, only the axes around the selected one and the
                last steps are shown.
            title: Title of the screen, such as `armtree jog`.
            steps: Steps of the taught task, for people; None for a jog without steps.
        """
        said = wrap(self.message, width)
        shown = [*wrap(self._typing, width), *wrap(self._next, width), *said]
        shown = shown[: max(rows // _MESSAGE, 1)] or [""]
        head = f"{title}   arm {'unknown' if self.lost else where.arm}"
        tail = [*self._state(where, width), *shown, *self._help(width)]
        most = max(rows - len(tail) - 1, 1)
        body = list(self._listed(where, most))
        if steps is not None:
            listed = max(_LISTED, *map(len, body))
            beside = _last(steps, most, width - listed - 3)
            body += [""] * (len(beside) - len(body))
            beside += [""] * (len(body) - len(beside))
            body = [f"{axis:<{listed}} | {step}" for axis, step in zip(body, beside, strict=True)]
        for line in (head, *body, *tail)[:rows]:
            yield line[:width].rstrip(), self.failed and line in said

    def _listed(self, where: Where, most: int) -> Iterator[str]:
        longest = max(_NAMED, *(len(each.name) for each in self.axes))
        counted = len(self.axes) > most > 2
        most -= counted  # room for the line with the number of hidden axes
        first = min(max(self.selected - most // 2, 0), max(len(self.axes) - most, 0))
        for number, axis in enumerate(self.axes[first : first + most], first):
            mark = ">" if number == self.selected else " "
            key = "" if axis.turn else number + 1 if axis.column is None else _TOOL[axis.column]
            yield f"{mark} {key:>2} {axis.name:<{longest}}{axis.shown(where)}"
        if counted:
            yield f"     … {len(self.axes) - most} more"

    def _state(self, where: Where, width: int) -> list[str]:
        """Return the lines with the size of a step, speed, gripper's width and current move."""
        size = f"step {STEPS[self.step]:g} {self.axis.people_unit}   speed {self.speed:g}"
        size += f"   width {where.width_words}" if where.width_words else ""
        return [*wrap(size, width), f"moving {self.moving.words}" if self.moving else ""]

    @property
    def _typing(self) -> str:
        """The open prompt or question."""
        if self.question:
            return f"{self.question} y/n"
        return f"{self.commands[self.prompt].prompt}: {self.typed}_" if self.prompt else ""

    @property
    def _next(self) -> str:
        """The line with the next move or command, and the number of ignored keys."""
        words = []
        if self.waiting:
            words.append(f"1 key waits: {self.waiting.words}")
        if self.calling:
            words.append(f"at the end of the move: {self._called}")
        if self.dropped:
            words.append(f"{plural(self.dropped, 'key')} ignored")
        return "; ".join(words)

    @property
    def _called(self) -> str:
        """The next command, for people."""
        assert self.calling
        return f"{self.commands[self.calling.key].title} {self.calling.text}".rstrip()

    @property
    def _undone(self) -> str:
        """The end of a message that drops the waiting command; empty if no command waits."""
        return f"; not done: {self._called}" if self.calling else ""

    def _help(self, width: int) -> list[str]:
        if self.lost:
            return ["q leave"]
        count = min(self._joints, 9)
        more = (f"{key} {each.title}" for key, each in self.commands.items() if each.title)
        keys = ("<- -> move", f"up down 1-{count} x y z choose", "+ - step", "space stop")
        poses = ("h home", "o c gripper") if self.gripper else ("h home",)
        words = [each.replace(" ", _HARD) for each in (*keys, *poses, *more, "q leave")]
        return [line.replace(_HARD, " ") for line in wrap("   ".join(words), width)]

    @property
    def _joints(self) -> int:
        return sum(axis.column is None and not axis.turn for axis in self.axes)

    def _chosen(self, key: str) -> int | None:
        """Return the index of the axis that a key chooses, or None."""
        joints = self._joints
        if key in (UP, DOWN):
            return (self.selected + (1 if key == DOWN else -1)) % len(self.axes)
        if key in tuple(_TOOL):
            return joints + _TOOL.index(key)
        number = int(key) if key.isdecimal() else 0
        return number - 1 if 0 < number <= joints else None

    def _go(self, key: str) -> Go | None:
        """Return the move of a key, or None for another key."""
        if key in (LEFT, RIGHT):
            amount = STEPS[self.step] if key == RIGHT else -STEPS[self.step]
            move = Move(self.axis.words(amount), relative=True, speed=self.speed)
            return Go(move, self.axis.change(amount))
        pose = _POSES.get(key)
        return Go(Move((pose,), speed=self.speed), f"to {pose}") if pose else None

    def _pressed(self, go: Go) -> tuple["Jog", Action | None]:
        """Return the state after the key of a move: the move starts, waits or is dropped.

        Also returns the action to execute, or None.
        """
        if not self.moving:
            return self._started(go)
        if self.calling:  # the pose for a waiting command must not change any more
            return replace(self, dropped=self.dropped + 1).said(""), None
        dropped = self.dropped + bool(self.waiting)
        return replace(self, waiting=go, dropped=dropped).said(""), None

    def _started(self, go: Go) -> tuple["Jog", Action]:
        return replace(self, moving=go, dropped=0, message="", failed=False), go

    def _call(self, key: str) -> tuple["Jog", Action | None]:
        if self.calling:
            return self.said(f"first, wait for: {self._called}", failed=True), None
        if self.commands[key].prompt:
            return replace(self, prompt=key, typed="").said(""), None
        return self._when_still(Call(key, ""))

    def _when_still(self, call: Call) -> tuple["Jog", Action | None]:
        """Return the state after the key of a command, and the action to execute, or None.

        During a move, the command waits for the end of the move.
        """
        state = self.said("")
        return (replace(state, calling=call), None) if self.moving else (state, call)

    def _closed(self) -> "Jog":
        """Return the state without a prompt or question."""
        return replace(self, prompt="", typed="", question="")

    def _answer(self, key: str) -> tuple["Jog", Action | None]:
        """Return the state after a key that may answer the question, and the action, or None."""
        if key == "y":
            return self._closed(), Yes()
        if key in ("n", ESCAPE):
            return self._closed().said("Nothing has changed"), None
        return self, None

    def _type(self, key: str) -> tuple["Jog", Action | None]:
        """Return the state after a key while a text is typed, and the action, or None."""
        if key == ENTER:
            state = self._closed().said("")
            return state._when_still(Call(self.prompt, self.typed)) if self.typed else (state, None)
        if key == ESCAPE:
            return self._closed().said(""), None
        if key == DELETE:
            return replace(self, typed=self.typed[:-1]), None
        more = key if len(key) == 1 and key.isprintable() else ""
        return replace(self, typed=self.typed + more), None


def _last(steps: Sequence[str], most: int, width: int) -> list[str]:
    """Return the last steps, each with its number.

    Args:
        steps: The steps, for people.
        most: Largest number of lines.
        width: Number of columns of a line.
    """
    if not steps:
        return ["no step yet; t takes one"]
    numbered = [f"{number} {step}" for number, step in enumerate(steps, 1)][-most:]
    width = max(width, _STEP)
    return [line for step in numbered for line in wrap(step, width, subsequent_indent="  ")][-most:]
