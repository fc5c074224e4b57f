"""The state machine of a jog: which keys move what, and when."""

from dataclasses import replace

import pytest

from executive.api.events import Where
from executive.api.move import Move
from executive.cli.terminal.jog_model import STEPS, Call, Command, Go, Jog, Leave, Stop
from executive.cli.terminal.keyboard import DELETE, DOWN, ENTER, ESCAPE, LEFT, RIGHT, UP
from hardware import State

WHERE = Where(
    arm=State.ACTIVE,
    units={"base": "rad", "lift": "m", "finger": "rad"},
    commanded={"base": 0.5, "lift": 0.02, "finger": -0.1},
    measured=None,
    tool=(0.1, 0.0, 0.2),
)


def begun(speed: float = 1.0) -> Jog:
    return Jog.start(WHERE, {"s": Command("save pose", "Name")}, speed, "hello")


def pressed(jog: Jog, *keys: str) -> tuple[Jog, object]:
    action: object = None
    for key in keys:
        jog, action = jog.press(key)
    return jog, action


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ((RIGHT,), ("base=2deg",)),
        ((LEFT,), ("base=-2deg",)),
        (("2", RIGHT), ("lift=2mm",)),
        ((DOWN, DOWN, LEFT), ("finger=-2deg",)),
        ((UP, RIGHT), ("0", "0", "2mm")),
        (("x", LEFT), ("-2mm", "0", "0")),
        (("y", "+", RIGHT), ("0", "5mm", "0")),
        (("-", "-", RIGHT), ("base=0.5deg",)),
        (("9", "0", RIGHT), ("base=2deg",)),
    ],
)
def test_an_arrow_moves_what_is_chosen(keys: tuple[str, ...], words: tuple[str, ...]) -> None:
    jog, action = pressed(begun(0.3), *keys)
    assert action == Go(Move(words, relative=True, speed=0.3))
    assert jog.moving == Move(words, relative=True, speed=0.3)


@pytest.mark.parametrize(("key", "pose"), [("h", "home"), ("o", "open"), ("c", "closed")])
def test_a_key_moves_to_a_pose(key: str, pose: str) -> None:
    assert pressed(begun(), key)[1] == Go(Move((pose,)))


def test_the_size_of_a_step_has_limits() -> None:
    for key, size in (("+", STEPS[-1]), ("-", STEPS[0])):
        jog, _ = pressed(begun(), *(key,) * 20)
        assert pressed(jog, RIGHT)[1] == Go(Move((f"base={size:g}deg",), relative=True))


def test_only_the_last_key_of_a_move_counts() -> None:
    jog, _ = pressed(begun(), RIGHT)
    jog, action = pressed(jog, RIGHT, RIGHT, "2", LEFT)
    assert action is None
    jog, action = jog.ended("", failed=False)
    assert action == Go(Move(("lift=-2mm",), relative=True))
    jog, action = jog.ended("", failed=False)
    assert (jog.moving, action) == (None, None)


def test_nothing_follows_a_stop_or_a_failure() -> None:
    jog, _ = pressed(begun(), RIGHT, RIGHT)
    stopped, action = jog.press(" ")
    assert (action, stopped.waiting) == (Stop(), None)
    failed, action = jog.ended("out of its limits", failed=True)
    assert (action, failed.waiting, failed.message) == (None, None, "out of its limits")


def test_a_name_is_typed_for_a_command() -> None:
    jog, action = pressed(begun(), "s", "q", "x", "1", DELETE, "2", RIGHT)
    assert (action, jog.typed) == (None, "qx2")
    assert jog.press(ENTER)[1] == Call("s", "qx2")
    for keys in ((ESCAPE,), (DELETE, DELETE, DELETE, ENTER)):
        left, action = pressed(jog, *keys)
        assert (left.prompt, action) == ("", None)
    assert jog.press(" ")[1] == Stop()


def test_a_moving_arm_has_no_pose_to_save() -> None:
    jog, action = pressed(begun(), RIGHT, "s")
    assert (jog.prompt, action, jog.failed) == ("", None, True)
    assert "Wait until the move has ended" in jog.message


def test_other_keys_do_nothing() -> None:
    jog = begun()
    for key in ("\x1b[3~", "\x1b[H", ENTER, ESCAPE, DELETE, "?", "\ufffd", "0"):
        assert jog.press(key) == (jog, None)
    assert jog.press("q") == (jog, Leave())


@pytest.mark.parametrize("size", [(200, 50), (80, 24), (60, 12)])
def test_the_screen_fits(size: tuple[int, int]) -> None:
    long = "The tool cannot reach the point " * 5
    for jog in (begun(), replace(begun(), selected=5), begun().said(long, failed=True)):
        lines = list(jog.lines(WHERE, *size))
        assert len(lines) <= size[1]
        assert max(len(line) for line, _ in lines) <= size[0]
        (chosen,) = (line for line, _ in lines if line.startswith(">"))
        assert jog.axis.name in chosen
        assert any("space stop" in line for line, _ in lines)
        assert [line for line, wrong in lines if wrong] == [] or jog.failed


def test_positions_are_in_degrees_and_millimetres() -> None:
    shown = [line for line, _ in begun().lines(WHERE, 80, 24)]
    assert shown[1:4] == [
        ">  1 base                28.6 deg",
        "   2 lift                20.0 mm",
        "   3 finger              -5.7 deg",
    ]
    unknown = replace(WHERE, arm=State.INACTIVE, commanded=None, tool=None)
    assert all(" ? " in line for line, _ in list(begun().lines(unknown, 80, 24))[1:7])
