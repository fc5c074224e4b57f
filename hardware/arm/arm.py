"""The arm: its lifecycle, its link, and what may be sent when."""

import atexit
import contextlib
import logging
import weakref
from collections.abc import Callable, Mapping
from typing import Self

from hardware.clock import Clock
from hardware.description.robot import Robot
from hardware.errors import (
    ActivationStopped,
    HardwareError,
    NoDriver,
    NotActive,
    PortLost,
    PortNotGiven,
    TransitionRefused,
    ours,
)
from hardware.link.link import Link

from .connection import Connection
from .events import ArmEvent, Faulted, Observer, StateChanged
from .interfaces import state_interfaces
from .lifecycle import Lifecycle, Result, State
from .reconnect import ReconnectWatcher
from .schedule import Schedule
from .streamer import Playback, Streamer
from .write_guard import WriteGuard

logger = logging.getLogger(__name__)

# Who shuts down waits this long for a transition of another thread. Closing a port takes less, even
# where a driver's write does not return.
_SETTLE = 3.0  # [s]

_arms: "weakref.WeakSet[Arm]" = weakref.WeakSet()  # to shut down when the interpreter exits


def _nobody(event: ArmEvent) -> None:
    """Watches nothing."""


class Arm:
    """A robot arm on a serial line, open loop: its state is what it was last commanded.

    Used as a context, it is shut down at the end; an interpreter that exits closes the port too.

    Args:
        robot: The robot.
        link: The line to its board; None where nobody said which port.
        clock: Whose time.
        observe: Told of every frame, byte, transition and fault, from any thread, frames in the
            order they went. It must be quick, for what tells it waits for it. It may stop the arm,
            and may take locks, re-entrant ones if they are held where the arm is stopped. What it
            raises is logged and keeps the arm from nothing.
    """

    def __init__(
        self, robot: Robot, link: Link | None, clock: Clock, observe: Observer = _nobody
    ) -> None:
        self.robot = robot
        self._link, self._clock, self._observe = link, clock, observe
        self._signal = clock.signal()
        self._canceled = False
        self._start_pose = robot.boot_pose
        self._refusal: HardwareError | None = None  # why the last request was not carried out
        self._failure: HardwareError | None = None  # the fault that ends this activation
        self._connection: Connection | None = None
        self._lookout: ReconnectWatcher | None = None
        self._lifecycle = Lifecycle(
            {
                State.CONFIGURING: self._configure,
                State.ACTIVATING: self._activate,
                State.DEACTIVATING: self._deactivate,
                State.SHUTTINGDOWN: self._deactivate,
                State.ERRORPROCESSING: self._give_up,
            },
            self._changed,
        )
        _arms.add(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.shutdown()

    @property
    def state(self) -> State:
        """Where the lifecycle stands."""
        return self._lifecycle.state

    @property
    def failure(self) -> HardwareError | None:
        """The fault that took the arm out of *active*; None once it is activated again."""
        return self._failure

    @property
    def commanded(self) -> tuple[float, ...]:
        """Where the arm was last commanded to, one value per actuated joint [rad].

        Raises:
            NotActive: Where an arm stands is only known once it was activated.
        """
        return self._open_door().commanded

    def check_active(self) -> None:
        """See that a motion may begin.

        Raises:
            NotActive: The arm is not active, or has failed and is about to be no longer.
        """
        if self._failure or self.state is not State.ACTIVE:
            raise self._not_active()

    def configure(self) -> None:
        """Check that all that is needed is there; never touches the port.

        Raises:
            PortNotGiven: No port was named; the arm stays unconfigured.
            TransitionRefused: Not legal now.
        """
        self._request("configure", State.INACTIVE)

    def activate(self, start_pose: tuple[float, ...] | None = None) -> None:
        """Open the port, which resets most boards and may move the arm, and wait for the boot.

        Args:
            start_pose: Pose of the arm when the port opens, one value per actuated joint [rad];
                default: the boot pose of the robot file.

        Raises:
            LinkError: The port cannot be had, and the arm stays inactive; or it was lost while the
                board booted, and the arm is unconfigured.
            BoardError: The board is not the one that the robot file names, or not in a pose from
                which the arm may move.
            DriverFailed: Something that is no error of ours came out of the driver.
            ActivationStopped: Somebody called `stop` while the board booted.
            TransitionRefused: Not legal now.
        """
        self._start_pose = start_pose or self.robot.boot_pose
        self._request("activate", State.ACTIVE)
        if connection := self._connection:
            connection.greet()
        if self._failure:  # in the very moment of becoming active, when it could not be raised
            with contextlib.suppress(TransitionRefused):
                self._transition("raise_error")
            raise self._failure

    def deactivate(self) -> None:
        """Stop, and close the port; the servos keep holding.

        Raises:
            TransitionRefused: Not legal now.
        """
        self._come_to_rest()
        self._request("deactivate", State.INACTIVE)

    def cleanup(self) -> None:
        """Forget the configuration.

        Raises:
            TransitionRefused: Not legal now.
        """
        self._request("cleanup", State.UNCONFIGURED)

    def shutdown(self) -> None:
        """Stop, close the port, and end for good. Harmless when it has ended.

        A transition that another thread has under way comes to its end first.

        Raises:
            TransitionRefused: That transition does not end.
        """
        self._come_to_rest()
        self._cancel()
        self._settle()
        if self.state is not State.FINALIZED:
            self._request("shutdown", State.FINALIZED)

    def read(self) -> Mapping[str, float]:
        """The state interfaces, such as `joint_1/position`, and their values [rad].

        Open loop: they are what was commanded, and joints that follow others do so exactly.

        Raises:
            NotActive: Where an arm stands is only known once it was activated.
        """
        return state_interfaces(self.robot, self.commanded)

    @property
    def generation(self) -> int:
        """Counts the ends of motions, and stops; a motion is decided on in one.

        Raises:
            NotActive: The arm is not active.
        """
        return self._open_door().generation

    def play(
        self, schedule: Schedule, changed: Callable[[], None], owner: str, generation: int
    ) -> Playback:
        """Begin to play a schedule.

        Args:
            schedule: What to play.
            changed: Called from another thread after every frame and at the end, and sometimes
                where nothing has changed. It may take locks; what it raises is logged.
            owner: Whose motion it is, for whoever is refused meanwhile.
            generation: The arm's, when the motion was decided on.

        Raises:
            NotActive: The arm is not active.
            InterfaceClaimed: Another motion is being played; stop it first.
            StaleGeneration: There was a stop, or another motion, since then.
            PortStalled: A write does not return.
        """
        streamer = self._streamer
        if self.state is not State.ACTIVE or streamer is None:
            raise self._not_active()
        return streamer.play(schedule, changed, owner, generation)

    def stop(self) -> None:
        """Drop what is left of the motion and hold; in any state, any number of times.

        What the board has already swallowed it still carries out. While the board boots, this
        ends the activation. A robot that brakes slows down first, and another stop does not
        shorten that.
        """
        self._cancel()
        connection = self._connection
        if self.state is State.ACTIVE and connection:
            connection.hold(self.robot.brake)

    def fault(self, cause: BaseException) -> None:
        """Take the arm out of *active*, for this error; coming back is a person's act.

        The first fault of an activation counts; those that follow from it are not told again.
        """
        error = ours(cause)
        with self._signal:
            if self._failure:
                return
            self._failure = error
            self._signal.notify()
        if streamer := self._streamer:
            streamer.close(error)
        logger.error("%s", error)
        self._tell(Faulted(self._clock.now(), error))
        if self._lookout and isinstance(error, PortLost):
            self._lookout.begin()
        with contextlib.suppress(TransitionRefused):  # outside active it changes no state
            self._transition("raise_error")

    def _come_to_rest(self) -> None:
        connection = self._connection
        if self.state is State.ACTIVE and connection:
            connection.stop_and_settle()

    def _notify(self) -> None:
        """Wake who waits for the board's boot, or for the end of a transition."""
        with self._signal:
            self._signal.notify()

    def _cancel(self) -> None:
        """End an activation that is under way."""
        with self._signal:
            self._canceled = self.state is State.ACTIVATING
            self._signal.notify()

    def _settle(self) -> None:
        """Wait for the end of a transition, or of a fault, that another thread is at."""
        until = self._clock.now() + _SETTLE
        with self._signal:
            while self._unsettled() and self._clock.now() < until:
                self._signal.wait(until)

    def _unsettled(self) -> bool:
        faulting = self._failure is not None and self.state is State.ACTIVE
        return faulting or self._lifecycle.changing

    def _request(self, label: str, wanted: State) -> None:
        if self._transition(label) is not wanted:
            refusal, self._refusal = self._refusal, None
            raise refusal or TransitionRefused(f"{label} failed: the arm is {self.state.value}")

    def _transition(self, label: str) -> State:
        try:
            return self._lifecycle.request(label)
        finally:
            self._notify()

    @property
    def _streamer(self) -> Streamer | None:
        connection = self._connection
        return connection.streamer if connection else None

    def _open_door(self) -> WriteGuard:
        connection = self._connection
        if self.state is not State.ACTIVE or connection is None or connection.door is None:
            raise self._not_active()
        return connection.door

    def _not_active(self) -> NotActive:
        state = "failing" if self.state is State.ACTIVE else self.state.value
        first = {State.INACTIVE: "activate it first", State.FINALIZED: "start armtree again"}
        advice = first.get(self.state, "configure and activate it first")
        why = f"; it failed: {self._failure}" if self._failure else ""
        return NotActive(f"the arm is {state}; {advice}{why}")

    def _configure(self) -> Result:
        self._look_out_no_longer()
        if self._link is None:
            self._refusal = PortNotGiven() if self.robot.has_driver else NoDriver(self.robot.path)
            logger.error("%s", self._refusal)
            return Result.FAILURE
        return Result.SUCCESS

    def _activate(self) -> Result:
        assert self._link
        port = self._link.port
        with self._signal:
            self._failure = None
        logger.info("Starting the arm on port %s: it %s", port, self.robot.open_effect)
        self._connection = connection = self._connect(self._link)
        try:
            self._lookout = ReconnectWatcher(port, self._clock, self._tell)
            connection.open()
            self._boot(connection)
        except Exception as error:  # a driver may raise what it likes
            self._refusal = ours(error)
            if error is self._failure:
                return Result.ERROR
            logger.error("The arm on port %s did not start: %s", port, self._refusal)
            self._close()
            return Result.FAILURE
        logger.info("The arm on port %s is ready to take commands", port)
        return Result.SUCCESS

    def _connect(self, link: Link) -> Connection:
        told = self._tell, lambda: self.state is State.ACTIVE, self.fault, self._notify
        return Connection(self.robot, link, self._clock, *told)

    def _boot(self, connection: Connection) -> None:
        """Wait until the board listens; our firmware says when."""
        until = self._clock.now() + self.robot.serial.boot_wait
        with self._signal:
            while not (self._unwanted or connection.dialogue.holds) and self._clock.now() < until:
                self._signal.wait(until)
        if not self._unwanted:
            connection.start(self._start_pose)
        if unwanted := self._unwanted:
            raise unwanted

    @property
    def _unwanted(self) -> HardwareError | None:
        """What ends this activation, if something does."""
        if self._failure or not self._canceled:
            return self._failure
        return ActivationStopped("the arm was stopped while its board booted")

    def _deactivate(self) -> Result:
        self._look_out_no_longer()
        port = self._link.port if self._link and self._connection else None
        if port:
            logger.info("Stopping the arm on port %s", port)
        self._close()
        if port:
            logger.info("The arm on port %s is stopped", port)
        return Result.SUCCESS

    def _look_out_no_longer(self) -> None:
        if self._lookout:
            self._lookout.end()

    def _give_up(self) -> Result:
        self._close(self._failure)
        return Result.SUCCESS

    def _close(self, error: HardwareError | None = None) -> None:
        if connection := self._connection:
            connection.close(error)
            self._connection = None

    def _changed(self, label: str, start: State, goal: State) -> None:
        if goal is State.INACTIVE:  # a stop from now on is one of the next activation
            with self._signal:
                self._canceled = False
        elif goal is State.FINALIZED:
            self._close(self._failure)  # two Ctrl-C may have kept everybody from it
        self._tell(StateChanged(self._clock.now(), label, start, goal))

    def _tell(self, event: ArmEvent) -> None:
        try:
            self._observe(event)
        except Exception:
            logger.exception("an observer of the arm failed")


@atexit.register
def _shut_down_all() -> None:
    for arm in list(_arms):
        with contextlib.suppress(TransitionRefused):  # somebody is at it already
            arm.shutdown()
