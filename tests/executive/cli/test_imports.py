"""What a command imports before it does its work: imports are most of the time that it takes."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOMS = {"executive", "hardware", "logs", "skills", "trees"}

# Typed as a user does, or imported, because the command would do more.
ROWS = {
    "--help": ("typed", "--help"),
    "send --help": ("typed", "send --help"),
    "serve --help": ("typed", "serve --help"),
    "stop": ("typed", "stop --server http://127.0.0.1:9"),
    "status": ("typed", "status --server http://127.0.0.1:9"),
    "tasks": ("typed", "tasks"),
    # While the board boots, a run also loads the journal and NumPy.
    "run": ("imported", "executive.cli.support.run_tasks"),
    "serve": ("imported", "executive.cli.support.run_server"),
}
HTTP = {"anyio", "certifi", "h11", "httpcore"}
RUN = {"click", "py_trees", "pydot", "ruamel"}
SERVER = {"fastjsonschema", "prometheus_client", "starlette", "uvicorn", "websockets"}
LIBRARIES = {
    "--help": {"click"},
    "send --help": {"click"},
    "serve --help": {"click"},
    "stop": {"click", *HTTP},
    "status": {"click", *HTTP},
    "tasks": {"click", "ruamel"},
    "run": RUN,
    # Starlette imports python_multipart if another package brings it.
    "serve": RUN | SERVER | {"anyio", "h11", "python_multipart", "typing_extensions"},
}
# Folders of this project, and modules, that a command leaves alone. What a run needs, it needs.
UNUSED = {
    "--help": {
        "concurrent.futures",
        "executive.api.token_file",
        "executive.cli.run",
        "executive.cli.settings",
        "executive.client",
        "hardware.description",
        "logging",
        "logs",
        "skills",
        "subprocess",
        "trees",
    },
    "stop": {"executive.goals", "hardware.description", "logs.reading", "skills", "trees.reading"},
    "status": {"executive.goals", "hardware.description", "logs.reading", "skills"},
    "tasks": {"executive.client", "executive.executive", "skills", "trees.compile"},
    "run": {
        "executive.client",
        "executive.goals.history",
        "executive.goals.moves.move_task",
        "executive.recording.archive",
        "executive.replay",
        "executive.server",
        "hashlib",
        "logs.reading.recording",
        "logs.views",
        "logs.writing.journal",
        "trees.check",
    },
}
# Modules of the standard library that take long to import, and the commands that need them.
SLOW = {"serve": {"email", "importlib.metadata"}}
CODE = """\
import sys
sys.path += {path}
sys.argv = ["armtree", *{words}]
{code}
print("", *sys.modules, file=sys.stderr)
"""
TYPE = """\
from executive.cli.main import main
try:
    main()
except SystemExit:
    pass"""


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS)
def test_a_command_imports_no_more_than_it_needs(row: str, tmp_path: Path) -> None:
    """In a folder without recordings, of which `armtree tasks` would show the outcomes."""
    how, words = ROWS[row]
    code = TYPE if how == "typed" else f"import {words}"
    program = CODE.format(path=sys.path, words=words.split(), code=code)
    command = [sys.executable, "-S", "-c", program]  # without packages' own imports at the start
    ran = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = set(ran.stderr.splitlines()[-1].split())
    packages = {name.partition(".")[0] for name in loaded} - sys.stdlib_module_names
    assert packages - ROOMS - {"__main__", "__mp_main__"} <= LIBRARIES[row]
    assert packages >= {"click", "executive"}
    assert UNUSED.get(row, set()) & loaded == set()
    assert {"email", "importlib.metadata"} & loaded <= SLOW.get(row, set())
