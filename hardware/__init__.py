"""The robot and its board: description, drivers, links, lifecycle, write guard and streamer."""

import importlib
import typing

if typing.TYPE_CHECKING:
    from .arm.arm import Arm
    from .arm.events import (
        ArmEvent,
        BoardReturned,
        BytesReceived,
        CommandSent,
        Faulted,
        FrameSent,
        Observer,
        StateChanged,
    )
    from .arm.interfaces import state_interfaces
    from .arm.lifecycle import TRANSITIONS, State
    from .arm.schedule import Schedule, Setpoint, compile_schedule, servo_path
    from .arm.streamer import Playback, PlaybackState
    from .clock import Clock, RealClock, Signal, SimulatedClock
    from .description.robot import CollisionRules, Robot, Serial, Tool
    from .description.robot_file import load_robot
    from .drivers.arduino.frames import Codec, WireField
    from .drivers.arduino.serial_servo import FIRMWARES, VIRTUAL
    from .drivers.arduino.virtual.arduino import VirtualArduino, VirtualLink
    from .drivers.arduino.virtual.board import Board, BoardState
    from .drivers.arduino.virtual.link import BoardLink
    from .drivers.driver import Frame
    from .drivers.firmware_profile import Firmware
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
        PoseOutsideLimits,
        StaleGeneration,
        TooFast,
        TransitionRefused,
        WriteRefused,
        WrongFirmware,
    )
    from .joints import Joint, Mimic, check_position
    from .link.link import Link
    from .link.serial_link import SerialLink
    from .link.serial_ports import Check, SerialPort, check_port, serial_ports
    from .simulation import virtual_board

__all__ = [
    "FIRMWARES",
    "TRANSITIONS",
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
    "PoseOutsideLimits",
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
    "serial_ports",
    "servo_path",
    "state_interfaces",
    "virtual_board",
]

# Loaded at their first use: most programs need few of them.
_MODULES = {
    "arm.arm": ("Arm",),
    "arm.events": (
        "ArmEvent",
        "BoardReturned",
        "BytesReceived",
        "CommandSent",
        "Faulted",
        "FrameSent",
        "Observer",
        "StateChanged",
    ),
    "arm.interfaces": ("state_interfaces",),
    "arm.lifecycle": (
        "TRANSITIONS",
        "State",
    ),
    "arm.schedule": (
        "Schedule",
        "Setpoint",
        "compile_schedule",
        "servo_path",
    ),
    "arm.streamer": (
        "Playback",
        "PlaybackState",
    ),
    "clock": (
        "Clock",
        "RealClock",
        "Signal",
        "SimulatedClock",
    ),
    "description.robot": (
        "CollisionRules",
        "Robot",
        "Serial",
        "Tool",
    ),
    "description.robot_file": ("load_robot",),
    "drivers.arduino.frames": (
        "Codec",
        "WireField",
    ),
    "drivers.arduino.serial_servo": (
        "FIRMWARES",
        "VIRTUAL",
    ),
    "drivers.arduino.virtual.arduino": (
        "VirtualArduino",
        "VirtualLink",
    ),
    "drivers.arduino.virtual.board": (
        "Board",
        "BoardState",
    ),
    "drivers.arduino.virtual.link": ("BoardLink",),
    "drivers.driver": ("Frame",),
    "drivers.firmware_profile": ("Firmware",),
    "errors": (
        "ActivationStopped",
        "BadPosition",
        "BoardReset",
        "BoardSilent",
        "CancelTimeout",
        "DescriptionError",
        "DriverFailed",
        "FrameLost",
        "HardwareError",
        "InterfaceClaimed",
        "InterfaceUnknown",
        "LinkError",
        "NoDriver",
        "NotActive",
        "PortBusy",
        "PortDenied",
        "PortLost",
        "PortMissing",
        "PortNotGiven",
        "PortStalled",
        "PoseOutsideLimits",
        "StaleGeneration",
        "TooFast",
        "TransitionRefused",
        "WriteRefused",
        "WrongFirmware",
    ),
    "joints": (
        "Joint",
        "Mimic",
        "check_position",
    ),
    "link.link": ("Link",),
    "link.serial_ports": (
        "Check",
        "SerialPort",
        "check_port",
        "serial_ports",
    ),
    "link.serial_link": ("SerialLink",),
    "simulation": ("virtual_board",),
}


def __getattr__(name: str) -> typing.Any:
    for module, names in _MODULES.items():
        if name in names:
            globals()[name] = value = getattr(importlib.import_module(f".{module}", __name__), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
