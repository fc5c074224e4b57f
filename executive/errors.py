"""Errors of goals, of a server, and of its clients.

The roots are GoalError, ServerError, RequestError (a server refuses a request before it reads the
goal) and ClientError. Every error has a stable `code`, and its message says what to do next.
"""

from pathlib import Path

from hardware import ArmtreeError, HardwareError, WriteRefused
from logs import goal_title
from trees import FileError

from .api.codes import LOST
from .api.outcome import Cause, Outcome

_LONGEST = 300  # most characters of the message of a refusal, because it may quote the client


class GoalError(ArmtreeError):
    """The goal is invalid. Root of the errors of goals."""

    code = "goal.error"
    exit_status = 4
    hint = "send another goal"


class SentBeforeStop(GoalError):
    """The arm was stopped after the last status that the sender had."""

    code = "goal.sent_before_stop"
    hint = "send it again if it is still needed"

    def __init__(self) -> None:
        super().__init__("the arm was stopped after the last status that the sender had")


class UnknownGoal(GoalError):
    """No known goal has that identity. Results are kept for a limited time."""

    code = "goal.unknown"
    http_status = 404
    hint = "request the result sooner"

    def __init__(self, identity: str) -> None:
        super().__init__(f"no goal {identity} is known; results are kept only for a limited time")


class GoalCanceled(GoalError):
    """The goal was canceled."""

    code = "goal.canceled"
    exit_status = 7
    hint = "start the goal again if it is still needed"

    def __init__(self) -> None:
        super().__init__("Canceled")


class GoalBusy(GoalError):
    """Another goal is under way."""

    code = "goal.busy"
    hint = "wait, or cancel that goal: `armtree cancel GOAL`, or `armtree stop`"


class QueueFull(GoalError):
    """The queue of goals is full."""

    code = "goal.queue_full"
    http_status = 429
    hint = "wait until a goal ends, or cancel goals"


class DuplicateGoal(GoalError):
    """Another goal has that identity."""

    code = "goal.duplicate"
    hint = "give every goal its own identity"

    def __init__(self, identity: str) -> None:
        super().__init__(f"the goal {identity} exists already; {self.hint}")


class BadIdentity(GoalError):
    """The identity of a goal is not 32 lower-case hexadecimal digits."""

    code = "goal.bad_id"
    http_status = 422
    hint = "leave the identity out; the server then chooses one"

    def __init__(self, identity: str) -> None:
        super().__init__(f"{identity!r} is not the identity of a goal: give 32 hexadecimal digits")


class ResultTimeout(GoalError, TimeoutError):
    """The goal has not ended yet."""

    code = "goal.result_timeout"
    exit_status = 8
    hint = "request the result again"

    def __init__(self, identity: str, timeout: float) -> None:
        super().__init__(
            f"goal {identity} has not ended within {timeout:g} s; request its result again"
        )


class NotEnded(GoalError, TimeoutError):
    """A command that `armtree stop` stopped did not end in time."""

    code = "goal.not_ended"
    exit_status = 8
    hint = "check the arm, and switch off its power if it moves"

    def __init__(self, command: str) -> None:
        super().__init__(f"{command} was asked to stop, but has not ended; {self.hint}")


class NotExecuting(GoalError):
    """Only an executing goal can be paused or resumed."""

    code = "goal.not_executing"
    hint = "`armtree status` shows the goal that is executing"

    def __init__(self, identity: str = "", state: str = "") -> None:
        words = f"goal {identity} is {state}; only an EXECUTING goal can be paused or resumed"
        super().__init__(words if identity else "no goal is under way")


class GoalUnderWay(GoalError):
    """A dry run is not possible while a goal is under way."""

    code = "goal.under_way"
    hint = "wait for the end of the goal"

    def __init__(self, identity: str) -> None:
        super().__init__(f"goal {identity} is under way, so the start of a dry run is unknown")


class NotPaused(GoalError):
    """Only a paused goal can be resumed."""

    code = "goal.not_paused"
    hint = "pause the goal first"

    def __init__(self, identity: str) -> None:
        super().__init__(f"goal {identity} is not paused; pause the goal first")


class TooManyBreakpoints(GoalError):
    """The limit of breakpoints is reached."""

    code = "goal.too_many_breakpoints"
    hint = "`armtree break NODE --off` removes a breakpoint"

    def __init__(self, most: int) -> None:
        super().__init__(f"there are {most} breakpoints already; remove one first")


class NoSuchNode(GoalError):
    """No task has a node with that path."""

    code = "goal.no_such_node"
    http_status = 404
    hint = "`armtree run N --json` prints the paths of nodes"


class GoalPreempted(GoalError):
    """Another goal replaced the goal, because the policy is `preempt`."""

    code = "goal.preempted"
    hint = "send the goal again if you still want it"

    def __init__(self, identity: str) -> None:
        super().__init__(
            f"goal {identity} replaced this goal; send this goal again if you still want it"
        )


