"""The arm as it is: description, wire format, link, lifecycle, guard and streamer."""

from .arm import Arm
from .clock import Clock, RealClock, Signal, SimulatedClock
from .description import load_robot
from .errors import (
    ActivationStopped,
    BadPosition,
    BoardReset,
    BoardSilent,
    CancelTimeout,
    DescriptionError,
    DriverFailed,
    FrameLost,
    HardwareError,
    InterfaceClaimed,
    InterfaceUnknown,
    LinkError,
    NoDriver,
    NotActive,
    PortBusy,
    PortDenied,
    PortLost,
    PortMissing,
    PortNotGiven,
    PortStalled,
    PoseOutside,
    StaleGeneration,
    TooFast,
    TransitionRefused,
    WriteRefused,
    WrongFirmware,
)
from .events import (
    ArmEvent,
    BoardReturned,
    BytesReceived,
    CommandSent,
    Faulted,
    FrameSent,
    Observer,
    StateChanged,
)
from .frames import Codec, Frame, WireField, check_position
from .interfaces import states
from .joints import Joint, Mimic
from .lifecycle import State
from .link import Link
from .ports import Check, SerialPort, check_port, serial_ports
from .profiles import FIRMWARES, Firmware
from .robot import CollisionRules, Robot, Serial, Tool
from .schedule import Schedule, Setpoint, compile_schedule, played
from .serial_link import SerialLink
from .serial_servo import VIRTUAL, virtual_board
from .streamer import Playback, PlaybackState
from .virtual.arduino import VirtualArduino, VirtualLink
from .virtual.board import Board, BoardState
from .virtual.link import BoardLink

__all__ = [
    "FIRMWARES",
    "VIRTUAL",
    "ActivationStopped",
    "Arm",
    "ArmEvent",
    "BadPosition",
    "Board",
    "BoardLink",
    "BoardReset",
    "BoardReturned",
    "BoardSilent",
    "BoardState",
    "BytesReceived",
    "CancelTimeout",
    "Check",
    "Clock",
    "Codec",
    "CollisionRules",
    "CommandSent",
    "DescriptionError",
    "DriverFailed",
    "Faulted",
    "Firmware",
    "Frame",
    "FrameLost",
    "FrameSent",
    "HardwareError",
    "InterfaceClaimed",
    "InterfaceUnknown",
    "Joint",
    "Link",
    "LinkError",
    "Mimic",
    "NoDriver",
    "NotActive",
    "Observer",
    "Playback",
    "PlaybackState",
    "PortBusy",
    "PortDenied",
    "PortLost",
    "PortMissing",
    "PortNotGiven",
    "PortStalled",
    "PoseOutside",
    "RealClock",
    "Robot",
    "Schedule",
    "Serial",
    "SerialLink",
    "SerialPort",
    "Setpoint",
    "Signal",
    "SimulatedClock",
    "StaleGeneration",
    "State",
    "StateChanged",
    "TooFast",
    "Tool",
    "TransitionRefused",
    "VirtualArduino",
    "VirtualLink",
    "WireField",
    "WriteRefused",
    "WrongFirmware",
    "check_port",
    "check_position",
    "compile_schedule",
    "load_robot",
    "played",
    "serial_ports",
    "states",
    "virtual_board",
]
