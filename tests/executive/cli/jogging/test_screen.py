"""The screen of a jog: its words about failures, and the order of stops and moves."""

import threading
from collections.abc import Callable

from executive.api.events import Where
from executive.api.move import Move
from executive.api.outcome import GoalState, Outcome, cause_of
from executive.cli.jogging.screen import JogScreen, cause_words
from executive.cli.terminal.keyboard import RIGHT
from hardware import State
from logs import MOVE
from skills.motion.errors import Unreachable


def test_a_step_beyond_the_reach_names_the_way_out_and_no_planner() -> None:
    error = Unreachable((0.0, 0.0, 0.622), (0.0, 0.0, 0.62), 0.002, 0.0)
    cause = cause_of(error, "move/ReachPoint", f"ReachPoint: {error}")
    assert cause_words(cause) == (
        "plan.unreachable: The tool cannot reach (0.0, 0.0, 622.0) mm. The nearest point is "
        "(0.0, 0.0, 620.0) mm, 2.0 mm away; the arm is stretched out or at a limit: move a joint "
        "first"
    )


class SlowStop:
    """An arm whose stop returns after the next move has begun, if nothing makes the move wait."""

    by_hand = False

    def __init__(self) -> None:
        self.calls: list[str] = []
        self._moved, self.done = threading.Event(), threading.Event()

    def where(self) -> Where:
        return Where(State.ACTIVE, {"base": "rad"}, commanded={"base": 0.0})

    def stop(self) -> None:
        self._moved.wait(0.1)
        self.calls.append("stop")

    def move(self, _: Move, accepted: Callable[[], None]) -> Outcome:
        self.calls.append("move")
        self._moved.set()
        accepted()
        self.done.set()
        return Outcome.of(MOVE, GoalState.SUCCEEDED, None)


def test_a_slow_stop_does_not_stop_a_later_move() -> None:
    arm = SlowStop()
    screen = JogScreen(arm, {}, 1.0, "", "armtree jog", None)  # type: ignore[arg-type]
    for key in (" ", RIGHT):
        screen.press(key)
    assert arm.done.wait(20)
    assert arm.calls == ["stop", "move"]
