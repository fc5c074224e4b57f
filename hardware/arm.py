"""The arm: its lifecycle, its link, and what may be sent when."""

import atexit
import contextlib
import logging
import weakref
from collections.abc import Callable, Mapping
from typing import Self

from .clock import Clock
from .connection import Connection
from .door import Door
from .errors import (
    ActivationStopped,
    BoardSilent,
    HardwareError,
    LinkError,
    NotActive,
    PortLost,
    PortNotGiven,
    TransitionRefused,
)
from .events import ArmEvent, Faulted, Observer, StateChanged
from .interfaces import states
from .lifecycle import Lifecycle, Result, State
from .link import Link
from .lookout import Lookout
from .robot import Robot
from .schedule import Schedule
from .streamer import Playback, Streamer

logger = logging.getLogger(__name__)

# Who shuts down waits this long for a transition of another thread; closing a port takes less.
_SETTLE = 1.0  # [s]


def _nobody(event: ArmEvent) -> None:
    """Watches nothing."""


class Arm:
    """A robot arm on a serial line, open loop: its state is what it was last commanded.

    Used as a context, it is shut down at the end; an interpreter that exits closes the port too.

    Args:
        robot: The robot.
        link: The line to its board; None where nobody said which port.
        clock: Whose time.
        observe: Told of every frame, byte, transition and fault, from any thread. It must be
            quick; what it raises is logged and keeps the arm from nothing.
    """

    def __init__(
        self, robot: Robot, link: Link | None, clock: Clock, observe: Observer = _nobody
    ) -> None:
        self.robot = robot
        self._link, self._clock, self._observe = link, clock, observe
        self._signal = clock.signal()
        self._canceled = False
        self._refusal: HardwareError | None = None  # why the last request was not carried out
        self._failure: HardwareError | None = None  # the fault that ends this activation
        self._connection: Connection | None = None
        self._lookout: Lookout | None = None
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
        atexit.register(_close_at_exit, weakref.ref(self))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.shutdown()

    @property
    def state(self) -> State:
        """Where the lifecycle stands."""
        return self._lifecycle.state

    @property
    def commanded(self) -> tuple[float, ...]:
        """Where the arm was last commanded to, one value per actuated joint [rad].

        Raises:
            NotActive: Where an arm stands is only known once it was activated.
        """
        return self._open_door().commanded

    def configure(self) -> None:
        """Check that all that is needed is there; never touches the port.

        Raises:
            PortNotGiven: No port was named; the arm stays unconfigured.
            TransitionRefused: Not legal now.
        """
        self._request("configure", State.INACTIVE)

    def activate(self) -> None:
        """Open the port, which resets the board and moves the arm, and wait until it has booted.

        Raises:
            LinkError: The port cannot be had, and the arm stays inactive; or it was lost while the
                board booted, and the arm is unconfigured.
            ActivationStopped: Somebody called `stop` while the board booted.
            TransitionRefused: Not legal now.
        """
        self._request("activate", State.ACTIVE)
        self._greet()
        if self._failure:  # in the very moment of becoming active, when it could not be raised
            with contextlib.suppress(TransitionRefused):
                self._transition("raise_error")
            raise self._failure

    def deactivate(self) -> None:
        """Stop, and close the port; the servos keep holding.

        Raises:
            TransitionRefused: Not legal now.
        """
        if self._playing:
            self._hold()
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
        if self.state is State.FINALIZED:
            return
        if self._playing:
            self._hold()
        self._cancel()
        self._settle()
        self._request("shutdown", State.FINALIZED)

    def read(self) -> Mapping[str, float]:
        """The state interfaces, such as `joint_1/position`, and their values [rad].

        Open loop: they are what was commanded, and joints that follow others do so exactly.

        Raises:
            NotActive: Where an arm stands is only known once it was activated.
        """
        return states(self.robot, self.commanded)

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
            changed: Called from another thread after every frame and at the end.
            owner: Whose motion it is, for whoever is refused meanwhile.
            generation: The arm's, when the motion was decided on.

        Raises:
            NotActive: The arm is not active.
            InterfaceClaimed: Another motion is being played; stop it first.
            StaleGeneration: There was a stop, or another motion, since then.
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
        self._hold(self.robot.brake)

    def fault(self, error: HardwareError) -> None:
        """Take the arm out of *active*, for this error; coming back is a person's act.

        The first fault of an activation counts; those that follow from it are not told again.
        """
        with self._signal:
            if self._failure:
                return
            self._failure = error
            self._signal.notify()
        if streamer := self._streamer:
            streamer.close(error)
        logger.error("%s", error)
        self._tell(Faulted(self._clock.now(), error))
        try:
            self._transition("raise_error")
        except TransitionRefused as refusal:
            logger.debug("fault outside active: %s", refusal)
        if self._lookout and isinstance(error, PortLost):
            self._lookout.begin()

    def _hold(self, brake: float = 0.0) -> None:
        streamer = self._streamer
        if self.state is State.ACTIVE and streamer:
            try:
                streamer.stop(brake)
            except LinkError as error:
                self.fault(error)

    @property
    def _playing(self) -> bool:
        streamer = self._streamer
        return streamer is not None and streamer.playing

    def _notify(self) -> None:
        """Wake who waits for the board's boot, or for the end of a transition."""
        with self._signal:
            self._signal.notify()

    def _cancel(self) -> None:
        """End the wait for the board's boot."""
        with self._signal:
            self._canceled = True
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
        if self._lookout:
            self._lookout.end()
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

    def _open_door(self) -> Door:
        connection = self._connection
        if self.state is not State.ACTIVE or connection is None or connection.door is None:
            raise self._not_active()
        return connection.door

    def _not_active(self) -> NotActive:
        return NotActive(f"the arm is {self.state.value}; configure and activate it first")

    def _configure(self) -> Result:
        if self._link is None:
            self._refusal = PortNotGiven()
            logger.error("%s", self._refusal)
            return Result.FAILURE
        return Result.SUCCESS

    def _activate(self) -> Result:
        assert self._link
        with self._signal:
            self._canceled, self._failure = False, None
        does = "stays where it is" if self.robot.firmware.banner else "moves to its boot pose"
        logger.info("Starting the arm on port %s: it %s", self._link.port, does)
        connection = Connection(
            self.robot,
            self._link,
            self._clock,
            self._tell,
            self._is_active,
            self.fault,
            self._notify,
        )
        try:
            connection.open()
        except LinkError as error:
            logger.error("The port %s did not open: %s", self._link.port, error)
            self._refusal = error
            return Result.FAILURE
        self._connection = connection
        self._lookout = Lookout(self._link.port, self._clock)
        result = self._boot(connection)
        if result is Result.SUCCESS:
            logger.info("The arm on port %s is ready to take commands", self._link.port)
        if result is Result.FAILURE:
            self._close()
        return result

    def _boot(self, connection: Connection) -> Result:
        """Wait until the board listens; our firmware says when."""
        until = self._clock.now() + self.robot.serial.boot_wait
        with self._signal:
            while not (self._canceled or self._failure or connection.dialogue.holds):
                if self._clock.now() >= until:
                    break
                self._signal.wait(until)
        if self._failure:
            self._refusal = self._failure
            return Result.ERROR
        if self._canceled:
            self._refusal = ActivationStopped("the arm was stopped while its board booted")
            return Result.FAILURE
        try:
            connection.start()
        except BoardSilent as error:
            logger.error("%s", error)
            self._refusal = error
            return Result.FAILURE
        return Result.SUCCESS

    def _greet(self) -> None:
        connection = self._connection
        try:
            if connection and connection.door:
                connection.door.greet()
        except NotActive:
            return  # a fault came first
        except LinkError as error:
            self.fault(error)

    def _is_active(self) -> bool:
        return self.state is State.ACTIVE

    def _deactivate(self) -> Result:
        port = self._link.port if self._link and self._connection else None
        if port:
            logger.info("Stopping the arm on port %s", port)
        self._close()
        if port:
            logger.info("The arm on port %s is stopped", port)
        return Result.SUCCESS

    def _give_up(self) -> Result:
        self._close(self._failure)
        return Result.SUCCESS

    def _close(self, error: HardwareError | None = None) -> None:
        connection, self._connection = self._connection, None
        if connection:
            connection.close(error)

    def _changed(self, label: str, start: State, goal: State) -> None:
        self._tell(StateChanged(self._clock.now(), label, start, goal))

    def _tell(self, event: ArmEvent) -> None:
        try:
            self._observe(event)
        except Exception:
            logger.exception("an observer of the arm failed")


def _close_at_exit(reference: "weakref.ref[Arm]") -> None:
    arm = reference()
    if arm is not None:
        with contextlib.suppress(TransitionRefused):  # somebody is at it already
            arm.shutdown()
