"""The nodes of a recorded run, with their lines in the recorded files."""

import tempfile
from pathlib import Path
from typing import Any

import logs
from executive.recording.archive import restore_robot
from trees import Library, TreeError
from trees.check import compile_task
from trees.export.node_table import node_table
from trees.export.resolved import RESOLVED
from trees.reading.document import read_text
from trees.reading.library import shipped_folders

_SUFFIXES = (".yaml", ".yml")


def recorded_nodes(recording: logs.Recording, task: int) -> list[dict[str, Any]]:
    """Return the nodes of a recorded task, in the form of `node_table`.

    Returns:
        The nodes; empty if the recorded files cannot be compiled, such as without their skills.

    Args:
        recording: The recording.
        task: Number of its task.

    Raises:
        RecordingError: The recording does not contain a valid robot.
    """
    robot = restore_robot(recording)
    texts = {
        name: data.decode(errors="replace")
        for name, data in recording.files.items()
        if name.endswith(_SUFFIXES) and name != RESOLVED and Path(name).name == name
    }

    def read(path: Path) -> str:
        return texts[path.name] if path.name in texts else read_text(path)

    with tempfile.TemporaryDirectory(prefix="armtree-") as folder:
        shipped = {path.name for each in shipped_folders(robot.name) for path in each.iterdir()}
        for name in texts.keys() - shipped:
            Path(folder, name).write_text(texts[name])
        try:
            return node_table(compile_task(robot, Library(Path(folder), robot.name, read), task))
        except TreeError:
            return []
