"""What our firmware says, and what the arm makes of it."""

import binascii
import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware import (
    FIRMWARES,
    Arm,
    ArmEvent,
    BoardLink,
    BoardReset,
    BoardSilent,
    Codec,
    CommandSent,
    Faulted,
    Firmware,
    FrameLost,
    FrameSent,
    Playback,
    PlaybackState,
    SimulatedClock,
    State,
    load_robot,
    virtual_board,
)
from hardware.dialogue import ANSWER, Dialogue
from tests.hardware_rigs import HOME, PICK, motion

OURS = FIRMWARES["armtree"]
ROBOT = dataclasses.replace(load_robot(), firmware=OURS)
CODEC = Codec(ROBOT.actuated)
LINE = b"armtree 1 AVW? kept b009,s125,e085,g000,\n"


def ack(frames: int, total: int, refused: int = 0, lost: int = 0) -> bytes:
    return b"k%04x,%02x,%02x,%04x\n" % (frames % 0x10000, refused, lost, total)


def booted() -> Dialogue:
    dialogue = Dialogue(OURS, CODEC)
    dialogue.hear(LINE)
    return dialogue


# What it understands -------------------------------------------------------------------------


@given(st.integers(0, len(LINE)), st.binary(max_size=40))
def test_a_banner_in_pieces_after_noise_is_heard(cut: int, noise: bytes) -> None:
    dialogue = Dialogue(OURS, CODEC)
    dialogue.hear(noise + b"\n")
    dialogue.hear(LINE[:cut])
    dialogue.hear(LINE[cut:])
    assert str(dialogue.holds) == "b009,s125,e085,g000,"
    assert dialogue.greeting == b"bA01;"


@pytest.mark.parametrize("line", [LINE[:-2], LINE.replace(b"g000", b"g0x0"), b"READY\n", b"\n"])
def test_what_is_no_banner_is_none(line: bytes) -> None:
    dialogue = Dialogue(OURS, CODEC)
    dialogue.hear(line)
    assert dialogue.holds is None
    assert dialogue.greeting == b""


def test_what_never_ends_is_not_kept() -> None:
    dialogue = Dialogue(OURS, CODEC)
    for _ in range(1000):
        dialogue.hear(b"x" * 1000)
    assert len(dialogue._unfinished) <= 1000


@given(st.lists(st.tuples(*[st.integers(0, 180)] * 4), max_size=50), st.data())
def test_acknowledgements_count_what_arrived(
    frames: list[tuple[int, ...]], data: st.DataObject
) -> None:
    """The board may leave lines out; the next one tells the newest state."""
    dialogue, total = booted(), 0
    for number, servos in enumerate(frames, 1):
        dialogue.sends(CODEC.frame(servos), 0.0)
        assert not dialogue.settled()
        total = binascii.crc_hqx(bytes(servos), total)
        if number == len(frames) or data.draw(st.booleans()):
            dialogue.hear(ack(number, total))
            assert dialogue.taken == number
    assert dialogue.settled()


def test_the_count_wraps() -> None:
    dialogue, total = booted(), 0
    for number in range(1, 0x10000 + 3):
        dialogue.sends(CODEC.frame([number % 181, 90, 90, 0]), 0.0)
        total = binascii.crc_hqx(bytes([number % 181, 90, 90, 0]), total)
        dialogue.hear(ack(number, total))
    assert dialogue.taken == 0x10000 + 2


def test_a_frame_that_was_lost_or_changed_or_came_from_elsewhere_is_told() -> None:
    first, second = [10, 90, 90, 0], [11, 90, 90, 0]
    lost = booted()
    lost.sends(CODEC.frame(first), 0.0)
    lost.sends(CODEC.frame(second), 0.0)
    with pytest.raises(FrameLost, match="refused 20 bytes and lost 1"):
        lost.hear(ack(1, binascii.crc_hqx(bytes(second), 0), 20, 1))
    changed = booted()
    changed.sends(CODEC.frame(first), 0.0)
    with pytest.raises(FrameLost, match="other frames than were sent"):
        changed.hear(ack(1, binascii.crc_hqx(bytes(second), 0)))
    foreign = booted()
    with pytest.raises(FrameLost):
        foreign.hear(ack(1, binascii.crc_hqx(bytes(first), 0)))