class ExecutorBlocked(GoalError):
    """The code of a skill does not return, so no other goal can be executed.

    Args:
        identity: Identity of the goal.
        task: Number of its task.
        node: Path of the blocked node; empty if unknown.
    """

    code = "server.held"
    exit_status = 13
    hint = "fix the skill that the message names, then start the server again"

    def __init__(self, identity: str, task: int, node: str) -> None:
        super().__init__(
            f"goal {identity} for {goal_title(task)} blocks all other goals, because the code of "
            f"{node or 'a skill'} does not return; start the server again"
        )


class ServerRestarted(GoalError):
    """The server or command that ran the goal ended before the goal."""

    code = "server.restarted"
    exit_status = 13
    hint = "check the position of the arm, then send the goal again"

    def __init__(self) -> None:
        super().__init__(
            "the server or command that ran this goal ended before the goal; nothing resumes it"
        )


class ServerClosing(GoalError):
    """The server is ending."""

    code = "server.closing"
    exit_status = 13
    hint = "start the server again"


class UnknownQuestion(GoalError):
    """No open question has that identity."""

    code = "goal.unknown_question"
    http_status = 404
    hint = "`armtree answer` lists the open questions"

    def __init__(self, identity: str) -> None:
        super().__init__(f"question {identity} is unknown or already answered")


class BadAnswer(GoalError):
    """An answer is not one of the choices."""

    code = "goal.bad_answer"
    http_status = 422
    hint = "give one of the choices"

    def __init__(self, words: str, question: str) -> None:
        super().__init__(f"{words.strip() or 'an empty text'} is not an answer to: {question}")


class NotHeld(GoalError):
    """The goal needs a hold, but no client holds it."""

    code = "goal.not_held"
    hint = "hold the goal, then send it"

    def __init__(self, identity: str) -> None:
        super().__init__(f"no client holds goal {identity}; hold the goal, then send it")


class ServerError(ArmtreeError):
    """The server cannot start with these options."""

    code = "server.options"
    exit_status = 13
    hint = "correct the option that the message names; see `armtree serve --help`"


class AddressInUse(ServerError):
    """Another program listens at that address."""

    code = "server.address_in_use"
    hint = "end that program, or choose another port"


class RequestError(ArmtreeError):
    """The server rejected a request. Root of the errors of requests.

    Args:
        message: The mistake in words.
        hint: Advice for the user. Default: the hint of the class.
        status: HTTP status of the answer. Default: the status of the class.
    """

    code = "request"
    exit_status = 13
    http_status = 400
    hint = "`/openapi.json` describes all requests"

    def __init__(self, message: str, hint: str = "", status: int | None = None) -> None:
        cut = message if len(message) <= _LONGEST else f"{message[:_LONGEST]} …"
        super().__init__(cut)
        self.hint = hint or self.hint
        self.http_status = status or self.http_status


class BadRequest(RequestError):
    """A request is malformed."""

    code = "request.malformed"


class NotFound(RequestError):
    """The address does not exist."""

    code = "request.not_found"
    http_status = 404


class BadMethod(RequestError):
    """The address does not have the HTTP method of the request."""

    code = "request.method"
    http_status = 405


class Forbidden(RequestError):
    """The request comes from another site, or it names another server."""

    code = "request.forbidden"
    http_status = 403
    hint = "send the request from a program on the server's machine, with the server's token"


class WrongHost(Forbidden):
    """The Host header is not a name of this server."""

    code = "request.host"
    hint = "use the address of the server, or `armtree serve --host NAME`"


class WrongOrigin(Forbidden):
    """A page of another site sent the request."""

    code = "request.origin"
    hint = "`armtree serve --origin URL` allows the page"


class Unauthorized(RequestError):
    """The token is missing or wrong."""

    code = "request.token"
    http_status = 401
    hint = "use the token that the server printed at its start"


class WrongCode(RequestError):
    """The code of a link to the page is unknown or already used."""

    code = "request.code"
    http_status = 401
    hint = "`armtree view` opens the page with a new link"


class TooMuch(RequestError):
    """Too many requests or clients."""

    code = "request.too_many"
    http_status = 429
    hint = "wait a moment"


class TooLarge(TooMuch):
    """The body of a request is too large."""

    code = "request.too_large"
    http_status = 413
    hint = "send a smaller body"


class TooSlow(TooMuch):
    """The body of a request arrived too slowly."""

    code = "request.timeout"
    http_status = 408
    hint = "send the whole body at once"


class PoseUnconfirmed(HardwareError):
    """The position of the arm is unknown, and no person has confirmed it.

    Args:
        message: The cause.
        hint: Advice for the user. Default: the hint of the class.
    """

    code = "hw.pose_unconfirmed"
    hint = "give --pose last, or --pose boot"

    def __init__(self, message: str, hint: str = hint) -> None:
        super().__init__(message)
        self.hint = hint  # the message names no option; the command line adds the hint


