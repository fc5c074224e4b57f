"""Decorators that register Python functions as skills."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

from py_trees.common import Status

from hardware import Clock

from .context import Context
from .errors import ConditionFails, FunctionFailed
from .leaves import Skill  # the shipped skills are registered first
from .ports import Port

Function = TypeVar("Function", bound=Callable[..., Any])

RESULT = "result"


class Cancel:
    """The cancel signal for a function that runs for a long time.

    Args:
        clock: Time source.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock, self._signal, self._set = clock, clock.signal(), False

    def set(self) -> None:
        """Request that the function returns early."""
        with self._signal:
            self._set = True
            self._signal.notify()

    def wait(self, seconds: float) -> bool:
        """Wait until a time passed or the function was canceled.

        Args:
            seconds: Longest time to wait [s].

        Returns:
            True if the function was canceled, and should return.
        """
        until = self._clock.now() + seconds
        with self._signal:
            while not self._set and self._clock.now() < until:
                self._signal.wait(until)
            return self._set


def skill(function: Function) -> Function:
    """Register a function as a skill with the function's name.

    Each annotated parameter is an input port. If the function returns a value, the skill has an
    output port `result`. A parameter annotated `Context` or `Cancel` is not a port: armtree passes
    its value. The function runs on its own thread. A function that may take longer than 250 ms must
    check its `Cancel`. If the function raises an exception, the skill fails.

    Raises:
        TypeError: A parameter has no annotation, or its annotation is not a type of a port.
    """
    _register(function, _Action)
    return function


def condition(function: Function) -> Function:
    """Register a function that returns a bool as a condition with the function's name.

    Every tick calls the function on the thread that ticks the tree, so it must return at once.

    Raises:
        TypeError: The function is not annotated to return a bool, or a parameter has no annotation.
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
            raise TypeError(f"{function.__name__}: {parameter} is not a port; name each parameter")
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
        outputs[RESULT] = Port(returns, description="value that the function returns")
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
    """A skill that calls a function."""

    function: Callable[..., Any]
    given: dict[str, type]

    def _arguments(self) -> dict[str, Any]:
        return {port: self.get_input(port) for port in self.input_ports()}


class _Condition(_Function, register=False):
    """A condition. Its function is called on the thread that ticks the tree."""

    condition = True

    def on_start(self) -> Status:
        """Call the function."""
        answer = _call(self, self._arguments() | dict.fromkeys(self.given, self.context))
        if not isinstance(answer, bool):
            raise _wrong_type(self, answer, "bool")
        if not answer:
            raise ConditionFails(f"{type(self).__name__} is false")
        return Status.SUCCESS


class _Action(_Function, register=False):
    """A skill whose function runs on its own thread."""

    _cancel: Cancel | None = None
    _answer: list[Any] | None = None

    @property
    def busy(self) -> bool:
        """True while the function runs."""
        return self._cancel is not None and not self._answer

    def on_start(self) -> Status:
        """Start the thread of the function."""
        clock, answer = self.context.clock, list[Any]()
        self._cancel, self._answer = Cancel(clock), answer
        provided = {Context: self.context, Cancel: self._cancel}
        arguments = self._arguments() | {name: provided[kind] for name, kind in self.given.items()}

        def work() -> None:
            try:
                answer.append(_call(self, arguments))
            except FunctionFailed as error:
                answer.append(error)
            self.context.wake()

        clock.spawn(work, type(self).__name__)
        return Status.RUNNING

    def on_running(self) -> Status:
        """Write the returned value to the output port when the function has returned."""
        if not self._answer:
            return Status.RUNNING
        (returned,) = self._answer
        if isinstance(returned, FunctionFailed):
            raise returned
        if port := self.output_ports().get(RESULT):
            whole = type(returned) is int and port.data_type is float
            self._write(float(returned) if whole else returned)
        return Status.SUCCESS

    def _write(self, returned: Any) -> None:
        try:
            self._set_output(RESULT, returned)
        except TypeError as error:
            wanted = self.output_ports()[RESULT].data_type
            raise _wrong_type(self, returned, getattr(wanted, "__name__", str(wanted))) from error

    def on_halt(self) -> None:
        """Request that the function returns early."""
        if self._cancel:
            self._cancel.set()


def _wrong_type(skill: _Function, returned: Any, wanted: str) -> FunctionFailed:
    name = type(skill).__name__
    return FunctionFailed(f"{name} returned {returned!r}, but is annotated to return {wanted}")


def _call(skill: _Function, arguments: dict[str, Any]) -> Any:
    try:
        return skill.function(**arguments)
    except BaseException as error:  # any exception of a user's function is a failure
        raise FunctionFailed(f"{type(skill).__name__}: {type(error).__name__}: {error}") from error
