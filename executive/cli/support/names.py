"""Arguments that name a task, a recording, a port or a node, and how a shell completes them."""

from pathlib import Path
from typing import Any

import click

from .settings import find_setting

_LARGEST = 2**31 - 1


class TaskName(click.ParamType):  # type: ignore[type-arg]  # generic since click 8.4
    """The number of a task, or its name. It need not exist."""

    name = "task"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """Return the number as an integer, or the name; raise a usage error for neither."""
        text = str(value)
        if text.isdecimal() and len(text) < 20 and int(text) <= _LARGEST:
            return int(text)
        if not text[:1].isalpha():
            why = f"{text!r} is neither the number of a task, from 0 to {_LARGEST}, nor a name"
            self.fail(why, param, ctx)
        return text


class RecordingName(click.Path):
    """A recording: a file, `latest`, `latest:TASK`, or the beginning of the name of one."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path of the recording.

        Raises:
            NoSuchRecording: No recording has the name, or several do.
        """
        from logs import find_recording

        folder = find_setting(ctx or click.get_current_context(), "recordings")[0]
        return find_recording(str(value), folder)


class TaskOrRecording(click.ParamType):  # type: ignore[type-arg]
    """A task or a recording."""

    name = "task or recording"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str | Path:
        """Return the number or name of the task, or the path of the recording."""
        from logs.reading.find import is_recording_name

        kind = RECORDING if is_recording_name(str(value)) else TASK
        found: int | str | Path = kind.convert(value, param, ctx)
        return found


TASK_OR_RECORDING = TaskOrRecording()
TASK, RECORDING = TaskName(), RecordingName()
