"""The client for ordinary programs."""

import json
import threading
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, TypeVar

from executive.goals.events import Status, event_from_json
from executive.goals.outcome import CancelResult, GoalStatus, Outcome
from executive.server.token_file import KEEPALIVE

from . import requests
from .errors import GoalFailed, Refused, ServerUnreachable
from .replies import check, reached
from .requests import OpenQuestion, Request, Task

if TYPE_CHECKING:
    from executive.goals.events import Event

T = TypeVar("T")

BEAT_PERIOD = 0.2  # [s] between two signs of life of who holds a goal
SILENCE_TIMEOUT = 45.0  # [s] of a stream, of which a server breaks every 15
ANSWER_TIMEOUT = 10.0  # [s] for an answer that needs no waiting
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Client:
    """A server, as a program sees it. Use it as a context; any thread may call.

    Args:
        url: Where it is; without one ARMTREE_SERVER, else this machine's.
        token: For whatever changes state; without one ARMTREE_TOKEN, else what the server wrote
            for this user.

    Every method raises ServerUnreachable where nobody answers, and Refused where the server says
    no.
    """

    def __init__(self, url: str | None = None, token: str | None = None) -> None:
        import httpx  # takes longer than all the rest, and `--help` needs none of it

        address = requests.address(url, token)
        self.url = address.url
        self._http = httpx.Client(
            base_url=address.url,
            headers=address.headers,
            timeout=ANSWER_TIMEOUT,
            transport=httpx.HTTPTransport(trust_env=False, socket_options=KEEPALIVE),
            trust_env=False,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Close its connections; goals go on."""
        self._http.close()

    def run(self, task: int, deadman: bool = False, **arguments: Any) -> Outcome:
        """Run a task and wait until it is done.

        Args:
            task: Its number.
            deadman: Whether to cancel it if this program dies or stops answering.
            arguments: Values of its parameters, by name.

        Raises:
            GoalFailed: It was not done; `outcome` says why.
        """
        if deadman:
            goal_id = uuid.uuid4().hex
            with self.hold(goal_id):
                self.send(task, arguments, goal_id, deadman=True)
                outcome = self.result(goal_id)
        else:
            outcome = self.result(self.send(task, arguments))
        if not outcome.success:
            raise GoalFailed(outcome)
        return outcome

    def send(
        self,
        task: int,
        arguments: Mapping[str, Any] = NOTHING,
        goal_id: str = "",
        deadman: bool = False,
    ) -> str:
        """Send a goal, and return its identity at once.

        Args:
            task: Number of the task.
            arguments: Values of its parameters, by name.
            goal_id: 32 hexadecimal digits; made by the server where there are none.
            deadman: Whether it shall be canceled when nobody holds it any more; see `hold`.
        """
        return self._do(requests.send(task, arguments, goal_id, deadman))

    def result(self, goal_id: str, timeout: float | None = None) -> Outcome:
        """Wait for the outcome of a goal [s]; None to wait as long as it takes."""
        for seconds in requests.waits(timeout):
            try:
                return self._do(requests.result(goal_id, seconds))
            except Refused as error:
                if error.code != requests.NOT_YET:
                    raise
        raise requests.not_ended(goal_id, timeout)

    def goal(self, goal_id: str) -> GoalStatus:
        """What a goal is at."""
        return self._do(requests.goal(goal_id))

    def goals(self) -> tuple[GoalStatus, ...]:
        """All goals that are known; ended ones are forgotten after a while."""
        found: tuple[GoalStatus, ...] = ()
        while page := self._do(requests.goals(found)):
            found = page + found
        return found

    def cancel(self, goal_id: str = "", stamp_ns: int = 0) -> CancelResult:
        """Cancel a goal, those accepted until a time [ns since 1970], both, or all."""
        return self._do(requests.cancel(goal_id, stamp_ns))

    def stop(self) -> CancelResult:
        """Stop the arm, and cancel all goals. This is no emergency stop."""
        return self._do(requests.stop())

    def pause(self, goal_id: str) -> GoalStatus:
        """Stop the arm and keep the goal."""
        return self._do(requests.change(goal_id, "pause"))

    def resume(self, goal_id: str) -> GoalStatus:
        """Go on with a paused goal."""
        return self._do(requests.change(goal_id, "resume"))

    def step(self, goal_id: str) -> GoalStatus:
        """Let one node of a paused goal begin."""
        return self._do(requests.change(goal_id, "step"))

    def break_at(self, node: str, on: bool = True) -> tuple[str, ...]:
        """Have every goal pause before a node, by its path, or no longer; returns all such."""
        return self._do(requests.break_at(node, on))

    def questions(self) -> tuple[OpenQuestion, ...]:
        """What tasks ask now."""
        return self._do(requests.questions())

    def answer(self, question_id: str, words: str) -> str:
        """Answer a question; returns the answer that counts, which is the first."""
        return self._do(requests.answer(question_id, words))

    def arm(self, transition: str, pose: str | None = None) -> str:
        """Take the arm through configure, activate, deactivate, cleanup or shutdown.

        Activating opens the port, which resets the board and moves the arm. Where it is not reset,
        `pose` says where the arm stands: `boot`, or `last` for where it was commanded to last.

        Returns:
            Where it stands then.
        """
        return self._do(requests.arm(transition, pose))

    def status(self) -> Status:
        """What the arm and the goals are at."""
        return self._do(requests.status())

    def tasks(self) -> tuple[Task, ...]:
        """The tasks there are."""
        return self._do(requests.tasks())

    @contextmanager
    def events(self, *kinds: str) -> Iterator[Iterator["Event"]]:
        """Watch what happens; first comes what still holds of the goal under way.

        Args:
            kinds: Only these, such as `goal`, `node`, `status`; all where none is named.
        """
        query = {"events": ",".join(kinds)} if kinds else {}
        with (
            reached(self.url),
            self._http.stream(
                "GET", "/api/events", params=query, timeout=SILENCE_TIMEOUT
            ) as response,
        ):
            if response.is_error:
                response.read()
            check(response)
            lines = response.iter_lines()
            next(lines, None)  # says that we watch
            yield self._read(lines)

    @contextmanager
    def hold(self, goal_id: str) -> Iterator[None]:
        """Hold a goal that is sent within a second: it is canceled when this context ends.

        So it is when this program dies, or the machine it runs on cannot be reached for a second.
        """
        released = threading.Event()

        def beats() -> Iterator[bytes]:
            while not released.wait(BEAT_PERIOD):
                yield b"."

        def hold() -> None:
            with suppress(ServerUnreachable), reached(self.url):
                self._http.post(f"/api/goals/{goal_id}/hold", content=beats())

        holding = threading.Thread(target=hold, name="hold", daemon=True)
        holding.start()
        try:
            yield
        finally:
            released.set()
            holding.join()

    def _read(self, lines: Iterator[str]) -> Iterator["Event"]:
        with reached(self.url, SILENCE_TIMEOUT):
            for line in lines:
                if line.startswith("data: "):
                    yield event_from_json(json.loads(line.removeprefix("data: ")))

    def _do(self, ask: Request[T]) -> T:
        with reached(self.url):
            response = self._http.request(
                ask.method,
                ask.path,
                json=ask.body,
                params=ask.query,
                timeout=ANSWER_TIMEOUT + ask.patience,
            )
        check(response)
        return ask.read(response.json())
