"""Steps that tests of the server's executive share."""

import logs
from executive.api.outcome import Outcome
from tests.conftest import Rig


def at_frame(rig: Rig, number: int, act: object) -> None:
    """Call a function, on another thread, when that many frames were sent."""

    def watch(record: logs.Record) -> None:
        if isinstance(record, logs.Sent) and len(rig.recorded(logs.Sent)) == number:
            rig.on_record = lambda _: None
            rig.soon(act)  # type: ignore[arg-type]

    rig.on_record = watch


def history(rig: Rig, identity: str) -> list[str]:
    return [status.state.name for status in rig.statuses if status.identity == identity]


def run(rig: Rig, task: int) -> Outcome:
    return rig.executive.result(rig.executive.send(task).identity)
