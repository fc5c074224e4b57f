"""The arm: its lifecycle, its link, and what may be sent when."""

import atexit
import contextlib
import logging
import threading
import weakref
from collections.abc import Callable, Mapping
from typing import Self

from .banner import Banner
from .clock import Clock
from .door import Door
from .errors import (
    ActivationStopped,
    HardwareError,
    LinkError,
    NotActive,
    PortNotGiven,
    TransitionRefused,
)
from .events import ArmEvent, BytesReceived, Faulted, Observer, StateChanged
from .interfaces import states
from .lifecycle import Lifecycle, Result, State
from .link import Link
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
        self._door: Door | None = None
        self._streamer: Streamer | None = None
        self._listener: threading.Thread | None = None
        self._banner = Banner(robot.firmware, robot.wire_format)
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
            self.stop()
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
            self.stop()
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
        """Number of the newest motion; its end, and every stop, counts it up.

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
        ends the activation.
        """
        self._cancel()
        streamer = self._streamer
        if self.state is State.ACTIVE and streamer:
            try:
                streamer.stop()
            except LinkError as error:
                self.fault(error)

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

    @property
    def _playing(self) -> bool:
        streamer = self._streamer
        return streamer is not None and streamer.playing

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
        if self._transition(label) is not wanted:
            refusal, self._refusal = self._refusal, None
            raise refusal or TransitionRefused(f"{label} failed: the arm is {self.state.value}")

    def _transition(self, label: str) -> State:
        try:
            return self._lifecycle.request(label)
        finally:
            with self._signal:
                self._signal.notify()

    def _open_door(self) -> Door:
        door = self._door
        if self.state is not State.ACTIVE or door is None:
            raise self._not_active()
        return door

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
            self._banner = Banner(self.robot.firmware, self.robot.wire_format)
        does = "stays where it is" if self.robot.firmware.banner else "moves to its boot pose"
        logger.info("Starting the arm on port %s: it %s", self._link.port, does)
        try:
            self._link.open()
        except LinkError as error:
            logger.error("The port %s did not open: %s", self._link.port, error)
            self._refusal = error
            return Result.FAILURE
        self._listener = self._clock.spawn(self._listen, "listener")
        return self._boot(self._link)

    def _boot(self, link: Link) -> Result:
        """Wait until the board listens, and take its boot pose as the commanded one."""
        until = self._clock.now() + self.robot.serial.boot_wait
        with self._signal:
            while self._booting() and self._clock.now() < until:
                self._signal.wait(until)
        if self._failure:
            self._refusal = self._failure
            return Result.ERROR
        if self._canceled:
            self._refusal = ActivationStopped("the arm was stopped while its board booted")
            self._close()
            return Result.FAILURE
        pose = self._boot_pose(link)
        self._door = Door(self.robot, link, self._clock, self._is_active, self._tell, pose)
        period = 1 / self.robot.firmware.rate
        self._streamer = Streamer(self._door, self._clock, period, self.fault)
        logger.info("The arm on port %s is ready to take commands", link.port)
        return Result.SUCCESS

    def _booting(self) -> bool:
        """Whether there is still something to wait for; a banner tells the end of the boot."""
        return not (self._canceled or self._failure or self._banner.frame)

    def _boot_pose(self, link: Link) -> tuple[float, ...]:
        """Where the arm stands now [rad]: what the board says, else where a reset puts it."""
        codec, pose, frame = self.robot.wire_format, self.robot.boot_pose, self._banner.frame
        if frame is None:
            if self.robot.firmware.banner:
                what = "The board on port %s did not say where it stands; taking its boot pose"
                logger.warning(what, link.port)
            return pose
        return pose if frame == codec.encode(pose) else codec.decode(frame)

    def _is_active(self) -> bool:
        return self.state is State.ACTIVE

    def _deactivate(self) -> Result:
        port = self._link.port if self._link and self._streamer else None
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
        """Close the port and wait for the threads that used it."""
        streamer, listener = self._streamer, self._listener
        self._streamer = self._door = self._listener = None
        if streamer:
            streamer.close(error)
            streamer.join()
        self._close_link()
        if listener and listener is not threading.current_thread():
            listener.join()

    def _close_link(self) -> None:
        if self._link:
            try:
                self._link.close()
            except LinkError as error:
                logger.error("Closing the port %s failed: %s", self._link.port, error)

    def _listen(self) -> None:
        """Read what the board says until the link is closed or lost."""
        assert self._link
        try:
            while data := self._link.read():
                with self._signal:
                    self._banner.hear(data)
                    self._signal.notify()
                self._tell(BytesReceived(self._clock.now(), data))
        except LinkError as error:
            self.fault(error)

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
