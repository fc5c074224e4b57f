"""The robot and its board: description, drivers, links, lifecycle, write guard and streamer."""

import typing

from .loading.lazy_exports import lazy_exports

if typing.TYPE_CHECKING:
    from .arm.arm import Arm as Arm
    from .arm.events import (
        ArmEvent as ArmEvent,
        BoardReturned as BoardReturned,
        BytesReceived as BytesReceived,
        CommandSent as CommandSent,
        Faulted as Faulted,
        FrameSent as FrameSent,
        Measured as Measured,
        StateChanged as StateChanged,
    )
    from .arm.lifecycle import TRANSITIONS as TRANSITIONS, State as State
    from .arm.schedule import (
        MAX_DURATION as MAX_DURATION,
        Schedule as Schedule,
        Setpoint as Setpoint,
        compile_schedule as compile_schedule,
        servo_path as servo_path,
    )
    from .arm.streamer import Playback as Playback, PlaybackState as PlaybackState
    from .clock import (
        Clock as Clock,
        RealClock as RealClock,
        SimulatedClock as SimulatedClock,
        utc_ns as utc_ns,
    )
    from .description.robot import CollisionRules as CollisionRules, Robot as Robot, Tool as Tool
    from .description.robot_file import load_robot as load_robot, shipped_robots as shipped_robots
    from .drivers.board_protocol import BoardProtocol as BoardProtocol, Measurement as Measurement
    from .drivers.firmware_profile import Ability as Ability, Firmware as Firmware, Words as Words
    from .drivers.virtual.in_process_link import BoardLink as BoardLink
    from .drivers.wire_format import Frame as Frame
    from .errors import (
        ActivationStopped as ActivationStopped,
        ArmtreeError as ArmtreeError,
        BadPosition as BadPosition,
        CancelTimeout as CancelTimeout,
        DescriptionError as DescriptionError,
        HardwareError as HardwareError,
        HostLimit as HostLimit,
        InternalError as InternalError,
        LinkError as LinkError,
        NoDriver as NoDriver,
        NotActive as NotActive,
        PortNotGiven as PortNotGiven,
        TransitionRefused as TransitionRefused,
        WriteRefused as WriteRefused,
        host_limit as host_limit,
    )
    from .files import read_file as read_file, write_file as write_file
    from .joints import (
        DISPLAY_UNITS as DISPLAY_UNITS,
        Joint as Joint,
        Mimic as Mimic,
        check_position as check_position,
        check_positions as check_positions,
    )
    from .link.link import VIRTUAL as VIRTUAL, Link as Link
    from .link.serial_link import SerialLink as SerialLink
    from .link.serial_ports import (
        Check as Check,
        check_port as check_port,
        serial_ports as serial_ports,
    )
else:
    __getattr__ = lazy_exports(__name__)