def test_the_first_that_is_heard_may_be_an_acknowledgement() -> None:
    dialogue = Dialogue(OURS, CODEC)
    dialogue.sends(CODEC.frame([10, 90, 90, 0]), 0.0)
    dialogue.hear(ack(1, binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)))
    assert dialogue.taken == 1


def test_a_frame_without_an_answer_is_told_when_its_time_is_over() -> None:
    dialogue = booted()
    dialogue.check(100.0)
    dialogue.sends(CODEC.frame([10, 90, 90, 0]), 1.0)
    dialogue.sends(CODEC.frame([11, 90, 90, 0]), 1.2)
    dialogue.check(1.0 + ANSWER - 0.001)
    why = r"^the board acknowledged 0 of 2 frames, and then nothing for 0.25 s\. Check the cable"
    with pytest.raises(FrameLost, match=why):
        dialogue.check(1.0 + ANSWER)
    dialogue.hear(ack(1, binascii.crc_hqx(bytes([10, 90, 90, 0]), 0)))
    dialogue.check(1.2 + ANSWER - 0.001)


def test_a_second_start_is_a_reset() -> None:
    with pytest.raises(BoardReset, match=r"it says 'armtree 1 AVW. kept b009,s125,e085,g000,'"):
        booted().hear(LINE)


def test_a_start_after_noise_is_a_reset() -> None:
    with pytest.raises(BoardReset, match="it says '\ufffdarmtree 1 AVW"):
        booted().hear(b"\xff" + LINE)


def test_a_board_that_says_nothing_has_what_it_was_sent() -> None:
    dialogue = Dialogue(FIRMWARES["stock"], CODEC)
    dialogue.hear(LINE + ack(3, 7))
    dialogue.sends(CODEC.frame([10, 90, 90, 0]), 0.0)
    assert (dialogue.holds, dialogue.taken, dialogue.settled()) == (None, 1, True)


# What the arm makes of it --------------------------------------------------------------------


class Rig:
    """An arm with our firmware on an in-process board whose line can be damaged."""

    def __init__(self, runs: Firmware) -> None:
        self.clock = SimulatedClock()
        robot = dataclasses.replace(ROBOT, firmware=runs)
        self.link = Noisy(virtual_board(robot), self.clock)
        self.events: list[ArmEvent] = []
        self.arm = Arm(ROBOT, self.link, self.clock, self.events.append)
        self.signal = self.clock.signal()

    def changed(self) -> None:
        with self.signal:
            self.signal.notify()

    def play(self, goal: tuple[float, ...], seconds: float) -> Playback:
        """Plays a motion to its end."""
        there = motion(self.arm.commanded, goal, seconds, ROBOT)
        playback = self.arm.play(there, self.changed, "test", self.arm.generation)
        with self.signal:
            while playback.state is PlaybackState.PLAYING:
                self.signal.wait(None)
        return playback

    def settle(self) -> None:
        """Waits until the fault has taken the arm out of *active*."""
        with self.signal:
            while self.arm.state is not State.UNCONFIGURED:
                self.signal.wait(self.clock.now() + 0.01)

    @property
    def frames(self) -> int:
        return sum(isinstance(event, FrameSent) for event in self.events)


class Noisy(BoardLink):
    """Loses one byte of the line."""

    writes = 0
    damages = -1

    def write(self, data: bytes) -> None:
        self.writes += 1
        super().write(data[:-3] + data[-2:] if self.writes == self.damages else data)


