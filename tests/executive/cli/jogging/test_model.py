"""The state machine of a jog: which keys move what, and when."""

from dataclasses import replace

import pytest

from executive.api.events import Where
from executive.api.move import Move
from executive.cli.jogging.model import STEPS, Call, Go, Jog, KeyCommand, Leave, Stop, Yes
from executive.cli.terminal.keyboard import DELETE, DOWN, ENTER, ESCAPE, LEFT, RIGHT, UP
from hardware import State, load_robot

WHERE = Where(
    arm=State.ACTIVE,
    units={"base": "rad", "lift": "m", "finger": "rad"},
    commanded={"base": 0.5, "lift": 0.02, "finger": -0.1},
    measured=None,
    tool=(0.1, 0.0, 0.2),
    gripper=True,
)


def begun(speed: float = 1.0) -> Jog:
    return Jog.start(
        WHERE, {"s": KeyCommand("save pose", "Name"), "u": KeyCommand("undo")}, speed, "hello"
    )


def drawn(jog: Jog, width: int = 80, rows: int = 24, steps: list[str] | None = None) -> list[str]:
    return [line for line, _ in jog.lines(WHERE, width, rows, "armtree jog", steps)]


def pressed(jog: Jog, *keys: str) -> tuple[Jog, object]:
    action: object = None
    for key in keys:
        jog, action = jog.press(key)
    return jog, action


@pytest.mark.parametrize("key", ["x", UP, "+"])
def test_an_error_is_not_shown_after_the_next_choice(key: str) -> None:
    jog, _ = pressed(begun(), "9")
    assert jog.message
    assert pressed(jog, key)[0].message == ""


@pytest.mark.parametrize(
    ("keys", "words", "shown"),
    [
        ((RIGHT,), ("base=2deg",), "base by +2 deg"),
        ((LEFT,), ("base=-2deg",), "base by -2 deg"),
        (("2", RIGHT), ("lift=2mm",), "lift by +2 mm"),
        ((DOWN, DOWN, LEFT), ("finger=-2deg",), "finger by -2 deg"),
        ((UP, RIGHT), ("0", "0", "2mm"), "tool up 2 mm"),
        (("z", "+", "+", LEFT), ("0", "0", "-10mm"), "tool down 10 mm"),
        (("x", LEFT), ("-2mm", "0", "0"), "tool x by -2 mm"),
        (("y", "+", RIGHT), ("0", "5mm", "0"), "tool y by +5 mm"),
        (("-", "-", RIGHT), ("base=0.5deg",), "base by +0.5 deg"),
        (("9", "0", RIGHT), ("base=2deg",), "base by +2 deg"),
    ],
)
def test_an_arrow_moves_what_is_chosen(
    keys: tuple[str, ...], words: tuple[str, ...], shown: str
) -> None:
    jog, action = pressed(begun(0.3), *keys)
    assert action == jog.moving == Go(Move(words, relative=True, speed=0.3), shown)
    assert f"moving {shown}" in drawn(jog)


@pytest.mark.parametrize("gripper", [False, True])
def test_only_an_arm_with_a_gripper_lists_its_keys(gripper: bool) -> None:
    robot = load_robot()
    groups = {**robot.groups, **({} if gripper else {"gripper": ()})}
    where = Where.of(replace(robot, groups=groups), State.INACTIVE, None)
    jog = Jog.start(where, {}, 1.0, "")
    lines = [line for line, _ in jog.lines(where, 80, 24, "armtree jog")]
    assert ("o c gripper" in " ".join(lines)) is gripper


