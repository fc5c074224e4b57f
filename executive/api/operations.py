"""Every operation of the HTTP interface, one row each.

These rows define the routes, the checks of a request, the OpenAPI document and the requests of the
clients. The method of `Endpoints` with the name of a row answers the requests of the row.
"""

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from functools import partial
from typing import Any

from hardware import TRANSITIONS
from hardware.loading.dataclass import dataclass

from . import schemas as s
from .events import KINDS
from .schemas import Component, Schema


class Access(Enum):
    """Access to an operation."""

    READ = "any program on this machine; from other machines only with the token"
    CHANGE = "only with the token"
    SIGN_IN = "clients with the code of a link; they need no token"
    STOP = "every program, without a token and without a rate limit"


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation.

    Attributes:
        method: HTTP method.
        access: Callers of the operation.
        path: Path of its URL, with path parameters in braces.
        name: Name of the method that answers, and `operationId` of the OpenAPI document.
        summary: One sentence for the documentation.
        answer: Schema of the answer; None if the answer is not JSON.
        parameters: Schema of every path and query parameter, by name.
        body: Schema of the JSON body; None if a body is ignored.
        errors: Codes or families of errors in its answers, besides `request.*`.
        status: HTTP status of a successful answer.
        media: Media type of a successful answer.
        streams: True if its request or its answer lasts as long as the client stays.
        names_client: True if its method also receives the client: the User-Agent of the request.
    """

    method: str
    access: Access
    path: str
    name: str
    summary: str
    answer: Component | None = None
    parameters: Mapping[str, Schema] = field(default_factory=dict)
    body: Schema | None = None
    errors: tuple[str, ...] = ()
    status: int = 200
    media: str = "application/json"
    streams: bool = False
    names_client: bool = False

    @property
    def stops(self) -> bool:
        """True if every program may call the operation, because it stops the arm."""
        return self.access is Access.STOP

    @property
    def ignores_input(self) -> bool:
        """True if parameters and body are ignored."""
        return self.stops and self.body is None

    def in_path(self, parameter: str) -> bool:
        """True for a parameter in the path, False for one in the query."""
        return f"{{{parameter}}}" in self.path

    def split(
        self, arguments: Mapping[str, Any]
    ) -> tuple[str, dict[str, Any], dict[str, Any] | None]:
        """Divide arguments into path, query and body. Arguments that are None are left out.

        Returns:
            The path, the query, and the JSON body, or None if the operation takes no body.
        """
        given = {name: value for name, value in arguments.items() if value is not None}
        in_address = {name: given.pop(name) for name in self.parameters if name in given}
        query = {name: value for name, value in in_address.items() if not self.in_path(name)}
        return self.path.format(**in_address), query, None if self.body is None else given


_read = partial(Operation, "GET", Access.READ)
_change = partial(Operation, "POST", Access.CHANGE)
_stop = partial(Operation, "POST", Access.STOP)

_GOAL = {"goal_id": s.GOAL_ID}
_TIMEOUT = s.described(s.number(0, 3600), "Longest time to wait [s].")
_LIMIT = s.described(s.integer(1, s.MAX_LISTED), f"Number of goals; default {s.MAX_LISTED}.")
_KIND = "|".join(sorted(KINDS))
_KINDS = s.described(
    s.text(
        f"^({_KIND})(,({_KIND}))*$",
        200,
        f"a list of {_KIND.replace('|', ', ')}, separated by commas",
    ),
    "Kinds of events to send, such as `goal,status`; default all.",
)
_TRANSITION = s.choice(TRANSITIONS)
_PAUSE_ERRORS = ("goal.unknown", "goal.not_executing")
_RESUME_ERRORS = (*_PAUSE_ERRORS, "goal.not_paused")

_ACCEPTED = s.answer("Accepted", goal_id=s.GOAL_ID, stamp_ns=s.COUNT)
_STOPS = s.described(
    s.COUNT,
    "`stops` of the newest status; the goal or activation is refused if the arm was stopped after "
    "this status.",
)
_NEW_GOAL = {
    "goal_id": s.described(s.GOAL_ID, "Id of the new goal; default a random one."),
    "deadman": s.described(
        s.BOOLEAN, "True to cancel the goal when its hold ends; hold the goal before you send it."
    ),
    "stops": _STOPS,
}

_change_goal = partial(_change, answer=s.GOAL, parameters=_GOAL, body=s.EMPTY)

_RECORDING = {"name": s.RECORDING_NAME}
_TASK = s.described(s.integer(-1, 2**31 - 1), "Task number; -1 for moves.")


def _read_recording(
    path: str, name: str, summary: str, answer: Component, **parameters: Schema
) -> Operation:
    path = f"/api/recordings/{{name}}{path}"
    known = {**_RECORDING, **parameters}
    return _read(path, name, summary, answer, known, errors=("log", "hw"))


def _change_recording(
    path: str, name: str, summary: str, answer: Component, **body: Schema
) -> Operation:
    """Return an operation that changes one recording, or takes long."""
    path = f"/api/recordings/{{name}}{path}"
    return _change(path, name, summary, answer, _RECORDING, s.body(**body), errors=("log",))


_ROWS = (
    _read(
        "/api/health",
        "health",
        "Report that the server answers.",
        s.answer("Health", ok=s.BOOLEAN, version=s.TEXT, arm=s.BOOLEAN),
    ),
    Operation(
        "GET",
        Access.CHANGE,
        "/api/session",
        "session",
        "Report that the token is right.",
        s.answer("Session", ok=s.BOOLEAN),
    ),
    Operation(
        "POST",
        Access.SIGN_IN,
        "/api/session",
        "sign_in",
        "Exchange the code of a one-time link for the token.",
        s.answer("SignedIn", token=s.TEXT),
        body=s.body("code", code=s.words("The code in the link.")),
    ),
    _change(
        "/api/links",
        "link",
        "Return a link to the page that signs one browser in.",
        s.answer("Link", url=s.TEXT),
        body=s.EMPTY,
    ),
    _read("/api/robot", "robot", "Describe the robot: joints, shapes and tool.", s.ROBOT),
    _read(
        "/api/meshes/{digest}",
        "mesh",
        "Return an STL file: a mesh of the robot, or of an obstacle.",
        parameters={"digest": s.DIGEST},
        media="model/stl",
    ),
    _read("/api/status", "status", "Return the state of the arm and of the goals.", s.STATUS),
    _read("/api/where", "where", "Return the position of the arm: joints and tool.", s.WHERE),
    _read("/api/tasks", "tasks", "List the tasks.", s.answer("Tasks", tasks=s.array(s.TASK))),
    _read(
        "/api/tasks/{task}/nodes",
        "nodes",
        "List the nodes of a task's tree, with kinds, ports and lines in the files.",
        s.answer("Nodes", nodes=s.array(s.NODE)),
        {"task": s.TASK_NUMBER},
        errors=("goal.unknown_task", "file"),
    ),
    _read(
        "/api/goals",
        "goals",
        "List the newest goals, one page at a time.",
        s.answer("Goals", goals=s.array(s.GOAL)),
        {
            "limit": _LIMIT,
            "before": s.described(
                s.STAMP, "List only goals accepted before this time [ns since 1970]."
            ),
        },
    ),
    _change(
        "/api/goals",
        "send",
        "Run a task.",
        _ACCEPTED,
        body=s.body("task", task=s.TASK_OR_NAME, arguments=s.ARGUMENTS, **_NEW_GOAL),
        errors=("goal", "file", "log", "server"),
        status=201,
        names_client=True,
    ),
    _change(
        "/api/plan",
        "plan",
        "Check a task and plan its motions. Answers with the events of a run. Nothing moves.",
        s.answer(
            "DryRun",
            events=s.array({"type": "object"}),
            unknown=s.described(
                s.array(s.TEXT), "A message for each motion that is known only in a run."
            ),
        ),
        body=s.body("task", task=s.TASK_OR_NAME, arguments=s.ARGUMENTS),
        errors=("goal", "file"),
    ),
    _change(
        "/api/move",
        "move",
        "Move joints, or the tool to a point. The move is a goal, like a task.",
        _ACCEPTED,
        body=s.body(
            "to",
            to=s.TARGET,
            relative=s.described(s.BOOLEAN, "True if the target is a change; default false."),
            speed=s.SPEED,
            **_NEW_GOAL,
        ),
        errors=("goal", "file", "log", "server"),
        status=201,
        names_client=True,
    ),
    _read("/api/poses", "poses", "List the poses.", s.answer("Poses", poses=s.array(s.POSE))),
    _change(
        "/api/poses",
        "save_pose",
        "Save the commanded position as a pose, in the folder of your own tasks.",
        s.POSE,
        body=s.body(
            "name",
            name=s.words("Name of the pose."),
            group=s.words("Joints to save: a group of the robot, or `all`; default `arm`."),
            replace=s.described(s.BOOLEAN, "True to replace a pose; default false."),
        ),
        errors=("goal", "file", "hw"),
    ),
    _change(
        "/api/poses/remove",
        "remove_pose",
        "Remove a pose from the files of your own tasks. Shipped poses stay.",
        s.answer("RemovedPose", pose=s.TEXT, source=s.TEXT),
        body=s.body("name", name=s.words("Name of the pose.")),
        errors=("file",),
    ),
    _read(
        "/api/goals/{goal_id}",
        "goal",
        "Return the state of a goal.",
        s.GOAL,
        _GOAL,
        errors=("goal.unknown",),
    ),
    _read(
        "/api/goals/{goal_id}/result",
        "result",
        "Wait for the end of a goal and return its result.",
        s.RESULT,
        {**_GOAL, "timeout": _TIMEOUT},
        errors=("goal.unknown", "goal.result_timeout"),
        streams=True,
    ),
    _change(
        "/api/goals/{goal_id}/hold",
        "hold",
        "Hold a goal. It is canceled if this request's body ends, or sends nothing for a second.",
        s.answer("Released", goal_id=s.GOAL_ID, canceled=s.BOOLEAN),
        _GOAL,
        streams=True,
    ),
    _stop(
        "/api/goals/{goal_id}/cancel",
        "cancel_goal",
        "Cancel a goal, and with `stamp_ns` also every goal accepted until that time.",
        s.CANCELED,
        _GOAL,
        s.body(stamp_ns=s.UNTIL),
    ),
    _stop(
        "/api/cancel",
        "cancel",
        "Cancel the named goals, or all, and stop the arm.",
        s.CANCELED,
        body=s.body(
            goal_id=s.described(s.GOAL_ID, "Cancel this goal, independent of `stamp_ns`."),
            stamp_ns=s.UNTIL,
        ),
    ),
    _stop(
        "/api/stop",
        "stop",
        "Stop the arm and cancel all goals. The body and the query are ignored.",
        s.CANCELED,
    ),
    _change_goal(
        "/api/goals/{goal_id}/pause",
        "pause",
        "Stop the arm and keep the goal.",
        errors=_PAUSE_ERRORS,
    ),
    _change_goal(
        "/api/goals/{goal_id}/resume", "resume", "Resume a paused goal.", errors=_RESUME_ERRORS
    ),
    _change_goal(
        "/api/goals/{goal_id}/step",
        "step",
        "Resume a paused goal until the next node starts.",
        errors=_RESUME_ERRORS,
    ),
    _change(
        "/api/breakpoints",
        "break_at",
        "Set or clear a breakpoint: every goal pauses before that node starts.",
        s.answer("Breakpoints", breakpoints=s.array(s.TEXT)),
        body=s.body(
            "node",
            node=s.words("Path of the node, as in its events."),
            on=s.described(s.BOOLEAN, "False to clear the breakpoint; default true."),
        ),
        errors=("goal.no_such_node", "goal.too_many_breakpoints", "file"),
    ),
    _read(
        "/api/questions",
        "questions",
        "List the open questions of tasks.",
        s.answer("Questions", questions=s.array(s.QUESTION)),
    ),
    _change(
        "/api/questions/{question_id}/answer",
        "answer",
        "Answer a question; the first answer counts.",
        s.answer("Answer", question_id=s.QUESTION_ID, answer=s.TEXT),
        {"question_id": s.QUESTION_ID},
        s.body("answer", answer=s.words("One of the choices, or an unambiguous abbreviation.")),
        errors=("goal.unknown_question", "goal.bad_answer"),
    ),
    _read(
        "/api/recordings",
        "recordings",
        "List recordings, the newest first.",
        s.answer("Recordings", recordings=s.array(s.RECORDING)),
        {
            "search": {"type": "string", "maxLength": 200, "description": "Text to find."},
            "task": _TASK,
            "state": s.choice(["SUCCEEDED", "CANCELED", "ABORTED", "UNFINISHED"]),
            "since": s.described(s.STAMP, "Earliest beginning [ns since 1970]."),
            "until": s.described(s.STAMP, "Latest beginning [ns since 1970]."),
            "before": s.described(s.RECORDING_NAME, "List only recordings with smaller names."),
            "limit": _LIMIT,
        },
    ),
    _read_recording("", "recording", "Return start and duration of a recorded run.", s.TIMELINE),
    _read_recording(
        "/events",
        "recorded_events",
        "Return the recorded events around a moment, with the state before them.",
        s.WINDOW,
        at=s.described(s.MOMENT, "The moment, from the beginning of the goal [s]."),
    ),
    _read_recording(
        "/series",
        "recorded_series",
        "Return the data of the plots of a whole recording.",
        s.SERIES,
        points=s.described(s.integer(1, 2000), "Largest number of samples; default 2000."),
    ),
    _read_recording("/robot", "recorded_robot", "Describe the robot of a recording.", s.ROBOT),
    _read_recording(
        "/nodes",
        "recorded_nodes",
        "List the nodes of a recorded task, with their lines in the recorded files.",
        s.answer("RecordedNodes", nodes=s.array(s.NODE)),
    ),
    _read(
        "/api/recordings/{name}/file",
        "recording_file",
        "Return the file of a recording.",
        parameters=_RECORDING,
        media="application/octet-stream",
        streams=True,
    ),
    _change_recording(
        "/verify",
        "verify_recording",
        "Plan and compile the run again, and compare it with the recording.",
        s.VERIFICATION,
    ),
    _change_recording(
        "/pin",
        "pin_recording",
        "Protect a recording from deletion, or allow deletion.",
        s.RECORDING,
        on=s.described(s.BOOLEAN, "False to allow deletion; default true."),
    ),
    _change_recording(
        "/delete",
        "delete_recording",
        "Delete a recording; for 15 minutes it can be restored.",
        s.answer("Deleted", name=s.RECORDING_NAME),
    ),
    _change_recording("/restore", "restore_recording", "Restore a deleted recording.", s.RECORDING),
    _change(
        "/api/arm/{transition}",
        "arm",
        "Request a transition of the arm; activate opens the port, which may move the arm.",
        s.answer("Arm", arm=s.ARM_STATE),
        {"transition": _TRANSITION},
        s.body(pose=s.START_POSE, stops=_STOPS),
        errors=("hw", "file.robot", "log", "goal.sent_before_stop"),
    ),
    _read(
        "/api/events",
        "events",
        "Stream events as server-sent events, each a JSON object as `armtree run --json` prints.",
        parameters={"events": _KINDS},
        media="text/event-stream",
        streams=True,
    ),
    _read(
        "/metrics", "metrics", "Return metrics for Prometheus.", media="text/plain; version=0.0.4"
    ),
    _read(
        "/openapi.json",
        "openapi",
        "Return this OpenAPI document.",
        Component("OpenApi", {"type": "object"}),
    ),
)

OPERATIONS = {row.name: row for row in _ROWS}
