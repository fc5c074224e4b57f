"""Python functions as skills: registered by a decorator, named in task files like any other."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

from py_trees.common import Status
from py_trees.ports import PortInformation

from hardware import Clock

from .base import Skill
from .context import Context
from .errors import ConditionFails, FunctionFailed
from .ports import Port

Function = TypeVar("Function", bound=Callable[..., Any])

RESULT = "result"


class Cancel:
    """Tells a function that works for long that it is to end.

    Args:
        clock: Whose time.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._signal, self._set = clock, clock.signal(), False

    def set(self) -> None:
        """Ask to end."""
        with self._signal:
            self._set = True
            self._signal.notify()

    def wait(self, seconds: float) -> bool:
        """Wait for so long [s], or until it is to end; returns whether it is."""
        until = self._clock.now() + seconds
        with self._signal:
            while not self._set and self._clock.now() < until:
                self._signal.wait(until)
            return self._set


def skill(function: Function) -> Function:
    """Register a function as a skill of its name.

    Its parameters with their annotations are the input ports, `result` is an output port where it
    returns something. A parameter annotated `Context` or `Cancel` is no port: it is handed in. The
    function runs on a thread of its own; where it may take longer than 250 ms it must watch a
    `Cancel`. What it raises fails the skill.

    Raises:
        TypeError: A parameter has no annotation, or one that ports cannot have.
    """
    _register(function, _Action)
    return function


def condition(function: Function) -> Function:
    """Register a function that returns whether something is so, as a skill of its name.

    It is asked again and again on the thread that ticks the tree, so it must return at once.

    Raises:
        TypeError: It does not return a bool, or a parameter has no annotation.
    """
    if get_type_hints(function).get("return") is not bool:
        raise TypeError(f"{function.__name__} must be annotated to return bool")
    _register(function, _Condition)
    return function


def _register(function: Callable[..., Any], base: type[Skill]) -> None:
    hints = get_type_hints(function)
    inputs, given = {}, {}
    if inspect.iscoroutinefunction(function):
        raise TypeError(f"{function.__name__} is async; a skill is a plain function, on a thread")
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise TypeError(f"{function.__name__}: {parameter} is no port; name each parameter")
        if name not in hints:
            raise TypeError(f"{function.__name__}: {name} needs an annotation, such as float")
        if hints[name] in (Context, Cancel):
            given[name] = hints[name]
        else:
            default = parameter.default
            value = None if default is inspect.Parameter.empty else default
            inputs[name] = Port(hints[name], description=name, default_value=value)
    returns = hints.get("return", type(None))
    outputs = {}
    if base is _Action and returns is not type(None):
        outputs[RESULT] = Port(returns, description="what it returns")
    members = {
        "__doc__": inspect.getdoc(function) or f"Call {function.__name__}.",
        "__module__": function.__module__,
        "INPUT_PORTS": inputs,
        "OUTPUT_PORTS": outputs,
        "function": staticmethod(function),
        "given": given,
    }
    type(function.__name__, (base,), members)


class _Function(Skill, register=False):
    """A skill around a function."""

    function: Callable[..., Any]
    given: dict[str, type]

    def _arguments(self) -> dict[str, Any]:
        return {port: self.get_input(port) for port in self.input_ports()}


class _Condition(_Function, register=False):
    """A function that is asked at once."""

    condition = True

    def on_start(self) -> Status:
        """Ask."""
        answer = _call(self, self._arguments() | dict.fromkeys(self.given, self.context))
        if not isinstance(answer, bool):
            raise _no_such(self, answer, "bool")
        if not answer:
            raise ConditionFails(f"{type(self).__name__} is not so")
        return Status.SUCCESS


class _Action(_Function, register=False):
    """A function that runs on a thread of its own."""

    _cancel: Cancel | None = None
    _answer: list[Any] | None = None

    @property
    def busy(self) -> bool:
        """Whether the function still runs."""
        return self._cancel is not None and not self._answer

    def on_start(self) -> Status:
        """Begin it."""
        clock, answer = self.context.clock, list[Any]()
        self._cancel, self._answer = Cancel(clock), answer
        handed = {Context: self.context, Cancel: self._cancel}
        arguments = self._arguments() | {name: handed[kind] for name, kind in self.given.items()}

        def work() -> None:
            try:
                answer.append(_call(self, arguments))
            except FunctionFailed as error:
                answer.append(error)
            self.context.wake()

        clock.spawn(work, type(self).__name__)
        return Status.RUNNING

    def on_running(self) -> Status:
        """Take what it returned."""
        if not self._answer:
            return Status.RUNNING
        (returned,) = self._answer
        if isinstance(returned, FunctionFailed):
            raise returned
        if port := self.output_ports().get(RESULT):
            self._tell(float(returned) if _whole_for(port, returned) else returned)
        return Status.SUCCESS

    def _tell(self, returned: Any) -> None:
        try:
            self._set_output(RESULT, returned)
        except TypeError as error:
            wanted = self.output_ports()[RESULT].data_type
            raise _no_such(self, returned, getattr(wanted, "__name__", str(wanted))) from error

    def on_halt(self) -> None:
        """Ask it to end."""
        if self._cancel:
            self._cancel.set()


def _whole_for(port: PortInformation, returned: Any) -> bool:
    """Whether a whole number was returned where annotations mean it to be a float."""
    return port.data_type is float and type(returned) is int


def _no_such(skill: _Function, returned: Any, wanted: str) -> FunctionFailed:
    name = type(skill).__name__
    return FunctionFailed(f"{name} returned {returned!r}, but is annotated to return {wanted}")


def _call(skill: _Function, arguments: dict[str, Any]) -> Any:
    try:
        return skill.function(**arguments)
    except BaseException as error:  # somebody else's code: whatever it raises is its failure
        raise FunctionFailed(f"{type(skill).__name__}: {type(error).__name__}: {error}") from error