@contextmanager
def active(runs: Firmware = OURS) -> Iterator[Rig]:
    rig = Rig(runs)
    with rig.clock.working(), rig.arm:
        rig.arm.configure()
        rig.arm.activate()
        yield rig


def test_the_arm_begins_where_the_board_says_it_stands() -> None:
    with active() as rig:
        assert 1.0 < rig.clock.now() < 1.01  # it waits for the boot and the line, and no longer
        assert rig.arm.commanded == HOME
        assert rig.play(PICK, 4.0).state is PlaybackState.DONE
        rig.arm.deactivate()
        rig.arm.activate()
        assert str(CODEC.encode(rig.arm.commanded)) == "b009,s125,e085,g000,"
        assert rig.link.board.state(rig.clock.now()).servos == (9, 125, 85, 0)


def test_progress_counts_what_the_board_acknowledged() -> None:
    with active() as rig:
        greetings = [event for event in rig.events if isinstance(event, CommandSent)]
        assert greetings == [CommandSent(rig.clock.now(), b"bA01;")]
        counts: list[tuple[int, int]] = []
        there = motion(HOME, PICK, 4.0, ROBOT)

        def changed() -> None:
            counts.append((playback.arrived, rig.frames))
            rig.changed()

        playback = rig.arm.play(there, changed, "test", rig.arm.generation)
        with rig.signal:
            while playback.state is PlaybackState.PLAYING:
                rig.signal.wait(None)
        arrived = [count for count, _ in counts]
        assert arrived == sorted(arrived)
        assert arrived[-1] == playback.written == len(there.setpoints)
        assert any(count < sent for count, sent in counts)


LAST = len(motion(HOME, PICK, 4.0, ROBOT).setpoints)


@pytest.mark.parametrize("damaged", [1, 40, LAST])
def test_a_lost_frame_ends_the_motion(damaged: int) -> None:
    with active() as rig:
        rig.link.damages = 1 + damaged  # after the greeting
        playback = rig.play(PICK, 4.0)
        assert playback.state is PlaybackState.FAILED
        assert isinstance(playback.error, FrameLost)
        rig.settle()
        assert rig.frames <= rig.link.damages + 1
        assert not [e for e in rig.events if isinstance(e, FrameSent) and e.scheduled is None]


def test_a_board_that_resets_in_mid_motion_ends_it() -> None:
    with active() as rig:
        reset = rig.clock.now() + 0.5

        def press() -> None:
            with rig.signal:
                while rig.clock.now() < reset:
                    rig.signal.wait(reset)
            rig.link.board.reset(rig.clock.now())

        rig.clock.spawn(press, "button")
        playback = rig.play(PICK, 4.0)
        assert isinstance(playback.error, FrameLost)
        assert "and then nothing for 0.25 s" in str(playback.error)
        rig.settle()
        assert rig.clock.now() < reset + 0.35


def test_a_board_that_resets_while_nothing_moves_is_told() -> None:
    with active() as rig:
        rig.link.board.reset(rig.clock.now())
        rig.link.write(b"")  # whoever reads looks again when something may come
        rig.settle()
        assert [type(e.error) for e in rig.events if isinstance(e, Faulted)] == [BoardReset]


def test_a_stop_right_before_a_motion_leaves_its_count_alone() -> None:
    with active() as rig:
        playback = rig.play(PICK, 4.0)
        rig.arm.stop()
        assert rig.play(HOME, 4.0).arrived == playback.arrived


def test_a_board_that_does_not_run_what_the_robot_file_says_is_refused() -> None:
    rig = Rig(FIRMWARES["stock"])
    with rig.clock.working(), rig.arm:
        rig.arm.configure()
        why = "did not say within 2 s that it runs the firmware armtree"
        with pytest.raises(BoardSilent, match=why):
            rig.arm.activate()
        assert rig.arm.state is State.INACTIVE
        assert rig.link.read() == b""  # closed
