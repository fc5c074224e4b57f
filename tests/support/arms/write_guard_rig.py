"""A write guard in front of an in-process board, for its tests."""

import dataclasses
import math
from collections.abc import Callable

from hardware import (
    ArmEvent,
    BoardLink,
    Firmware,
    FrameSent,
    Robot,
    SimulatedClock,
    load_robot,
)
from hardware.arm.board_session import BoardSession
from hardware.arm.events import Observer
from hardware.arm.write_guard import Claim, WriteGuard
from hardware.drivers.arduino.virtual.board import Board
from hardware.drivers.driver import Driver
from tests.support.arms.virtual_boards import virtual_board

ROBOT = load_robot()
HOME = (0.0, 0.0, 0.0, 0.0)


def degrees(*base: float) -> tuple[float, ...]:
    """Positions at the middle of a servo degree, this many degrees from home."""
    return (math.radians(base[0] + 0.5), 0.0, 0.0, 0.0)


class Slow(BoardLink[Board]):
    """A link on which a test may act before the bytes are sent."""

    def __init__(self, board: Board, clock: SimulatedClock) -> None:
        super().__init__(board, clock)
        self.written: list[bytes] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def write(self, data: bytes) -> None:
        meanwhile, self.meanwhile = self.meanwhile, lambda: None
        meanwhile()
        super().write(data)
        self.written.append(data)


class Rig:
    """A write guard in front of an in-process board that has booted."""

    def __init__(
        self,
        firmware: Firmware = ROBOT.firmware,
        driver: Driver = ROBOT.driver,
        velocity: float = math.inf,
        robot: Robot = ROBOT,
    ) -> None:
        joints = tuple(dataclasses.replace(joint, velocity=velocity) for joint in robot.joints)
        self.robot = dataclasses.replace(robot, firmware=firmware, driver=driver, joints=joints)
        self.clock = SimulatedClock()
        self.link = Slow(virtual_board(self.robot), self.clock)
        self.link.open()
        self.active = True
        self.then: Observer = lambda _: None
        self.events: list[ArmEvent] = []
        self.wait(2.0)
        self.session = BoardSession(self.robot.protocol())
        self.guard = WriteGuard(
            self.robot,
            self.link,
            self.clock,
            lambda: self.active,
            self.tell,
            self.session,
            self.robot.boot_pose,
        )
        self.claim = self.claimed()

    def tell(self, event: ArmEvent) -> None:
        self.events.append(event)
        self.then(event)

    def wait(self, until: float) -> None:
        with (signal := self.clock.signal()):
            while self.clock.now() < until:
                signal.wait(until)

    def claimed(self) -> Claim:
        return self.guard.claim("test", self.guard.generation)

    def write(self, positions: tuple[float, ...]) -> bool:
        return self.guard.write(positions, self.claim, self.clock.now())

    @property
    def sent(self) -> list[str]:
        return [event.data.decode() for event in self.events if isinstance(event, FrameSent)]

    def board(self) -> tuple[float, ...]:
        self.wait(self.clock.now() + 10)
        return self.link.board.state(self.clock.now()).servos
