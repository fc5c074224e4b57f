"""What is recorded of the exchanges with a resting and a moving bus."""

import math

from executive.recording.exchanges import Exchanges
from hardware import ArmEvent, BytesReceived, CommandSent, FrameSent, Measured, Measurement


class Bus:
    """Exchanges, and what was recorded of them."""

    def __init__(self) -> None:
        self.recorded: list[ArmEvent] = []
        self.exchanges = Exchanges(self.recorded.append)
        self.time = 0.0

    def take(self, *events: ArmEvent) -> list[ArmEvent]:
        """Takes events, and returns those that were recorded."""
        self.recorded.clear()
        for event in events:
            self.exchanges.take(event)
        return list(self.recorded)

    def exchange(
        self,
        degrees: float = 0.0,
        celsius: float = 25.0,
        volts: float = 12.0,
        effort: float = 0.0,
        wait: float = 0.2,
    ) -> int:
        """Asks and answers, and returns the number of recorded events."""
        self.time += wait
        measurement = Measurement(
            (math.radians(degrees),), effort=(effort,), temperature=(celsius,), voltage=(volts,)
        )
        return len(
            self.take(
                CommandSent(self.time, b"?", request=True),
                BytesReceived(self.time, b"!"),
                BytesReceived(self.time, b"!"),
                Measured(self.time, measurement),
            )
        )


def test_a_resting_arm_is_recorded_when_something_changes_and_after_10_s() -> None:
    bus = Bus()
    assert [bus.exchange() for _ in range(3)] == [4, 0, 0]
    assert [bus.exchange(0.4), bus.exchange(0.6), bus.exchange(0.4)] == [0, 4, 0]
    assert [bus.exchange(0.6, 26), bus.exchange(0.6, 26, 11.4), bus.exchange(0.6, 26, 11.4)] == [
        4,
        4,
        0,
    ]
    assert sum(bus.exchange(0.6, 26, 11.4) > 0 for _ in range(510)) == 10  # in 102 s


def test_a_push_that_does_not_move_a_resting_arm_is_recorded() -> None:
    bus = Bus()
    assert [bus.exchange(effort=0.2), bus.exchange(effort=0.25)] == [4, 0]
    assert [bus.exchange(effort=0.35), bus.exchange(effort=-0.35)] == [4, 4]


def test_every_exchange_after_a_frame_is_recorded() -> None:
    bus = Bus()
    bus.exchange()
    for _ in range(3):
        assert len(bus.take(FrameSent(bus.time, b"f", (0.0,), bus.time))) == 1
        assert bus.exchange() == 4


def test_an_answer_that_is_missing_is_recorded() -> None:
    bus = Bus()
    bus.exchange()
    request = CommandSent(bus.time, b"?", request=True)
    assert bus.take(request, BytesReceived(bus.time, b"\xff")) == []
    assert bus.take(request) == [request, BytesReceived(bus.time, b"\xff")]


def test_what_is_held_back_is_recorded_before_anything_else() -> None:
    bus = Bus()
    bus.exchange()
    request, setting = CommandSent(0.0, b"?", request=True), CommandSent(0.0, b"torque")
    assert bus.take(request, setting) == [request, setting]


def test_a_new_recording_begins_with_a_measurement() -> None:
    bus = Bus()
    assert [bus.exchange(), bus.exchange()] == [4, 0]
    bus.exchanges.restart()
    assert bus.exchange() == 4
