"""The lifecycle against ROS 2's managed-node table."""

import itertools
import re
import threading

import pytest

from hardware import HardwareError, State, TransitionRefused
from hardware.arm.lifecycle import EDGES, OUTCOMES, REQUESTS, Callback, Lifecycle, Result
from tests.support.paths import ROOT

# rcl's 25 edges as its C source orders them, and `raise_error`, from the design article.
RCL = """
configure: unconfigured -> configuring
activate: inactive -> activating
deactivate: active -> deactivating
cleanup: inactive -> cleaningup
shutdown: unconfigured -> shuttingdown; inactive -> shuttingdown; active -> shuttingdown
transition_success: configuring -> inactive; activating -> active; deactivating -> inactive;
    cleaningup -> unconfigured; shuttingdown -> finalized; errorprocessing -> unconfigured
transition_failure: configuring -> unconfigured; activating -> inactive; deactivating -> active;
    cleaningup -> inactive; shuttingdown -> finalized; errorprocessing -> finalized
transition_error: configuring -> errorprocessing; activating -> errorprocessing;
    deactivating -> errorprocessing; cleaningup -> errorprocessing;
    shuttingdown -> errorprocessing; errorprocessing -> finalized
raise_error: active -> errorprocessing
"""

# request from a state: states after SUCCESS and FAILURE; on_error has those after ERROR
ENDS = {
    ("configure", "unconfigured"): ("inactive", "unconfigured"),
    ("activate", "inactive"): ("active", "inactive"),
    ("deactivate", "active"): ("inactive", "active"),
    ("cleanup", "inactive"): ("unconfigured", "inactive"),
    ("shutdown", "unconfigured"): ("finalized", "finalized"),
    ("shutdown", "inactive"): ("finalized", "finalized"),
    ("shutdown", "active"): ("finalized", "finalized"),
}
WAYS = {
    "unconfigured": (),
    "inactive": ("configure",),
    "active": ("configure", "activate"),
    "finalized": ("shutdown",),
}
LABELS = sorted({label for label, _, _ in REQUESTS})


def rcl_edges() -> set[tuple[str, str, str]]:
    edges = set()
    for label, rest in re.findall(r"^(\w+): ((?:.|\n )+)", RCL, re.MULTILINE):
        for start, goal in re.findall(r"(\w+) -> (\w+)", rest):
            edges.add((label, start, goal))
    return edges


def answers(result: Result | Exception) -> Callback:
    def answer() -> Result:
        if isinstance(result, Exception):
            raise result
        return result

    return answer


def interrupt() -> Result:
    raise KeyboardInterrupt


class Machine:
    """A lifecycle with callbacks that return given results, from any primary state."""

    def __init__(self, start: str) -> None:
        self.callbacks: dict[State, Callback] = {}
        self.edges: list[tuple[str, State, State]] = []
        self.lifecycle = Lifecycle(self.callbacks, lambda *edge: self.edges.append(edge))
        for label in WAYS[start]:
            self.lifecycle.request(label)
        assert self.lifecycle.state.value == start
        self.edges.clear()


def test_the_edges_are_those_of_rcl_and_the_error_edge() -> None:
    assert {(label, start.value, goal.value) for label, start, goal in EDGES} == rcl_edges()
    assert len(EDGES) == 26


def test_no_way_leads_around_the_table() -> None:
    """The library would add a `to_<state>` from every state."""
    lifecycle = Machine("unconfigured").lifecycle
    assert set(lifecycle._machine.events) == {label for label, _, _ in EDGES}


RESULTS = [*Result, RuntimeError("a bug"), HardwareError("a fault"), None]


