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
        StateChanged,
    )
    from .arm.interfaces import state_interfaces
    from .arm.lifecycle import TRANSITIONS, State
    from .arm.schedule import Schedule, Setpoint, compile_schedule, servo_path
    from .arm.streamer import Playback, PlaybackState
    from .clock import Clock, RealClock, SimulatedClock
    from .description.robot import CollisionRules, Robot, Tool
    from .description.robot_file import load_robot
    from .drivers.arduino.serial_servo import VIRTUAL
    from .drivers.arduino.virtual.link import BoardLink
    from .drivers.driver import Frame
    from .drivers.firmware_profile import Firmware
    from .errors import (
        ActivationStopped,
        BadPosition,
        CancelTimeout,
        DescriptionError,
        HardwareError,
        LinkError,
        NoDriver,
        NotActive,
        PortNotGiven,
        TransitionRefused,
    )
    from .joints import Joint, Mimic, check_position
    from .link.link import Link
    from .link.serial_link import SerialLink
    from .link.serial_ports import Check, check_port, serial_ports
    from .simulation import virtual_board

__all__ = [
    "TRANSITIONS",
    "VIRTUAL",
    "ActivationStopped",
    "Arm",
    "ArmEvent",
    "BadPosition",
    "BoardLink",
    "BoardReturned",
    "BytesReceived",
    "CancelTimeout",
    "Check",
    "Clock",
    "CollisionRules",
    "CommandSent",
    "DescriptionError",
    "Faulted",
    "Firmware",
    "Frame",
    "FrameSent",
    "HardwareError",
    "Joint",
    "Link",
    "LinkError",
    "Mimic",
    "NoDriver",
    "NotActive",
    "Playback",
    "PlaybackState",
    "PortNotGiven",
    "RealClock",
    "Robot",
    "Schedule",
    "SerialLink",
    "Setpoint",
    "SimulatedClock",
    "State",
    "StateChanged",
    "Tool",
    "TransitionRefused",
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
        "SimulatedClock",
    ),
    "description.robot": (
        "CollisionRules",
        "Robot",
        "Tool",
    ),
    "description.robot_file": ("load_robot",),
    "drivers.arduino.serial_servo": ("VIRTUAL",),
    "drivers.arduino.virtual.link": ("BoardLink",),
    "drivers.driver": ("Frame",),
    "drivers.firmware_profile": ("Firmware",),
    "errors": (
        "ActivationStopped",
        "BadPosition",
        "CancelTimeout",
        "DescriptionError",
        "HardwareError",
        "LinkError",
        "NoDriver",
        "NotActive",
        "PortNotGiven",
        "TransitionRefused",
    ),
    "joints": (
        "Joint",
        "Mimic",
        "check_position",
    ),
    "link.link": ("Link",),
    "link.serial_ports": (
        "Check",
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