def test_an_arm_that_turns_its_tool_has_axes_for_it() -> None:
    jog = Jog.start(replace(WHERE, turns=("roll", "pitch")), {}, 1.0, "")
    chosen, action = pressed(jog, UP, LEFT)
    assert action == Go(Move(("pitch=-2deg",), relative=True), "tool pitch by -2 deg")
    assert next(line for line in drawn(chosen) if "tool pitch" in line) == ">    tool pitch"
    assert not any("yaw" in line for line in drawn(chosen))
    assert pressed(jog, "z", DOWN, RIGHT)[1] == Go(
        Move(("roll=2deg",), relative=True), "tool roll by +2 deg"
    )
    assert pressed(jog, "4", RIGHT)[1] == pressed(jog, RIGHT)[1]  # a turn has no number


@pytest.mark.parametrize(("key", "pose"), [("h", "home"), ("o", "open"), ("c", "closed")])
def test_a_key_moves_to_a_pose(key: str, pose: str) -> None:
    assert pressed(begun(), key)[1] == Go(Move((pose,)), f"to {pose}")


def test_the_size_of_a_step_has_limits() -> None:
    for key, size in (("+", STEPS[-1]), ("-", STEPS[0])):
        jog, _ = pressed(begun(), *(key,) * 20)
        _, action = pressed(jog, RIGHT)
        assert isinstance(action, Go)
        assert action.move == Move((f"base={size:g}deg",), relative=True)


def test_only_the_last_key_of_a_move_counts() -> None:
    jog, _ = pressed(begun(), RIGHT)
    jog, action = pressed(jog, RIGHT)
    assert (action, "1 key waits: base by +2 deg" in drawn(jog)) == (None, True)
    jog, action = pressed(jog, RIGHT, "2", LEFT)
    assert action is None
    assert "1 key waits: lift by -2 mm; 2 keys ignored" in drawn(jog)
    jog, action = jog.ended("", failed=False)
    assert action == Go(Move(("lift=-2mm",), relative=True), "lift by -2 mm")
    assert not any("not taken" in line for line in drawn(jog))
    jog, _ = pressed(jog, LEFT, LEFT)
    assert "1 key waits: lift by -2 mm; 1 key ignored" in drawn(jog)
    jog, action = jog.ended("", failed=False)[0].ended("", failed=False)
    assert (jog.moving, action) == (None, None)
    assert not any("not taken" in line for line in drawn(jog))


def test_nothing_follows_a_stop_or_a_failure() -> None:
    jog, _ = pressed(begun(), RIGHT, RIGHT)
    stopped, action = jog.press(" ")
    assert (action, stopped.waiting, stopped.message) == (Stop(), None, "Stopping")
    stopped, action = stopped.ended("Stopped", failed=False)
    assert (action, stopped.message) == (None, "Stopped")
    assert stopped.press(" ")[0].message == "Stopped"
    failed, action = jog.ended("out of its limits", failed=True)
    assert (action, failed.waiting, failed.message) == (None, None, "out of its limits")


def test_a_name_is_typed_for_a_command() -> None:
    jog, action = pressed(begun(), "s", "q", "x", "1", DELETE, "2", RIGHT)
    assert (action, jog.typed) == (None, "qx2")
    assert jog.press(ENTER)[1] == Call("s", "qx2")
    for keys in ((ESCAPE,), (DELETE, DELETE, DELETE, ENTER)):
        left, action = pressed(jog, *keys)
        assert (left.prompt, action) == ("", None)
    jog, action = jog.press(" ")
    assert (action, jog.typed, jog.message) == (Stop(), "qx2 ", "")
    assert pressed(jog, "o")[1] is None  # the rest of the text moves nothing


def test_a_space_during_a_move_stops_and_is_not_typed() -> None:
    jog, action = pressed(begun(), RIGHT, "s", "a", " ")
    assert (action, jog.typed) == (Stop(), "a")
    assert "Stopping; the space is not in the text; Escape ends the text" in drawn(jog)


