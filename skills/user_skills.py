"""Loads users' skills from Python files in a folder (`--skills`), and from installed packages."""

import importlib.util
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import NoReturn

from py_trees.ports import get_ports_registry, register_ports_class

from hardware import read_file
from hardware.installed import EntryPoint, entry_points

from . import leaves as leaves  # the shipped skills are registered before those of users

GROUP = "armtree.skills"
_MAX_BYTES = 2**20  # largest size of a file [bytes]

_loaded: dict[str, str] = {}  # error of each plugin by module; empty if the plugin has no error


def load_skills(folder: Path | None, reserved: Collection[str]) -> list[str]:
    """Load users' skills. Each plugin (file or package) is loaded once per process.

    A broken plugin does not affect the others.

    Args:
        folder: Folder of Python files; None to load only installed packages.
        reserved: Names that no skill may have, because the grammar of task files uses them.

    Returns:
        A message for each broken plugin; empty if there is none.
    """
    wrong = [_load_package(entry, reserved) for entry in entry_points(GROUP).values()]
    if folder is not None:
        if not folder.is_dir():
            return [*filter(None, wrong), f"{folder}: there is no such folder for skills"]
        files = sorted(path for path in folder.glob("*.py") if not path.name.startswith("_"))
        wrong += [_load_file(path, reserved) for path in files]
    return [reason for reason in wrong if reason]


def is_broken(module: str) -> bool:
    """Return True if a module is a plugin that was not loaded completely."""
    return bool(_loaded.get(module))


def _load_package(entry: EntryPoint, reserved: Collection[str]) -> str:
    module = entry.module
    if module not in _loaded:
        _loaded[module] = _guarded(f"{entry.name} ({entry.value})", reserved, entry.load)
    return _loaded[module]


def _load_file(path: Path, reserved: Collection[str]) -> str:
    module = f"armtree_skills.{path.resolve().as_posix().replace('.', '_')}"
    if module not in _loaded:
        try:
            read_file(path, _MAX_BYTES)
        except OSError as error:
            return f"{path}: {error.strerror}"
        spec = importlib.util.spec_from_file_location(module, path)
        assert spec
        assert spec.loader
        made = importlib.util.module_from_spec(spec)
        sys.modules[module] = made  # as `import` does, so that annotations can be resolved
        loader = spec.loader
        _loaded[module] = _guarded(str(path), reserved, lambda: loader.exec_module(made))
    return _loaded[module]


def _guarded(source: str, reserved: Collection[str], load: Callable[[], object]) -> str:
    """Load a plugin. Return its error as a message; empty if there is no error."""
    before, pressed = get_ports_registry(), list[int]()
    try:
        # Output of a plugin must not mix with the standard output of a command.
        with warnings.catch_warnings(), _ctrl_c(pressed), redirect_stdout(sys.stderr):
            warnings.simplefilter("ignore")  # duplicate names are reported below
            warnings.filterwarnings("always", ".* is deprecated; rename it", DeprecationWarning)
            load()
    except BaseException as error:  # users' code may raise any exception
        if pressed:
            raise
        return f"{source}{_line(error, source)}: {type(error).__name__}: {error}"
    after = get_ports_registry()
    taken = [name for name, kind in after.items() if before.get(name, kind) is not kind]
    if wrong := [name for name in after if name not in before and name in reserved]:
        return f"{source}: {', '.join(wrong)}: a word of the grammar; rename the skill"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in taken:
            register_ports_class(name, before[name])
    if taken:
        return f"{source}: {', '.join(taken)}: another skill already has this name; rename it"
    return ""


@contextmanager
def _ctrl_c(pressed: list[int]) -> Iterator[None]:
    """Context that notes a Ctrl-C in a list. A KeyboardInterrupt of a plugin is not noted."""

    def press(number: int, frame: object) -> NoReturn:
        pressed.append(number)
        raise KeyboardInterrupt

    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, press)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _line(error: BaseException, source: str) -> str:
    """Return the line number of an error in a file, such as `:12`; empty if unknown."""
    if isinstance(error, SyntaxError) and error.lineno:
        return f":{error.lineno}"
    trace, line = error.__traceback__, 0
    while trace:
        if trace.tb_frame.f_code.co_filename == source:
            line = trace.tb_lineno
        trace = trace.tb_next
    return f":{line}" if line else ""