@pytest.mark.parametrize(("label", "start"), ENDS)
@pytest.mark.parametrize(("result", "on_error"), list(itertools.product(RESULTS, RESULTS)), ids=str)
def test_every_outcome(
    label: str, start: str, result: Result | Exception, on_error: Result | Exception
) -> None:
    machine = Machine(start)
    transition = next(g for n, s, g in REQUESTS if n == label and s.value == start)
    machine.callbacks[transition] = answers(result)
    machine.callbacks[State.ERRORPROCESSING] = answers(on_error)
    success, failure = ENDS[label, start]
    recovered = "unconfigured" if on_error is Result.SUCCESS else "finalized"
    wanted = {Result.SUCCESS: success, Result.FAILURE: failure}
    end = wanted[result] if isinstance(result, Result) and result in wanted else recovered
    assert machine.lifecycle.request(label).value == end
    assert machine.lifecycle.state.value == end
    assert {(n, s.value, g.value) for n, s, g in machine.edges} <= rcl_edges()


@pytest.mark.parametrize(
    ("error", "line"),
    [(HardwareError("a fault"), "configuring failed: a fault"),
     (RuntimeError("a bug"), "configuring failed")],
    ids=str,
)  # fmt: skip
def test_a_callback_that_raises_is_logged_and_a_bug_with_its_traceback(
    error: Exception, line: str, caplog: pytest.LogCaptureFixture
) -> None:
    machine = Machine("unconfigured")
    machine.callbacks[State.CONFIGURING] = answers(error)
    machine.lifecycle.request("configure")
    (record,) = caplog.records
    assert (record.levelname, record.getMessage()) == ("ERROR", line)
    assert bool(record.exc_info) == isinstance(error, RuntimeError)


@pytest.mark.parametrize("on_error", RESULTS, ids=str)
def test_an_error_while_active(on_error: Result | Exception) -> None:
    machine = Machine("active")
    machine.callbacks[State.ERRORPROCESSING] = answers(on_error)
    end = State.UNCONFIGURED if on_error is Result.SUCCESS else State.FINALIZED
    assert machine.lifecycle.request("raise_error") is end


@pytest.mark.parametrize(("label", "start"), ENDS)
@pytest.mark.parametrize("on_error", RESULTS, ids=str)
def test_an_interrupt_counts_as_an_error_and_is_raised(
    label: str, start: str, on_error: Result | Exception
) -> None:
    machine = Machine(start)
    transition = next(g for n, s, g in REQUESTS if n == label and s.value == start)
    machine.callbacks[State.ERRORPROCESSING] = answers(on_error)
    machine.callbacks[transition] = interrupt
    with pytest.raises(KeyboardInterrupt):
        machine.lifecycle.request(label)
    end = State.UNCONFIGURED if on_error is Result.SUCCESS else State.FINALIZED
    assert machine.lifecycle.state is end
    assert not machine.lifecycle.changing


@pytest.mark.parametrize(
    ("moment", "end"),
    [(State.CONFIGURING, State.UNCONFIGURED), (State.ERRORPROCESSING, State.FINALIZED),
     (State.INACTIVE, State.INACTIVE)],
)  # fmt: skip
def test_an_interrupt_in_the_callback_leaves_no_transition_state(moment: State, end: State) -> None:
    def watch(label: str, start: State, goal: State) -> None:
        if goal is moment:
            raise KeyboardInterrupt

    result = Result.ERROR if moment is State.ERRORPROCESSING else Result.SUCCESS
    lifecycle = Lifecycle({State.CONFIGURING: answers(result)}, watch)
    with pytest.raises(KeyboardInterrupt):
        lifecycle.request("configure")
    assert lifecycle.state is end
    assert not lifecycle.changing


def test_repeated_interrupts_still_reach_a_primary_state() -> None:
    machine = Machine("unconfigured")
    machine.callbacks.update(dict.fromkeys(OUTCOMES, interrupt))
    with pytest.raises(KeyboardInterrupt):
        machine.lifecycle.request("configure")
    assert machine.lifecycle.state is State.FINALIZED


LEGAL = {*ENDS, ("raise_error", "active")}


