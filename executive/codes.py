"""What a failure is called: every code with its meaning, what to do, and its exit status.

One table; `executive/README.md` shows it, and a test keeps both and the errors of all rooms equal.
"""

from dataclasses import dataclass

OK = "ok"
CANCELED = "goal.canceled"
INTERNAL = "internal"
DIFFERS = "replay.differs"
BUSY = "goal.busy"
QUEUE_FULL = "goal.queue_full"
DUPLICATE = "goal.duplicate"
BAD_IDENTITY = "goal.bad_id"
CLOSING = "server.closing"

USAGE_EXIT = 2  # as click has it
INTERRUPTED_EXIT = 130  # left by Ctrl-C before a goal had begun, or by a second one


@dataclass(frozen=True, slots=True)
class Code:
    """What is known of a code.

    Attributes:
        exit: Status of the process.
        means: What happened.
        hint: What to do next; empty where there is nothing to do.
        heading: What is said before the causes; empty where a cause says it all.
    """

    exit: int
    means: str
    hint: str
    heading: str = ""


_PLANNERS = "One or more planners failed"
_FAILED = "The task failed"

# A code is looked up whole, then by what stands before its dot.
CODES = {
    OK: Code(0, "The task was done", ""),
    INTERNAL: Code(
        1, "A bug of ours", "report it, with --debug and the recording", "A bug of ours"
    ),
    # Files
    "file": Code(3, "A file is wrong", "correct it where the message says"),
    "file.error": Code(3, "A task file is wrong", "correct it where the message says"),
    "file.task": Code(
        3,
        "A task file is wrong; every mistake is named with its line",
        "correct it, then `armtree check`",
    ),
    "file.duplicate_task": Code(3, "Two files claim one task number", "rename one of them"),
    "file.robot": Code(
        3, "The robot file or its URDF is wrong", "correct it where the message says"
    ),
    "file.world": Code(
        3, "A file of bodies around the arm is wrong", "correct it where the message says"
    ),
    # Goals
    "goal": Code(4, "The goal makes no sense", "send another one"),
    "goal.error": Code(4, "The goal makes no sense", "send another one"),
    "goal.unknown_task": Code(
        4, "No task has that number", "`armtree tasks` shows those there are"
    ),
    "goal.out_of_bounds": Code(
        4,
        "A target lies outside the limits of its joints",
        "choose a target within",
        "Target position out of boundaries",
    ),
    "goal.bad_target": Code(
        4,
        "A target names no joint, the wrong one, or contradicts itself",
        "correct what the message names",
        "The target makes no sense",
    ),
    "goal.bad_body": Code(
        4,
        "A body that shall stand around the arm makes no sense",
        "correct the task",
        "The body makes no sense",
    ),
    "goal.bad_arguments": Code(
        4, "What a task is called with is wrong", "`armtree tasks` shows what each task takes"
    ),
    "goal.bad_question": Code(4, "A question cannot be asked as it stands", "correct the task"),
    "goal.not_replayable": Code(
        4,
        "The frames of a recording cannot be sent to this arm",
        "give the robot file it was recorded with",
    ),
    BUSY: Code(4, "Another goal is under way", "wait for it, cancel it, or choose another policy"),
    QUEUE_FULL: Code(4, "Too many goals wait for their turn", "wait for some, or cancel them"),
    DUPLICATE: Code(4, "There is a goal of that name already", "give every goal a name of its own"),
    BAD_IDENTITY: Code(
        4,
        "The name of a goal is not 32 lower-case hexadecimal digits",
        "leave it out to have one made",
    ),
    CANCELED: Code(7, "Somebody canceled it", "", "Canceled"),
    "goal.preempted": Code(4, "Another goal took its place", "send it again if it is still wanted"),
    "goal.unknown": Code(4, "There is no goal of that name, or it is forgotten", "ask sooner"),
    "goal.result_timeout": Code(8, "The goal has not ended yet", "ask again"),
    "goal.not_executing": Code(
        4, "Only a goal that is executing can be paused", "`armtree status` shows which one is"
    ),
    "goal.not_paused": Code(4, "Only a paused goal can be gone on with", "pause it first"),
    "goal.too_many_breakpoints": Code(
        4, "There are as many breakpoints as there may be", "`armtree break NODE --off` lifts one"
    ),
    "goal.no_such_node": Code(
        4, "No task has a node of that path", "`armtree run N --json` prints the paths of nodes"
    ),
    # Planning
    "plan": Code(5, "No motion was found", "choose another goal", _PLANNERS),
    "plan.error": Code(5, "No motion was found", "choose another goal", _PLANNERS),
    "plan.bad_query": Code(
        5, "The planner was asked something that makes no sense", "correct the task", _PLANNERS
    ),
    "plan.not_finite": Code(
        5, "The planner was given a NaN or an infinity", "correct the task", _PLANNERS
    ),
    "plan.bad_world": Code(
        5,
        "A body around the arm makes no sense, or is not there",
        "correct the task",
        "What is around the arm makes no sense",
    ),
    "plan.model": Code(3, "The robot's URDF cannot be planned with", "correct it", _PLANNERS),
    "plan.start_out_of_bounds": Code(
        5, "The arm stands outside its limits", "free it by hand, then run again", _PLANNERS
    ),
    "plan.goal_out_of_bounds": Code(
        5, "The motion would end outside the limits", "choose a goal within", _PLANNERS
    ),
    "plan.start_in_collision": Code(
        5, "The arm stands too near to something", "free it by hand, then run again", _PLANNERS
    ),
    "plan.goal_in_collision": Code(
        5, "The goal is too near to something", "choose another goal", _PLANNERS
    ),
    "plan.unreachable": Code(
        5,
        "The tool cannot be brought there, or cannot point that way there",
        "choose a point within reach, or another direction",
        _PLANNERS,
    ),
    "plan.barred": Code(
        5, "A joint cannot pass what is between start and goal", "choose another goal", _PLANNERS
    ),
    "plan.no_path": Code(
        5, "No way round was found", "choose another goal, or one on the way to it", _PLANNERS
    ),
    "plan.timeout": Code(
        8,
        "The planner ran out of time",
        "choose a nearer goal, or go by way of a pose between",
        _PLANNERS,
    ),
    "plan.motion_collides": Code(
        5,
        "The motion would touch something as its frames play it",
        "go by way of a pose further off",
        "The motion would collide as its frames play it",
    ),
    "plan.start_moved": Code(5, "The arm no longer stands where the plan begins", "plan again"),
    "plan.canceled": Code(5, "Planning was canceled", "ask again", _PLANNERS),
    "plan.worker_died": Code(
        5, "The planning process ended; a new one takes over", "run again", _PLANNERS
    ),
    # The arm
    "hw": Code(6, "The arm failed", "see the message"),
    "hw.error": Code(6, "The arm failed", "see the message"),
    "hw.link": Code(6, "The serial port failed", "check the cable and the power"),
    "hw.no_port": Code(3, "Nobody said which serial port", "give --port, or ARMTREE_PORT"),
    "hw.no_driver": Code(
        3, "The robot file names no driver, so its arm cannot be moved", "write one, or plan only"
    ),
    "hw.port_missing": Code(
        6, "There is no such serial port", "`armtree doctor` shows those there are"
    ),
    "hw.port_denied": Code(6, "No permission to open the serial port", "join its group"),
    "hw.port_busy": Code(9, "Another program has the serial port", "end that program"),
    "hw.port_lost": Code(
        6,
        "The serial port went away while it was open",
        "check the cable, then configure and activate",
    ),
    "hw.port_stalled": Code(
        6, "The board takes no more bytes", "check its power, then configure and activate"
    ),
    "hw.board": Code(6, "The board does not do what it was told", "check the cable and its power"),
    "hw.board_silent": Code(
        6, "The board did not say that it has booted", "flash it, or name what it runs"
    ),
    "hw.wrong_firmware": Code(
        6, "The board runs another firmware than the robot file names", "correct the robot file"
    ),
    "hw.pose_outside": Code(
        6, "The board holds what is outside a joint's limits", "switch the board off and on"
    ),
    "hw.driver": Code(6, "The driver of the arm failed", "mend the driver"),
    "hw.board_reset": Code(
        6, "The board started anew while the arm was active", "check the servos' supply"
    ),
    "hw.frame_lost": Code(6, "The board took other frames than were sent", "check the cable"),
    "hw.transition_refused": Code(
        6, "The arm's lifecycle does not allow that now", "the message lists what it allows"
    ),
    "hw.pose_unconfirmed": Code(
        6, "Nobody has said where the arm stands", "give --pose last, or --pose boot"
    ),
    "hw.activation_stopped": Code(
        6, "Somebody stopped the arm while its board booted", "activate it again"
    ),
    "hw.cancel_timeout": Code(
        6,
        "What drove the arm did not stop in time, so the arm left *active*",
        "mend the skill that is named, then configure and activate",
    ),
    "hw.stopped": Code(6, "Somebody stopped the arm from outside the task", "run again"),
    "hw.refused": Code(
        6, "The guard in front of the wire refused; nothing was sent", "see the message"
    ),
    "hw.not_active": Code(
        6,
        "Only an active arm may be written to",
        "`armtree arm configure` where it is unconfigured, then `armtree arm activate`; "
        "where it is finalized, start armtree again",
    ),
    "hw.no_interface": Code(
        6, "The arm has no such command interface", "the message lists those there are"
    ),
    "hw.claimed": Code(6, "Somebody else commands that joint", "stop the arm first"),
    "hw.stale": Code(6, "The motion that wants to write was stopped", "run again"),
    "hw.bad_position": Code(
        6, "A joint value is missing, not finite or outside its limits", "choose one within"
    ),
    "hw.too_fast": Code(
        6, "More than the board can digest", "lower the velocity in the robot file"
    ),
    # What a task says itself
    "task": Code(11, "The task failed by its own tree", "see its nodes", _FAILED),
    "task.failed": Code(11, "The task failed by its own tree", "see its nodes", _FAILED),
    "task.condition": Code(
        11, "Something the task asks for is not so", "see what it asks for", _FAILED
    ),
    "task.function": Code(
        11, "A function of a skill raised something", "correct the function", _FAILED
    ),
    "task.timeout": Code(8, "A time-out of the task is over", "allow more time", _FAILED),
    "task.unanswered": Code(11, "The operator did not answer", "run again, and answer", _FAILED),
    "skill": Code(1, "A skill failed without a cause of its own", "report it", _FAILED),
    "skill.error": Code(1, "A skill failed without a cause of its own", "report it", _FAILED),
    "skill.broken": Code(
        11,
        "The code of a skill raised something",
        "correct it; --debug shows the line. If it is one of ours, report it",
        _FAILED,
    ),
    # Recordings
    "log": Code(10, "Something could not be recorded", "make room, or record to another folder"),
    "log.error": Code(
        10, "Something could not be recorded", "make room, or record to another folder"
    ),
    "log.exists": Code(10, "A recording of that name exists", "record under another name"),
    "log.not_created": Code(10, "A recording cannot be made", "give another folder for recordings"),
    "log.no_space": Code(10, "The disk is too full to begin", "remove old recordings"),
    "log.disk_full": Code(10, "The disk filled up during a run", "remove old recordings"),
    "log.incomplete": Code(
        10, "Something of a run is missing from its recording", "mend the disk, then run again"
    ),
    "log.behind": Code(
        10, "The disk is too slow, so that nothing more was sent", "record to a faster disk"
    ),
    "log.in_use": Code(10, "A recording is still being written", "wait until that has ended"),
    "log.unreadable": Code(3, "A file cannot be read as a recording", "give another file"),
    "log.truncated": Code(10, "The end of a recording is missing", "`armtree log recover`"),
    "replay": Code(12, "A replay is not what was recorded", "see where it differs"),
    DIFFERS: Code(12, "A replay is not what was recorded", "see where it differs"),
    # The server
    "server": Code(13, "The server cannot take part", "start it again"),
    CLOSING: Code(13, "The server is ending", "start it again"),
    "server.held": Code(
        13,
        "The code of a skill does not return, so that nothing else can be executed",
        "start the server again, and mend the skill that is named",
    ),
    "server.restarted": Code(
        13,
        "The server ended before the goal did",
        "see where the arm stands, then send the goal again",
    ),
    "server.error": Code(13, "The server failed", "see its log"),
    "server.unreachable": Code(
        13,
        "No server answers",
        "`armtree serve` starts one; --server URL or ARMTREE_SERVER says where it is",
    ),
    "server.options": Code(13, "The server would be open to more than was said", "see the message"),
    "server.address_in_use": Code(
        13, "Another program listens at that address", "end it, or give --tcp-port"
    ),
    "goal.not_held": Code(
        4, "A goal with a dead man's handle, and nobody holds it", "hold it, then send it"
    ),
    "goal.unknown_question": Code(
        4, "There is no question of that name, or it is answered", "`armtree answer` lists them"
    ),
    "goal.bad_answer": Code(4, "An answer is none of the choices", "give one of the choices"),
    # Requests
    "request": Code(13, "The server refused a request", "`/openapi.json` lists all there is"),
    "request.malformed": Code(
        13, "A request cannot be understood", "`/openapi.json` says how to ask"
    ),
    "request.forbidden": Code(13, "A request from a foreign page or name", "see the message"),
    "request.host": Code(
        13, "Host is no name of this server", "ask it by its address, or serve --host NAME"
    ),
    "request.origin": Code(13, "A foreign page asks", "serve --origin URL lets it, if it shall"),
    "request.token": Code(
        13, "The token is missing or wrong", "the server printed it when it started"
    ),
    "request.too_many": Code(13, "Too many requests, or clients", "wait a moment"),
    "request.too_large": Code(13, "A body is too large", "send less"),
    "request.timeout": Code(13, "A body came too slowly", "send it in one go"),
    "request.not_found": Code(13, "There is no such address", "`/openapi.json` lists them"),
    "request.method": Code(13, "That method is not for this address", "`/openapi.json` lists them"),
}


def look_up(code: str) -> Code:
    """The entry of a code, or of its family."""
    return CODES.get(code) or CODES.get(code.partition(".")[0]) or CODES[INTERNAL]


def code_table() -> str:
    """All codes as a Markdown table."""
    lines = ["| code | exit | means | what to do |", "|---|---|---|---|"]
    lines += [
        f"| `{code}` | {known.exit} | {known.means} | {known.hint} |"
        for code, known in CODES.items()
    ]
    return "\n".join(lines) + "\n"