def test_a_text_that_is_wrong_can_be_corrected() -> None:
    jog, action = pressed(begun(), "s", "a", " ", "b", ENTER)
    assert action == Call("s", "a b")
    jog = jog.refused(action, "a b cannot be a name")
    assert ("a b cannot be a name; Escape ends the text", True) in [*jog.lines(WHERE, 80, 24, "")]
    left, _ = pressed(jog, ESCAPE)
    assert (left.message, left.prompt) == ("", "")
    assert pressed(jog, DELETE, DELETE, ENTER)[1] == Call("s", "a")
    assert jog.press(ESCAPE)[0].prompt == ""
    plain = begun().refused(Call("u", ""), "no step")
    assert (plain.prompt, plain.message, plain.failed) == ("", "no step", True)


def test_the_help_explains_the_commands_and_hidden_ones_are_in_no_line() -> None:
    commands = {"t": KeyCommand("take", about="takes this pose as a step"), "f": KeyCommand()}
    jog, _ = pressed(Jog.start(WHERE, commands, 1.0, ""), "?")
    assert "t takes this pose as a step. During a move, the last pressed key" in jog.message
    shown = " ".join(drawn(jog))
    assert ("t take" in shown, " f " in shown) == (True, False)
    assert pressed(jog, "f")[1] == Call("f", "")


def test_escape_outside_a_prompt_clears_the_message() -> None:
    jog, action = begun().press(ESCAPE)
    assert (action, jog.message) == (None, "")


def test_a_prompt_opens_during_a_move_and_its_command_follows_the_move() -> None:
    jog, action = pressed(begun(), RIGHT, LEFT, "s", "o", "1", "h", LEFT)
    assert (action, jog.selected, jog.waiting and jog.waiting.words) == (None, 0, "base by -2 deg")
    assert "Name: o1h_" in drawn(jog)
    jog, action = pressed(jog, ENTER, RIGHT)
    shown = "1 key waits: base by -2 deg; at the end of the move: save pose o1h; 1 key ignored"
    assert (action, shown in drawn(jog, 100)) == (None, True)
    assert "first, wait for: save pose o1h" in drawn(jog.press("s")[0])
    jog, action = jog.ended("", failed=False)
    assert isinstance(action, Go)
    assert jog.ended("", failed=False)[1] == Call("s", "o1h")
    jog, _ = jog.press(" ")
    assert "Stopping; not done: save pose o1h" in drawn(jog)
    assert jog.ended("", failed=False)[1] is None


def test_a_move_that_fails_during_a_prompt_is_shown() -> None:
    jog, _ = pressed(begun(), RIGHT, "s", "a")
    jog, _ = jog.ended("out of its limits", failed=True)
    assert ("Name: a_", False) in [*jog.lines(WHERE, 80, 24, "")]
    assert ("out of its limits", True) in [*jog.lines(WHERE, 80, 24, "")]
    jog, _ = pressed(begun(), RIGHT, "s", "a", ENTER)
    failed, action = jog.ended("out of its limits", failed=True)
    assert (failed.message, action) == ("out of its limits; not done: save pose a", None)


@pytest.mark.parametrize(
    ("key", "name"),
    [
        ("\x1b[3~", "This key"),
        (ENTER, "Enter"),
        (DELETE, "Backspace"),
        ("\t", "Tab"),
        ("v", "v"),
    ],
)
def test_an_unknown_key_is_named(key: str, name: str) -> None:
    jog, action = begun().press(key)
    assert (action, jog.message) == (None, f"{name} is not a key of jog; ? shows help")
    assert jog.press("q") == (jog, Leave())


def test_a_number_without_a_joint_names_those_that_have_one() -> None:
    for number in ("0", "4"):
        said = begun().press(number)[0].message
        assert said == f"there is no joint {number}; 1 to 3 choose base, lift, finger"


def test_a_question_takes_yes_no_or_a_stop() -> None:
    jog = begun().ask("Replace left?")
    assert "Replace left? y/n" in drawn(jog)
    assert pressed(jog, RIGHT, "h", "1", "q", ENTER) == (jog, None)
    for key, action in (("y", Yes()), ("n", None), (ESCAPE, None), (" ", Stop())):
        answered = jog.press(key)
        assert (answered[0].question, answered[1]) == ("", action)


