"""Libraries of others drive the virtual bus unchanged, through a pseudo-terminal in real time."""

from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
import rustypot
import scservo_sdk
import st3215

from hardware import RealClock
from hardware.drivers.feetech.registers import STS
from hardware.drivers.feetech.virtual.bus import Bus, BusState
from hardware.drivers.feetech.virtual.servo import Servo
from hardware.drivers.virtual.board_process import BoardProcess

pytestmark = pytest.mark.slow

BAUD = 1_000_000
IDS = [1, 2, 3, 4, 5, 6]
STARTS = {servo: 2000 + servo for servo in IDS}
PATIENCE = 60.0  # longer than anything here takes [s]
# Longest wait of a client for an answer. The defaults of two of them, 34 and 50 ms, are enough for
# the virtual bus, which answers within 1 ms. A busy machine may not run it, or the client, so long.
ANSWER = 0.5  # [s]


@pytest.fixture
def bus() -> Iterator[BoardProcess]:
    with closing(
        BoardProcess(Bus([Servo(STS, *each) for each in STARTS.items()], BAUD))
    ) as process:
        process.state()  # it has started
        yield process


def until(bus: BoardProcess, so: Callable[[BusState], bool]) -> None:
    clock = RealClock()
    signal, deadline = clock.signal(), clock.now() + PATIENCE
    while not so(state := bus.state()):
        assert clock.now() < deadline, state
        with signal:
            signal.wait(clock.now() + 0.01)


def test_the_sdk_of_the_maker(bus: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    # The SDK waits twice this time.
    monkeypatch.setattr(scservo_sdk.port_handler, "LATENCY_TIMER", ANSWER * 500)
    port, packets = scservo_sdk.PortHandler(bus.port), scservo_sdk.PacketHandler(0)
    assert port.openPort()
    for servo in IDS:
        model, result, error = packets.ping(port, servo)
        assert (model, result, error) == (777, scservo_sdk.COMM_SUCCESS, 0)
    reader = scservo_sdk.GroupSyncRead(port, packets, 56, 2)
    for servo in IDS:
        assert reader.addParam(servo)
    assert reader.txRxPacket() == scservo_sdk.COMM_SUCCESS
    assert {servo: reader.getData(servo, 56, 2) for servo in IDS} == STARTS
    assert packets.write1ByteTxRx(port, 1, 40, 1) == (scservo_sdk.COMM_SUCCESS, 0)
    writer = scservo_sdk.GroupSyncWrite(port, packets, 42, 2)
    assert writer.addParam(1, [2500 % 256, 2500 // 256])
    assert writer.txPacket() == scservo_sdk.COMM_SUCCESS
    until(bus, lambda state: abs(state.positions[1] - 2500) < 2)
    assert packets.ping(port, 9)[1] == scservo_sdk.COMM_RX_TIMEOUT
    port.closePort()


def test_st3215(bus: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(st3215.port_handler, "LATENCY_TIMER", ANSWER * 1000)
    servos = st3215.ST3215(bus.port)
    assert servos.PingServo(3)
    assert not servos.PingServo(9)
    assert servos.ReadTemperature(3) == 25
    assert servos.ReadVoltage(3) == pytest.approx(12.0)
    assert servos.ReadPosition(3) == STARTS[3]
    assert servos.StartServo(3)
    assert servos.MoveTo(3, 2300)
    until(bus, lambda state: abs(state.positions[3] - 2300) < 2)


def test_rustypot(bus: BoardProcess) -> None:
    servos = rustypot.Sts3215PyController(bus.port, BAUD, ANSWER)
    assert servos.ping(2)
    assert not servos.ping(9)
    assert list(servos.sync_read_raw_present_position(IDS)) == list(STARTS.values())
    servos.sync_write_torque_enable(IDS, [True] * 6)
    servos.sync_write_raw_goal_position(IDS, [2100] * 6)
    until(bus, lambda state: all(abs(each - 2100) < 2 for each in state.positions.values()))
    assert all(bus.state().torque.values())