@pytest.mark.parametrize(
    ("label", "start"), sorted(set(itertools.product([*LABELS, "destroy"], WAYS)) - LEGAL)
)
def test_a_request_that_is_not_in_the_table_is_refused(label: str, start: str) -> None:
    machine = Machine(start)
    legal = ", ".join(n for n, s, _ in REQUESTS if s.value == start and n != "raise_error")
    words = f"; legal: {legal}$" if legal else "; start armtree again"
    with pytest.raises(TransitionRefused, match=f"cannot {label} while {start}{words}") as refused:
        machine.lifecycle.request(label)
    assert refused.value.hint == (TransitionRefused.hint if legal else "start armtree again")
    assert machine.lifecycle.state.value == start
    assert machine.edges == []


def test_every_edge_is_reported_with_both_states() -> None:
    machine = Machine("unconfigured")
    machine.callbacks[State.CONFIGURING] = answers(Result.ERROR)
    machine.lifecycle.request("configure")
    assert machine.edges == [
        ("configure", State.UNCONFIGURED, State.CONFIGURING),
        ("transition_error", State.CONFIGURING, State.ERRORPROCESSING),
        ("transition_success", State.ERRORPROCESSING, State.UNCONFIGURED),
    ]


def test_callbacks_see_the_transition_state() -> None:
    machine, seen = Machine("unconfigured"), []

    def look() -> Result:
        seen.append((machine.lifecycle.state, machine.lifecycle.changing))
        return Result.SUCCESS

    machine.callbacks.update(dict.fromkeys(OUTCOMES, look))
    for label in ("configure", "activate", "deactivate", "cleanup", "shutdown"):
        machine.lifecycle.request(label)
    assert [state for state, _ in seen] == [
        State.CONFIGURING, State.ACTIVATING, State.DEACTIVATING, State.CLEANINGUP,
        State.SHUTTINGDOWN,
    ]  # fmt: skip
    assert all(changing for _, changing in seen)
    assert not machine.lifecycle.changing


def test_an_illegal_request_is_not_in_the_way_of_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = Machine("active")
    lifecycle = machine.lifecycle
    legal = lifecycle.legal
    error = threading.Thread(target=lifecycle.request, args=("raise_error",))

    def meanwhile() -> list[str]:
        monkeypatch.setattr(lifecycle, "legal", legal)
        error.start()
        error.join(5)
        return legal()

    monkeypatch.setattr(lifecycle, "legal", meanwhile)
    with pytest.raises(TransitionRefused):
        lifecycle.request("activate")
    assert lifecycle.state is State.UNCONFIGURED


def test_a_second_caller_is_refused_at_once() -> None:
    machine = Machine("unconfigured")
    entered, leave = threading.Event(), threading.Event()

    def wait() -> Result:
        entered.set()
        leave.wait(5)
        return Result.SUCCESS

    machine.callbacks[State.CONFIGURING] = wait
    first = threading.Thread(target=machine.lifecycle.request, args=("configure",))
    first.start()
    assert entered.wait(5)
    for label in LABELS:
        why = f"cannot {label} while .*: the arm is configuring; try again when .* has ended$"
        with pytest.raises(TransitionRefused, match=why) as refused:
            machine.lifecycle.request(label)
        assert refused.value.hint == "try again when the transition has ended"
    leave.set()
    first.join()
    assert machine.lifecycle.state is State.INACTIVE


def test_a_callback_may_not_request() -> None:
    machine = Machine("unconfigured")

    def request() -> Result:
        machine.lifecycle.request("shutdown")
        return Result.SUCCESS

    machine.callbacks[State.CONFIGURING] = request
    assert machine.lifecycle.request("configure") is State.UNCONFIGURED  # refused, so ERROR


def drawing() -> str:
    """The table as a Mermaid state diagram."""
    lines = ["```mermaid", "stateDiagram-v2", "    [*] --> unconfigured"]
    for label, start, goal in EDGES:
        lines.append(f"    {start.value} --> {goal.value}: {label.removeprefix('transition_')}")
    return "\n".join([*lines, "    finalized --> [*]", "```"])


def test_the_drawing_in_the_architecture_is_this_table() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    assert drawing() in text, f"paste this into ARCHITECTURE.md:\n{drawing()}"