class RecordingBehind(WriteRefused):
    """The recording was too slow, so the motion ended. The arm stays active.

    Args:
        port: Name of the port.
        most: Longest time that a frame waits for the recording of the previous frame [s].
        cause: The likely cause, with advice.
    """

    code = "log.behind"
    exit_status = 10
    hint = "end other programs, or record to a faster disk"

    def __init__(self, port: str, most: float, cause: str) -> None:
        super().__init__(
            f"The last frame was not recorded within {most:g} s (--recording-timeout), so nothing "
            f"more was sent to {port}. The likely cause: {cause}"
        )


class BadWorldFile(FileError):
    """A file of obstacles is wrong."""

    code = "file.world"
    hint = "correct the file, then run again"


class UsageError(ArmtreeError):
    """The command line is wrong."""

    code = "usage"
    exit_status = 2
    hint = "see `armtree COMMAND --help`"


class FileUnusable(ArmtreeError):
    """A file cannot be read or written, or its content is wrong."""

    code = "file"
    exit_status = 3
    hint = "check the path, its permissions, and the free space on its disk"


class BadConfiguration(FileUnusable):
    """A file of settings is wrong."""

    code = "file.settings"
    hint = "correct it at the line that the message names; `armtree config` lists the settings"


class ReplayDiffers(ArmtreeError):
    """A replay differs from its recording."""

    code = "replay.differs"
    exit_status = 12
    hint = "see the first difference in the message"


class ClientError(ArmtreeError):
    """The server failed. Root of the errors of a client."""

    code = "server.error"
    exit_status = 13
    hint = "see the log of the server"


class ServerUnreachable(ClientError, ConnectionError):
    """No server answers."""

    code = LOST
    hint = "`armtree serve` starts a server; --server URL or ARMTREE_SERVER names another one"

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"no server answers at {url}: {why.rstrip('.')}. Start one with armtree serve, or "
            "set its URL with --server URL or ARMTREE_SERVER"
        )


class ServerSilent(ServerUnreachable):
    """A server accepts connections, but it does not answer in time.

    Args:
        url: URL of the server.
        seconds: Time without an answer [s].
        reads: True if the request only reads.
        began: True if an answer began, but did not end.
    """

    def __init__(self, url: str, seconds: float, reads: bool, began: bool = False) -> None:
        self.hint = "check the arm, and switch off its power if it moves"
        what = "its answer takes more than" if began else "nothing came for"
        why = f"the server at {url} does not answer: {what} {seconds:g} s"
        later = "" if reads else ". It may execute the request later"
        Exception.__init__(self, f"{why}{later}; {self.hint}")


class NothingToStop(ServerUnreachable):
    """No command and no server of this user was found, and no server answers at the set port.

    Args:
        folder: The runtime folder that was searched. `XDG_RUNTIME_DIR` changes it.
    """

    def __init__(self, folder: Path) -> None:
        self.hint = "stop an arm elsewhere with --server URL, and a Python program with Ctrl-C"
        found = f"no armtree command and no server of yours was found in {folder}"
        Exception.__init__(self, f"nothing was stopped: {found}; {self.hint}")


class ServerLost(ServerUnreachable):
    """The server that moved the arm does not answer any more."""

    def __init__(self) -> None:
        self.hint = "check the arm, start the server again, then type: armtree where"
        why = "the server does not answer any more, so the pose of the arm is unknown"
        Exception.__init__(self, why)


class WrongAnswer(ClientError):
    """Another program, or another version of armtree, answers.

    Args:
        url: URL of the request.
        why: The mistake in the answer, in words.
    """

    code = "server.wrong_answer"
    hint = "check the URL: --server or ARMTREE_SERVER"

    def __init__(self, url: str, why: str) -> None:
        super().__init__(
            f"{url} is not a server of this version of armtree: {why}. Check --server URL or "
            "ARMTREE_SERVER"
        )


class Refused(ClientError):
    """The server refuses a request.

    Args:
        cause: The cause of the refusal.

    Attributes:
        code: Stable name of the cause.
        node: Path of the node that it concerns; empty if it concerns no node.
        joint: Name of the joint that it concerns; empty if it concerns no joint.
        value: The wrong value [rad], [m] or [s].
        limit: Limit of the value, in the same unit.
        hint: Advice for the user.
        cause: All of these as one value, as in an outcome.
    """

    def __init__(self, cause: Cause) -> None:
        self.cause, self.code, self.hint = cause, cause.code, cause.hint
        self.node, self.joint = cause.node, cause.joint
        self.value, self.limit = cause.value, cause.limit
        adds = cause.hint and cause.code.startswith("request.")  # other messages contain the hint
        super().__init__(f"{cause.message}; {cause.hint}" if adds else cause.message)


class GoalFailed(ClientError):
    """A goal was canceled or aborted.

    Args:
        outcome: Outcome of the goal.

    Attributes:
        outcome: Outcome of the goal.
        cause: The cause of the failure.
    """

    def __init__(self, outcome: Outcome) -> None:
        self.code, self.outcome = outcome.code, outcome
        self.cause = outcome.cause or Cause(outcome.code, outcome.message)
        self.hint = self.cause.hint
        super().__init__(f"{goal_title(outcome.task)} {outcome.state.name}: {outcome.message}")
