"""The lifecycle of the arm: the state machine of ROS 2 managed nodes, as a table.

The edges are those of rcl (`rcl_lifecycle/src/default_state_machine.c`), and `raise_error` from the
design article on managed nodes.
"""

import logging
import threading
from collections.abc import Callable
from enum import Enum, StrEnum

from hardware.errors import HardwareError, TransitionRefused

logger = logging.getLogger(__name__)


class State(StrEnum):
    """Primary states, then transition states. Logs and pages show the values."""

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    ACTIVE = "active"
    FINALIZED = "finalized"
    CONFIGURING = "configuring"
    CLEANINGUP = "cleaningup"
    ACTIVATING = "activating"
    DEACTIVATING = "deactivating"
    SHUTTINGDOWN = "shuttingdown"
    ERRORPROCESSING = "errorprocessing"


class Result(Enum):
    """Result of a callback. The values are the labels of the edges out of a transition state."""

    SUCCESS = "transition_success"
    FAILURE = "transition_failure"
    ERROR = "transition_error"


_PRIMARY = (State.UNCONFIGURED, State.INACTIVE, State.ACTIVE, State.FINALIZED)
_S = State

REQUESTS = (
    ("configure", _S.UNCONFIGURED, _S.CONFIGURING),
    ("activate", _S.INACTIVE, _S.ACTIVATING),
    ("deactivate", _S.ACTIVE, _S.DEACTIVATING),
    ("cleanup", _S.INACTIVE, _S.CLEANINGUP),
    ("shutdown", _S.UNCONFIGURED, _S.SHUTTINGDOWN),
    ("shutdown", _S.INACTIVE, _S.SHUTTINGDOWN),
    ("shutdown", _S.ACTIVE, _S.SHUTTINGDOWN),
    ("raise_error", _S.ACTIVE, _S.ERRORPROCESSING),  # rcl has no such edge
)

# Requests of people. Only the arm itself requests `raise_error`.
TRANSITIONS = tuple(dict.fromkeys(label for label, *_ in REQUESTS if label != "raise_error"))

# By transition state: the states after SUCCESS, FAILURE and ERROR.
OUTCOMES = {
    _S.CONFIGURING: (_S.INACTIVE, _S.UNCONFIGURED, _S.ERRORPROCESSING),
    _S.ACTIVATING: (_S.ACTIVE, _S.INACTIVE, _S.ERRORPROCESSING),
    _S.DEACTIVATING: (_S.INACTIVE, _S.ACTIVE, _S.ERRORPROCESSING),
    _S.CLEANINGUP: (_S.UNCONFIGURED, _S.INACTIVE, _S.ERRORPROCESSING),
    _S.SHUTTINGDOWN: (_S.FINALIZED, _S.FINALIZED, _S.ERRORPROCESSING),
    _S.ERRORPROCESSING: (_S.UNCONFIGURED, _S.FINALIZED, _S.FINALIZED),
}

EDGES = REQUESTS + tuple(
    (result.value, state, goal)
    for state, goals in OUTCOMES.items()
    for result, goal in zip(Result, goals, strict=True)
)

Callback = Callable[[], Result]
ChangeCallback = Callable[[str, State, State], None]


class Lifecycle:
    """The state machine. It runs one transition at a time and refuses others meanwhile.

    Callbacks run while the machine is in a transition state. They do not run inside the callbacks
    of the library `transitions`, because an exception there would leave the state changed. A
    callback that raises an exception, or does not return a `Result`, counts as ERROR. An exception
    that is not an `Exception`, such as that of Ctrl-C, is raised again.

    Args:
        callbacks: Callback of each transition state. A state without a callback succeeds at once.
        on_change: Callback after every edge, with the label, start and goal of the edge.
    """

    def __init__(self, callbacks: dict[State, Callback], on_change: ChangeCallback) -> None:
        self._callbacks, self._on_change = callbacks, on_change
        self._changing = threading.Lock()
        from transitions import Machine  # imported here, because clients only need the states

        self._machine = Machine(states=State, initial=State.UNCONFIGURED, auto_transitions=False)
        for label, start, goal in EDGES:
            self._machine.add_transition(label, start, goal)

    @property
    def state(self) -> State:
        """The current state."""
        state: State = self._machine.state
        return state

    @property
    def changing(self) -> bool:
        """True while a transition is under way."""
        return self._changing.locked()

    def request(self, label: str) -> State:
        """Run a transition to its end.

        Args:
            label: configure, activate, deactivate, cleanup, shutdown or raise_error.

        Returns:
            The primary state at its end.

        Raises:
            TransitionRefused: The transition is not legal now, or another one is under way.
        """
        if self.state in _PRIMARY:
            self._check(label)  # a refused request must not take the lock: raise_error may need it
        if not self._changing.acquire(blocking=False):
            hint = "try again when the transition has ended"
            raise TransitionRefused(
                f"cannot {label} while a transition is under way: the arm is {self.state.value}; "
                f"{hint}",
                hint,
            )
        try:
            self._check(label)
            self._run(label)
            return self.state
        finally:
            self._changing.release()

    def legal(self) -> list[str]:
        """Return the requests that the current state allows."""
        return [label for label, start, _ in REQUESTS if start is self.state]

    def _check(self, label: str) -> None:
        legal = self.legal()
        if label not in legal:
            hint = None if legal else "start armtree again"
            way = hint or f"legal: {', '.join(each for each in legal if each in TRANSITIONS)}"
            raise TransitionRefused(f"cannot {label} while {self.state.value}; {way}", hint)

    def _run(self, label: str) -> None:
        """Take an edge, and then the edges that callbacks select, up to a primary state."""
        try:
            self._fire(label)
            while self.state not in _PRIMARY:
                self._fire(self._call().value)
        except BaseException:  # also after Ctrl-C, the state must be a primary state
            if self.state not in _PRIMARY:
                self._run(Result.ERROR.value)
            raise

    def _call(self) -> Result:
        callback = self._callbacks.get(self.state, lambda: Result.SUCCESS)
        try:
            return Result(callback())
        except HardwareError as error:
            logger.error("%s failed: %s", self.state.value, error)
        except Exception:
            logger.exception("%s failed", self.state.value)
        return Result.ERROR

    def _fire(self, label: str) -> None:
        start = self.state
        self._machine.trigger(label)
        self._on_change(label, start, self.state)
