"""What `make mutation` runs: no branch untested, and no change to the code unnoticed.

The modules and their tests are those of `[tool.mutmut]` in pyproject.toml. The tests must take
every branch of the modules; then mutmut changes the modules in many small ways, one at a time, and
the tests must fail on each. A change that they let pass, a survivor, must stand in explained.toml,
and what stands there must still be one. mutmut leaves properties and module-level tables alone.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
NAME = re.compile(r"(?P<module>\S+)\.x(?:\u01c1(?P<of>\w+)\u01c1|_)(?P<function>\w+)__mutmut_\d+")


class Survivor(NamedTuple):
    """A change that no test noticed: in which function, and its lines before and after."""

    function: str
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.function}\n  - {self.before}\n  + {self.after}\n"


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-P", "-m", *arguments]


def status(*arguments: str) -> int:
    return subprocess.call(command(*arguments), cwd=ROOT)


def output(*arguments: str) -> str:
    return subprocess.check_output(command(*arguments), cwd=ROOT, text=True)


def covered(modules: Sequence[str], tests: Sequence[str]) -> bool:
    """Whether the tests pass and take every branch."""
    with tempfile.TemporaryDirectory() as folder:
        data, only = f"--data-file={folder}/data", f"--include={','.join(modules)}"
        measured = ("coverage", "run", "--branch", data, only, "-m", "pytest", "--quiet", *tests)
        table = ("coverage", "report", "--show-missing", "--fail-under=100", data)
        return not status(*measured) and not status(*table)


def survivors() -> Iterator[Survivor]:
    """What the last run of mutmut left."""
    for name, verdict in re.findall(r"(\S+): (.+)", output("mutmut", "results")):
        match = NAME.fullmatch(name)
        assert match, name
        if verdict != "timeout":  # a change that hangs the tests is noticed, too
            change = output("mutmut", "show", name)
            before = re.findall(r"^-(?!--) *(.*)", change, re.MULTILINE)
            after = re.findall(r"^\+(?!\+\+) *(.*)", change, re.MULTILINE)
            function = ".".join(filter(None, match.group("module", "of", "function")))
            yield Survivor(function, "\n".join(before), "\n".join(after))


def explained() -> set[Survivor]:
    """Those that are known, each with its reason."""
    entries = tomllib.loads((HERE / "explained.toml").read_text())["survivor"]
    return {
        Survivor(entry["function"], entry["before"], after)
        for entry in entries
        if entry["why"]
        for after in entry["after"]
    }


def main() -> int:
    """Exit status 0 where all is covered, and noticed or explained."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mutmut"]
    if not covered(settings["only_mutate"], settings["pytest_add_cli_args_test_selection"]):
        return 1
    shutil.rmtree(ROOT / "mutants", ignore_errors=True)  # mutmut would trust older tests' verdicts
    if status("mutmut", "run"):
        return 1
    found, known = set(survivors()), explained()
    for title, some in (
        ("No test notices this; write one, or explain it", found - known),
        ("Explained, but noticed or gone; take it out", known - found),
    ):
        for survivor in sorted(some):
            sys.stdout.write(f"{title}: {survivor}")
    sys.stdout.write(f"{len(found)} survivors, {len(found & known)} of them explained\n")
    return int(found != known)


if __name__ == "__main__":
    sys.exit(main())
