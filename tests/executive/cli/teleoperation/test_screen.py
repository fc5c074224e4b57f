"""What `armtree teleop` shows and stops, with an arm and a leader that fail."""

import threading
from collections.abc import Callable
from dataclasses import replace

from executive.api.events import Where
from executive.api.move import Move
from executive.api.outcome import Cause, GoalState, Outcome, cause_of
from executive.cli.jogging.arms import OwnArm
from executive.cli.teleoperation.screen import TeleopScreen
from executive.cli.teleoperation.servo_leader import HandGuidedArm
from hardware import State, load_robot
from hardware.errors import PortLost
from logs import MOVE
from skills import Blocked

LEADER_LOST, ARM_LOST = PortLost("/dev/leader", "It went"), PortLost("/dev/arm", "It went, too")
JOINTS = load_robot().actuated[:1]
WHERE = Where(State.ACTIVE, {"joint_1": "rad"}, commanded={"joint_1": 0.0})


class Arm(OwnArm):
    """An arm whose moves last until it is stopped."""

    def __init__(self) -> None:
        self.there = WHERE
        self.cause: Cause | None = None
        self.moving, self.stopped = threading.Event(), threading.Event()

    def move(self, move: Move, accepted: Callable[[], None]) -> Outcome:
        accepted()
        self.moving.set()
        self.stopped.wait()
        return Outcome.of(MOVE, GoalState.CANCELED, None)

    def stop(self) -> None:
        self.stopped.set()

    def where(self) -> Where:
        return self.there

    def fault(self) -> Cause | None:
        return self.cause


class Leader(HandGuidedArm):
    """A leader that is lost when a test says so."""

    def __init__(self) -> None:
        self.following = self.lost = False
        self.blocked: Blocked | None = None

    def release(self) -> None:
        """It has no torque anyway."""

    def where(self) -> tuple[float, ...]:
        if self.lost:
            raise LEADER_LOST
        return (1.0,)


def shown(screen: TeleopScreen) -> str:
    screen.update()
    return "\n".join(line for line, _ in screen.lines(200, 24))


def test_a_lost_leader_stops_the_move_to_it_and_hides_no_fault_of_the_arm() -> None:
    arm, leader = Arm(), Leader()
    screen = TeleopScreen(arm, JOINTS, leader, 1.0)
    screen.press("y")
    assert arm.moving.wait(10)
    assert "moves to the leader" in shown(screen)
    leader.lost = True
    text = shown(screen)
    assert arm.stopped.is_set()
    assert "holds; the leader is lost" in text
    assert str(LEADER_LOST) in text
    assert text.endswith("q leave")
    arm.there, arm.cause = replace(WHERE, arm=State.UNCONFIGURED), cause_of(ARM_LOST)
    text = shown(screen)
    assert "arm unconfigured, holds; the leader is lost" in text
    assert str(LEADER_LOST) in text
    assert f"hw.port_lost: {ARM_LOST}" in text
    assert text.endswith("q leave, then start armtree teleop again")


def test_a_fault_of_an_arm_that_holds_is_shown() -> None:
    arm = Arm()
    screen = TeleopScreen(arm, JOINTS, Leader(), 1.0)
    arm.there, arm.cause = replace(WHERE, arm=State.UNCONFIGURED), cause_of(ARM_LOST)
    assert f"hw.port_lost: {ARM_LOST}" in shown(screen)
