"""Task files that are damaged at random, and files made to exhaust memory or time."""

import contextlib
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tests.faults.process import HANG_S, Command
from tests.faults.row import Scene, last_line, row
from tests.support.paths import EXAMPLES, TASKS as SHIPPED

MEMORY = 20  # that a task file may take more than a small one [MiB]
SIGNS = "abz019 -:{}[],$#\t'\"&*!|>%@.\n\x00\x1bé\ufeff"


def damaged(text: str, rng: random.Random) -> str:
    """The text with a few slips: characters changed, lost or added, lines lost or doubled."""
    for _ in range(rng.randint(1, 4)):
        place, lines = rng.randrange(len(text) or 1), text.splitlines(keepends=True)
        line = rng.randrange(len(lines) or 1)
        text = rng.choice(
            [
                text[:place] + rng.choice(SIGNS) + text[place + 1 :],
                text[:place] + rng.choice(SIGNS) + text[place:],
                text[:place] + text[place + 1 :],
                text[: rng.randrange(len(text) + 1)],
                "".join(lines[:line] + lines[line + 1 :]),
                "".join([*lines[: line + 1], *lines[line:]]),
            ]
        )
    return text


class Use(NamedTuple):
    """What a command took: time and processor time [s], and its largest memory [MiB]."""

    seconds: float
    processor: float
    memory: float


def used(command: Command) -> Use:
    """Wait for the end of a command, and return what it took."""
    processor = most = 0.0
    while command.popen.poll() is None and time.monotonic() < command.started + HANG_S:
        with contextlib.suppress(OSError, IndexError):  # it has just ended
            most, processor = max(most, command.memory()), command.processor()
        time.sleep(0.01)  # noqa: TID251, it samples another process
    command.wait()
    return Use(time.monotonic() - command.started, processor, most)


def checked(scene: Scene, folder: Path) -> tuple[Command, Use]:
    """`armtree check` of a folder with mistakes, and what it took."""
    check = scene.armtree("check", "--trees", folder)
    use = used(check)
    scene.ended(check, 3, what=folder.name)
    return check, use


@row(
    "damaged-tasks",
    "25 task files with random damage: characters, lines, ends",
    "`armtree check` lists the mistakes, with exit status 3; no traceback",
    limit=30,
    unit="s",
    times=3,
)
def damaged_tasks(scene: Scene) -> None:
    files = sorted([*SHIPPED.glob("**/*.yaml"), *EXAMPLES.glob("*.yaml")])
    folder = scene.folder / "damaged"
    folder.mkdir()
    for _ in range(25):
        path = scene.random.choice(files)
        data = damaged(path.read_text(), scene.random).encode("utf-8", "surrogatepass")
        if scene.random.random() < 0.1:
            data = data.replace(b"a", b"\xff", 1)
        (folder / path.name).write_bytes(data)
        # Another name, so that each file is also read on its own.
        (folder / f"{scene.random.randrange(10**6)}_{path.name}").write_bytes(data)
    check, use = checked(scene, folder)
    scene.check(".yaml:" in check.text(), last_line(check))
    scene.figure(use.seconds)
    scene.injections = 25


def billion_laughs() -> str:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    for number in range(1, 12):
        lines.append(f"a{number}: &a{number} [{', '.join([f'*a{number - 1}'] * 10)}]")
    return "\n".join(lines) + "\n"


BOMBS: dict[str, Callable[[], str]] = {
    "aliases": billion_laughs,
    "brackets": lambda: "task: 30\ntree: " + "[" * 100_000 + "\n",
    "braces": lambda: "task: 30\ntree: " + "{a: " * 20_000 + "\n",
    "nesting": lambda: "".join(f"{' ' * depth}a:\n" for depth in range(400)),
    "size": lambda: "task: 30\nname: x\n" + "# padding\n" * 200_000,
    "keys": lambda: "".join(f"key{number}: 1\n" for number in range(100_000)),
    "list": lambda: "task: 30\ntree:\n  sequence:\n" + "    - Succeed\n" * 50_000,
    "tag": lambda: "task: !!python/object/apply:os.system [touch pwned]\n",
    "merge": lambda: "a: &a {b: 1}\nc:\n" + "".join("  <<: *a\n" for _ in range(20_000)),
    "word": lambda: "task: 30\nname: " + "x" * 2_000_000 + "\n",
    "number": lambda: "task: " + "9" * 100_000 + "\n",
    "recursion": lambda: "a: &a [*a]\n",
}


@row(
    "task-bombs",
    "task files made to exhaust memory or time: aliases, depth, size, numbers, tags",
    "`armtree check` refuses each with exit status 3 and its line, and takes little more than for a"
    f" file of one line: at most {MEMORY} MiB more, and the processor time at most so many times",
    limit=1.8,
    unit="times",
    times=1,
)
def bombs(scene: Scene) -> None:
    for name, text in {"small": lambda: "task: 30\n", **BOMBS}.items():
        (scene.folder / name).mkdir()
        (scene.folder / name / "30_x.yaml").write_text(text())
    for name in sorted(BOMBS):
        ratios = list[float]()
        for _ in range(2):  # the speed of the machine changes, also between two commands
            _, small = checked(scene, scene.folder / "small")
            check, use = checked(scene, scene.folder / name)
            ratios.append(use.processor / small.processor)
        scene.check("30_x.yaml:" in check.text(), f"{name}: {last_line(check)}")
        scene.figure(min(ratios))
        more = use.memory - small.memory
        scene.check(more < MEMORY, f"{name}: {more:.0f} MiB more memory than a small file")
        scene.check(not (scene.folder / "pwned").exists(), "a file ran a program")
    scene.injections = len(BOMBS)
