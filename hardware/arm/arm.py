"""The arm: its lifecycle, its connection, and the motions that it plays."""

import atexit
import contextlib
import logging
import weakref
from collections.abc import Callable
from dataclasses import asdict
from functools import cache, partial
from queue import SimpleQueue
from typing import ParamSpec, Self, TypeVar

from hardware.clock import Clock, RealClock
from hardware.description.robot import Robot
from hardware.drivers.board_protocol import Measurement
from hardware.drivers.firmware_profile import Ability
from hardware.errors import (
    ActivationStopped,
    HardwareError,
    NotActive,
    PortLost,
    PortNotGiven,
    TransitionRefused,
    as_hardware_error,
)
from hardware.link.link import Link

from .connection import Connection
from .events import ArmEvent, Faulted, Observer, StateChanged
from .lifecycle import Lifecycle, Result, State
from .reconnect import ReconnectWatcher
from .schedule import Schedule
from .streamer import Playback, Streamer

P = ParamSpec("P")
T = TypeVar("T")

_Release = Callable[[], None]

logger = logging.getLogger(__name__)

# Longest time that a shutdown waits for a transition of another thread [s]. Closing a port takes
# less time, because every call has a deadline.
_SETTLE_TIMEOUT = 3.0

_arms: "weakref.WeakSet[Arm]" = weakref.WeakSet()  # arms to shut down when the interpreter exits


def _ignore(event: ArmEvent) -> None:
    """Ignore an event."""


def _nothing() -> None:
    """Do nothing while the board boots."""


def _at_once(timeout: float) -> bool:
    """Return True: the next frame may be sent at once."""
    return True