def test_help_says_what_waits() -> None:
    jog, action = begun().press("?")
    assert (action, "the last pressed key waits" in jog.message) == (None, True)


@pytest.mark.parametrize("size", [(200, 50), (80, 24), (60, 12)])
def test_the_screen_fits(size: tuple[int, int]) -> None:
    long = "The tool cannot reach the point " * 5
    for jog in (begun(), replace(begun(), selected=5), begun().said(long, failed=True)):
        lines = list(jog.lines(WHERE, *size, "armtree jog"))
        assert len(lines) <= size[1]
        assert max(len(line) for line, _ in lines) <= size[0]
        (chosen,) = (line for line, _ in lines if line.startswith(">"))
        assert jog.axis.name in chosen
        assert any("space stop" in line for line, _ in lines)
        assert [line for line, wrong in lines if wrong] == [] or jog.failed


def test_positions_are_in_degrees_and_millimetres() -> None:
    assert drawn(begun())[1:4] == [
        ">  1 base                28.6 deg",
        "   2 lift                20.0 mm",
        "   3 finger              -5.7 deg",
    ]
    unknown = replace(WHERE, arm=State.INACTIVE, commanded=None, tool=None)
    shown = begun().lines(unknown, 80, 24, "armtree jog")
    assert all(" ? " in line for line, _ in list(shown)[1:7])


def test_units_are_in_line_with_long_names() -> None:
    units = {"base": "rad", "panda_finger_joint1": "m"}
    where = replace(WHERE, units=units, commanded=dict.fromkeys(units, 0.0))
    jog = Jog.start(where, {}, 1.0, "")
    lines = [line for line, _ in jog.lines(where, 80, 24, "")][1:6]
    assert {max(line.rfind(" deg"), line.rfind(" mm")) for line in lines} == {32}


def test_no_position_is_minus_zero() -> None:
    near = replace(WHERE, commanded={"base": -1e-5, "lift": -1e-5, "finger": 0.0})
    shown = begun().lines(near, 80, 24, "armtree jog")
    assert not any("-0.0" in line for line, _ in shown)


def test_nothing_moves_after_the_arm_is_lost() -> None:
    jog = pressed(begun(), RIGHT, LEFT)[0].lose("The server does not answer")
    for key in (RIGHT, "h", "s", " ", "1", ENTER):
        assert jog.press(key) == (jog, None)
    assert jog.press("q") == (jog, Leave())
    shown = drawn(jog)
    assert (shown[0], shown[-2:]) == (
        "armtree jog   arm unknown",
        ["The server does not answer", "q leave"],
    )


@pytest.mark.parametrize("size", [(120, 40), (80, 24), (60, 12)])
def test_the_last_steps_are_beside_the_joints(size: tuple[int, int]) -> None:
    assert "| no step yet" in drawn(begun(), *size, [])[1]
    shown = drawn(begun(), *size, [f"wait {n} s" for n in range(1, 31)])
    assert any(line.endswith("| 30 wait 30 s") for line in shown)
    assert len(shown) <= size[1]
    assert shown[1].startswith(">  1 base                28.6 deg  | ")
    long = drawn(begun(), *size, ["move to joint_1: 10 deg, joint_2: -20.5 deg, joint_3: 3 deg"])
    words = " ".join(line.partition("| ")[2].strip() for line in long if " | " in line)
    assert words.split() == [
        "1",
        "move",
        "to",
        "joint_1:",
        "10",
        "deg,",
        "joint_2:",
        "-20.5",
        "deg,",
        "joint_3:",
        "3",
        "deg",
    ]


def test_a_low_screen_counts_the_axes_that_it_leaves_out() -> None:
    shown = drawn(begun(), rows=10)
    assert len(shown) == 10
    assert shown[3:5] == ["   3 finger              -5.7 deg", "     … 3 more"]
    assert not any("more" in line for line in drawn(begun(), rows=12))