class Arm:
    """A robot arm. It moves open loop: a motion starts at the last commanded positions.

    An executive uses this class. Other programs use `armtree.Arm`, which runs tasks.

    The end of a `with` block and the exit of the interpreter shut the arm down. Garbage collection
    of the arm closes its port.

    Args:
        robot: The robot.
        link: Link to the board, or None if no port is configured.
        clock: Time source.
        observe: Callback for every event, from any thread; frames come in the order of sending. It
            must return quickly, because the calling thread waits. It may stop the arm and may take
            locks. If a thread holds such a lock while it calls `stop`, the lock must be re-entrant.
            The arm logs exceptions of the callback and continues.
        ready: Callback that waits until the next frame may be sent, at most the given time [s].
            It returns True if the frame may be sent. It raises `WriteRefused` to end the motion.
            Default: every frame may be sent at once.
    """

    def __init__(
        self,
        robot: Robot,
        link: Link | None,
        clock: Clock,
        observe: Observer = _ignore,
        ready: Callable[[float], bool] = _at_once,
    ) -> None:
        self.robot, self._ready = robot, ready
        self._link, self._clock, self._observe = link, clock, observe
        self._signal = clock.signal()
        self._canceled = self._faulting = False
        self._start_pose, self._meanwhile = robot.boot_pose, _nothing
        self._refusal: HardwareError | None = None  # cause of the last refusal
        self._failure: HardwareError | None = None  # the fault that ended the activation
        self._connection: Connection | None = None
        self._reconnect: ReconnectWatcher | None = None
        self._release: weakref.finalize[[_Release], Arm] | None = None
        callbacks = {
            State.CONFIGURING: self._configure,
            State.ACTIVATING: self._activate,
            State.DEACTIVATING: self._deactivate,
            State.SHUTTINGDOWN: self._deactivate,
            State.ERRORPROCESSING: self._process_error,
        }
        self._lifecycle = Lifecycle(
            {state: _weakly(callback, Result.ERROR) for state, callback in callbacks.items()},
            _weakly(self._state_changed, None),
        )
        _arms.add(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.shutdown()

    @property
    def state(self) -> State:
        """State of the lifecycle."""
        return self._lifecycle.state

    @property
    def failure(self) -> HardwareError | None:
        """The fault that took the arm out of *active*; None again after the next activation."""
        return self._failure

    @property
    def commanded(self) -> tuple[float, ...]:
        """Last commanded positions, one per actuated joint [rad].

        Raises:
            NotActive: The arm is not active, so its pose is unknown.
        """
        return self._active_connection().guard.commanded

    @property
    def measured(self) -> Measurement | None:
        """Last measurement; None if the port is closed or the board does not measure."""
        connection = self._connection
        return connection.session.measured if connection else None

    def check_active(self) -> None:
        """Check that a motion may start.

        Raises:
            NotActive: The arm is not active, or a fault is ending its activation.
        """
        if self._failure or self.state is not State.ACTIVE:
            raise self._not_active()

    def configure(self) -> None:
        """Check that a port is configured. The port is not opened.

        Raises:
            PortNotGiven: No port is configured. The arm stays unconfigured.
            TransitionRefused: The transition is not legal now.
        """
        self._request("configure", State.INACTIVE)

    def activate(
        self,
        start_pose: tuple[float, ...] | None = None,
        meanwhile: Callable[[], None] = _nothing,
    ) -> None:
        """Open the port and wait for the board to boot. Most boards reset, which may move the arm.

        Args:
            start_pose: Pose of the arm when the port opens, one position per actuated joint [rad].
                Default: the start pose of the robot file.
            meanwhile: Callback while the board boots. It may wait, and it may stop the arm. A board
                that reports its pose is asked after it.

        Raises:
            LinkError: The port cannot be opened; the arm stays inactive. Or the port was lost
                during the boot; the arm is then unconfigured.
            BoardError: The robot file names another board, or the arm may not move from its pose.
            DriverFailed: The driver raised another exception.
            ActivationStopped: `stop` was called during the boot; the arm is then inactive. Or
                `stop` was called before all joints were within their limits; servos with torque
                then hold their measured positions, and the arm is unconfigured.
            TransitionRefused: The transition is not legal now.
        """
        self._start_pose, self._meanwhile = start_pose or self.robot.boot_pose, meanwhile
        self._request("activate", State.ACTIVE)
        if self._canceled and (stopped := self._activation_ended):  # canceled after the last check
            self.deactivate()
            raise stopped
        if connection := self._connection:
            connection.send_start_commands()
        with self._signal:  # another thread that reports a fault may still be holding the arm
            until = self._clock.now() + _SETTLE_TIMEOUT
            while self._faulting and self._clock.now() < until:
                self._signal.wait(until)
        if self._failure:  # a fault came during the transition, which refuses raise_error
            with contextlib.suppress(TransitionRefused):
                self._transition("raise_error")
            raise self._failure

    def deactivate(self) -> None:
        """Stop the arm and close the port. The servos keep holding.

        Raises:
            TransitionRefused: The transition is not legal now.
        """
        self._stop_and_settle()
        self._request("deactivate", State.INACTIVE)

    def cleanup(self) -> None:
        """Drop the configuration.

        Raises:
            TransitionRefused: The transition is not legal now.
        """
        self._request("cleanup", State.UNCONFIGURED)

    def shutdown(self) -> None:
        """Stop the arm, close the port, and finalize the arm. Does nothing if it is finalized.

        This method first waits for the end of a transition that another thread requested.

        Raises:
            TransitionRefused: The transition of the other thread does not end.
        """
        self._stop_and_settle()
        self._cancel()
        self._settle()
        if self.state is not State.FINALIZED:
            self._request("shutdown", State.FINALIZED)

    def read(self) -> dict[str, float]:
        """Return the values of the state interfaces by name, such as `joint_1/position` [rad].

        These are commanded values, also of mimic joints. Measured values have names such as
        `joint_1/measured/position` [rad] and `joint_1/measured/temperature` [C], with the units of
        `Measurement`.

        Raises:
            NotActive: The arm is not active, so its pose is unknown.
        """
        commanded = self.robot.of_all_joints(self.robot.by_joint(self.commanded))
        interfaces = {f"{name}/position": position for name, position in commanded.items()}
        for quantity, values in asdict(self.measured).items() if self.measured else ():
            # An empty list of values is not measured.
            for joint, value in zip(self.robot.actuated, values, strict=False):
                interfaces[f"{joint.name}/measured/{quantity}"] = value
        return interfaces

    @property
    def generation(self) -> int:
        """Number of ended motions and stops. A motion planned before a change cannot start.

        Raises:
            NotActive: The arm is not active.
        """
        return self._active_connection().guard.generation

    def play(
        self, schedule: Schedule, on_change: Callable[[], None], owner: str, generation: int
    ) -> Playback:
        """Start to play a schedule.

        Args:
            schedule: The schedule.
            on_change: Callback after every frame and at the end of the motion, from another thread.
                It may also be called without a change. It may take locks. The arm logs its
                exceptions.
            owner: Name of the owner of the motion, for error messages.
            generation: Generation of the arm in which the motion was planned.

        Raises:
            NotActive: The arm is not active.
            ArmClaimed: Another motion is being played. Stop it first.
            StaleGeneration: The arm was stopped, or another motion ended, after the planning.
        """
        if connection := self._connection:
            connection.wait_for_torque()
        streamer = self._streamer
        if self.state is not State.ACTIVE or streamer is None:
            raise self._not_active()
        return streamer.play(schedule, on_change, owner, generation)

    @property
    def torque(self) -> bool:
        """True if the servos have torque. Always True if the board cannot switch the torque.

        Raises:
            NotActive: The arm is not active.
        """
        return self._active_connection().guard.torque

    def switch_torque(self, on: bool) -> None:
        """Switch the torque of all servos, and wait until it is switched. This ends any motion.

        Without torque, gravity moves the arm, so a person must hold it. No frame is sent until the
        torque is on again. The arm then holds its measured pose.

        Raises:
            NotAble: The board of the robot cannot switch the torque.
            NotActive: The arm is not active.
            PoseOutsideLimits: The arm is outside its limits. The torque is still off.
            ActivationStopped: The arm was stopped before all joints were within their limits. Its
                servos with torque hold their measured positions. The arm is unconfigured.
        """
        self.robot.require(Ability.TORQUE)
        self._active_connection().switch_torque(on)

    def stop(self) -> None:
        """Drop the rest of the motion and hold. Allowed in any state, any number of times.

        The board still executes the frames that it has received. A stop during the boot ends the
        activation. A robot with `brake_s` slows down first. A second stop does not shorten the
        slowing down.
        """
        self._cancel()
        connection = self._connection
        if self.state is State.ACTIVE and connection:
            connection.hold(self.robot.brake)

    def fault(self, cause: BaseException) -> None:
        """Take the arm out of *active* because of an error. Only a person can activate it again.

        Only the first fault of an activation is reported.

        Args:
            cause: The error.
        """
        error = as_hardware_error(cause)
        with self._signal:
            if self._failure:
                return
            self._failure, self._faulting = error, True
            self._signal.notify()
        try:
            self._report(error)
        finally:
            with self._signal:
                self._faulting = False
                self._signal.notify()

    def _report(self, error: HardwareError) -> None:
        """Hold the arm after a fault, report the fault, and take the arm out of *active*."""
        if streamer := self._streamer:
            streamer.close(error)
        if (connection := self._connection) and self.state is State.ACTIVE:
            connection.send_fault_commands(error)
        logger.error("%s", error)
        self._publish(Faulted(self._clock.now(), error))
        if self._reconnect and isinstance(error, PortLost):
            self._reconnect.start()
        with contextlib.suppress(TransitionRefused):  # only *active* allows raise_error
            self._transition("raise_error")

    def _is_active(self) -> bool:
        return self.state is State.ACTIVE

    def _stop_and_settle(self) -> None:
        connection = self._connection
        if self.state is State.ACTIVE and connection:
            connection.stop_and_settle()

    def _notify(self) -> None:
        """Wake threads that wait for the boot or for the end of a transition."""
        with self._signal:
            self._signal.notify()

    def _cancel(self) -> None:
        """End an activation in progress."""
        with self._signal:
            self._canceled = self.state is State.ACTIVATING
            self._signal.notify()

    def _settle(self) -> None:
        """Wait until other threads have processed a transition or a fault."""
        until = self._clock.now() + _SETTLE_TIMEOUT
        with self._signal:
            while self._is_changing() and self._clock.now() < until:
                self._signal.wait(until)

    def _is_changing(self) -> bool:
        faulting = self._failure is not None and self.state is State.ACTIVE
        return faulting or self._lifecycle.changing

    def _request(self, label: str, wanted: State) -> None:
        if self._transition(label) is not wanted:
            refusal, self._refusal = self._refusal, None
            raise refusal or TransitionRefused(
                f"{label} failed: the arm is {self.state.value}", "fix the cause that the log names"
            )

    def _transition(self, label: str) -> State:
        try:
            return self._lifecycle.request(label)
        finally:
            self._notify()

    @property
    def _streamer(self) -> Streamer | None:
        connection = self._connection
        return connection.streamer if connection else None

    def _active_connection(self) -> Connection:
        """Return the connection of an active arm.

        Raises:
            NotActive: The arm is not active.
        """
        connection = self._connection
        if self.state is not State.ACTIVE or connection is None:
            raise self._not_active()
        return connection

    def _not_active(self) -> NotActive:
        failing = self.state in (State.ACTIVE, State.ERRORPROCESSING)
        state = "failing" if failing else self.state.value
        again, activate = "start armtree again", "`armtree arm activate`"
        advice, hint = {
            State.INACTIVE: ("activate it first", activate),
            State.FINALIZED: (again, again),
        }.get(
            self.state,
            ("configure and activate it first", f"`armtree arm configure`, then {activate}"),
        )
        why = f"; it failed: {self._failure}" if self._failure else ""
        return NotActive(f"the arm is {state}; {advice}{why}", hint)

    def _configure(self) -> Result:
        self._stop_reconnect()
        if self._link is None:
            self._refusal = PortNotGiven()
            logger.error("%s", self._refusal)
            return Result.FAILURE
        return Result.SUCCESS

    def _activate(self) -> Result:
        assert self._link
        port = self._link.port
        with self._signal:
            self._failure = None
        logger.info("Starting the arm on port %s: it %s", port, self.robot.open_effect)
        self._connection = connection = Connection(
            self.robot,
            self._start_pose,
            self._link,
            self._clock,
            _weakly(self._publish, None),
            _weakly(self._is_active, False),
            _weakly(self.fault, None),
            _weakly(self._notify, None),
            self._ready,
        )
        try:
            publish = _weakly(self._publish, None)
            self._reconnect = ReconnectWatcher(port, self._clock, publish)
            self._when_collected(partial(_release, connection, self._reconnect))
            connection.open()
            self._boot(connection)
        except Exception as error:  # a driver may raise any exception
            self._refusal = as_hardware_error(error)
            if error is self._failure:
                return Result.ERROR
            logger.error("The arm on port %s did not start: %s", port, self._refusal)
            self._close()
            return Result.FAILURE
        logger.info("The arm on port %s is ready to take commands", port)
        return Result.SUCCESS

    def _boot(self, connection: Connection) -> None:
        """Wait until the board has booted: until its report, or for `boot_wait` of the robot."""
        session, wait = connection.session, self.robot.serial.boot_wait
        until = self._clock.now() + wait
        self._meanwhile()
        if self.robot.firmware.reports_pose:
            until = self._clock.now() + wait
        while not self._activation_ended:
            earliest = connection.guard.poll()  # without the lock: it calls an observer
            with self._signal:
                booted = session.boot_frame or self._clock.now() >= until
                if booted:
                    break
                self._signal.wait(min(until, max(session.next_poll, earliest)))
        if not self._activation_ended:
            connection.start(wait)
        if error := self._activation_ended:
            raise error

    @property
    def _activation_ended(self) -> HardwareError | None:
        """The fault or ActivationStopped that ends this activation, or None."""
        if self._failure or not self._canceled:
            return self._failure
        return ActivationStopped("the arm was stopped while its board booted")

    def _deactivate(self) -> Result:
        self._stop_reconnect()
        port = self._link.port if self._link and self._connection else None
        if port:
            logger.info("Stopping the arm on port %s", port)
        self._close()
        if port:
            logger.info("The arm on port %s is stopped", port)
        return Result.SUCCESS

    def _stop_reconnect(self) -> None:
        if self._reconnect:
            self._reconnect.stop()

    def _process_error(self) -> Result:
        self._close(self._failure)
        return Result.SUCCESS

    def _close(self, error: HardwareError | None = None) -> None:
        if connection := self._connection:
            connection.close(error)
            self._connection = None
            if self._reconnect:  # without the connection, whose link may keep the arm alive
                self._when_collected(self._reconnect.stop)

    def _when_collected(self, release: _Release) -> None:
        """Set the function to call after the garbage collection of the arm, in place of others."""
        if self._release:
            self._release.detach()
        self._release = weakref.finalize(self, _releaser().put, release)
        self._release.atexit = False  # at exit, _arms are shut down

    def _state_changed(self, label: str, start: State, goal: State) -> None:
        if goal is State.INACTIVE:  # a later stop belongs to the next activation
            with self._signal:
                self._canceled = False
        elif goal is State.FINALIZED:
            self._close(self._failure)  # two Ctrl-C may have interrupted the first close
        self._publish(StateChanged(self._clock.now(), label, start, goal))

    def _publish(self, event: ArmEvent) -> None:
        try:
            self._observe(event)
        except Exception:
            logger.exception("an observer of the arm failed")


def _weakly(method: Callable[P, T], collected: T) -> Callable[P, T]:
    """Return a callback that does not keep the object of a method alive.

    Args:
        method: The method to call.
        collected: Result of the callback after the garbage collection of the object.
    """
    reference = weakref.WeakMethod(method)

    def call(*arguments: P.args, **named: P.kwargs) -> T:
        bound = reference()
        return bound(*arguments, **named) if bound else collected

    return call


def _release(connection: Connection, reconnect: ReconnectWatcher) -> None:
    """Close the connection of an arm after its garbage collection."""
    reconnect.stop()
    connection.close()


@cache
def _releaser() -> "SimpleQueue[_Release]":
    """Return the queue of a thread that closes connections of garbage-collected arms.

    Any thread may collect an arm, and may hold any lock. `put` takes no lock.
    """
    queue = SimpleQueue[_Release]()

    def work() -> None:
        while True:
            queue.get()()

    RealClock().spawn(work, "releaser")
    return queue


@atexit.register
def _shut_down_all() -> None:
    for arm in list(_arms):
        with contextlib.suppress(TransitionRefused):  # another thread shuts it down
            arm.shutdown()
