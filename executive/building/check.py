"""`armtree check`: everything that can be found wrong with task files before anything moves."""

from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import SimpleQueue

from py_trees.behaviour import Behaviour

from hardware import Arm, RealClock, Robot
from skills import Context, Positions, SkillError, Target
from skills.motion import BadWorld, Body, MotionError, Pool, Result, Verify, WorkerDied, World
from trees import FileError, Library, Mistake, Mistakes, Place, PosesFile, TreeError

from .assembly import Assembly
from .builder import hidden, poses, refusals
from .outline import Entry, outline

Pose = tuple[float, ...]

# What a file is in its library: the number of a task, the name of a subtree, None for poses, or
# why it is nothing.
Named = int | str | None | FileError


@dataclass
class Findings:
    """What was found.

    Attributes:
        files: What was checked.
        mistakes: What is wrong, in the order of files and lines.
        notes: Files that were left alone, and why.
    """

    files: list[Path] = field(default_factory=list)
    mistakes: list[Mistake] = field(default_factory=list)
    notes: list[Mistake] = field(default_factory=list)


def check(robot: Robot, folder: Path | None, files: Sequence[Path] = ()) -> Findings:
    """Check task files, subtrees and poses.

    Args:
        robot: For which robot.
        folder: The user's task files.
        files: Only these; none for all there are.
    """
    context = _context(robot)
    findings = Findings()
    places: dict[Pose, list[Place]] = {}
    bodies: dict[Body, list[Place]] = {}
    try:
        jobs = list(_jobs(folder, files))
    except TreeError as error:
        findings.mistakes = _mistakes(error)
        return findings
    for library in {id(library): library for _, library, _ in jobs}.values():
        named = {path.resolve() for path in files}
        findings.mistakes += [
            m for m in library.mistakes if not files or m.place.path.resolve() in named
        ]
        findings.notes += [] if files else library.notes
    for path, library, name in jobs:
        findings.files.append(path)
        checker = _Checker(library, context, places, bodies)
        findings.mistakes += checker.check(path, name)
    findings.mistakes += _refused(robot, places, bodies, context)
    findings.mistakes = list(FileError(findings.mistakes).mistakes)
    return findings


def outline_of(robot: Robot, library: Library, number: int) -> Entry:
    """The tree of a task, to be shown.

    Raises:
        UnknownTask: There is none of that number.
        FileError: It is wrong.
    """
    assembly, root = _assembled(robot, library, number)
    return outline(root, assembly.leaves, "/show")


def targets_of(robot: Robot, library: Library, number: int) -> list[Pose]:
    """Where a task spells out that the arm goes: values of the actuated joints [rad], in order.

    Raises:
        UnknownTask: There is none of that number.
        FileError: It is wrong.
    """
    assembly, _ = _assembled(robot, library, number)
    return [pose for _, pose in poses(assembly.leaves, robot)]


def _assembled(robot: Robot, library: Library, number: int) -> tuple[Assembly, Behaviour]:
    assembly, draft = Assembly(library, _context(robot)), library.draft(number)
    root = assembly.task(*draft, "/show", None)
    if found := [*assembly.mistakes.found, *hidden(draft, library, _context(robot))]:
        raise FileError(found)
    return assembly, root


def _jobs(folder: Path | None, files: Sequence[Path]) -> Iterator[tuple[Path, Library, Named]]:
    if not files:
        yield from _all(Library(folder))
        return
    libraries: dict[Path, dict[Path, tuple[Library, Named]]] = {}
    for file in files:
        parent = file.resolve().parent
        if parent not in libraries:
            libraries[parent] = {
                path.resolve(): (library, name)
                for path, library, name in _all(Library(file.parent))
            }
        library = next(iter(libraries[parent].values()))[0]  # poses ship, so there is one
        if told := [m for m in library.mistakes if m.place.path.resolve() == file.resolve()]:
            yield file, library, FileError(told)
        elif file.resolve() not in libraries[parent]:
            wrong = "is no task, subtree or poses file: name it like 3_wave.yaml or reach.yaml"
            yield file, library, FileError([Mistake(Place(file, 1, 1), wrong)])
        else:
            yield file, *libraries[parent][file.resolve()]


def _all(library: Library) -> Iterator[tuple[Path, Library, Named]]:
    for path in library.pose_files:
        yield path, library, None
    for name in library.subtrees():
        yield library.subtree_path(name), library, name
    for number in library.numbers():
        with suppress(FileError):  # two files have it, which is among the library's mistakes
            yield library.path(number), library, number


class _Checker:
    """Checks one file of a library.

    Args:
        library: The library.
        context: Of a robot that does nothing.
        places: Filled with the poses that are spelled out, and where.
        bodies: The same of bodies.
    """

    def __init__(
        self,
        library: Library,
        context: Context,
        places: dict[Pose, list[Place]],
        bodies: dict[Body, list[Place]],
    ) -> None:
        self._library, self._context = library, context
        self._places, self._bodies = places, bodies

    def check(self, path: Path, name: Named) -> list[Mistake]:
        """What is wrong with a file."""
        try:
            if isinstance(name, FileError):
                raise name
            if name is None:
                self._library.poses()
                return self._reachable(self._library.poses_in(path))
            assembly = Assembly(self._library, self._context)
            if isinstance(name, int):
                draft = self._library.draft(name)
                assembly.task(*draft, "/check", None)
                found = [*assembly.mistakes.found, *hidden(draft, self._library, self._context)]
            else:
                place = Place(self._library.subtree_path(name), 1, 1)
                file, known = self._library.subtree(name, place)
                assembly.subtree(file, Mistakes(known), "/check")
                found = assembly.mistakes.found
        except TreeError as error:
            return _mistakes(error)
        if found:
            return found
        robot = self._context.robot
        refused = refusals(assembly.leaves, robot)
        if not refused:
            for place, pose in poses(assembly.leaves, robot):
                self._places.setdefault(pose, []).append(place)
            for leaf in assembly.leaves:
                if body := type(leaf.skill).body(leaf.known):
                    self._bodies.setdefault(body, []).append(leaf.place)
        return refused

    def _reachable(self, file: PosesFile) -> list[Mistake]:
        """Poses that the robot cannot take, whether or not a task names them."""
        robot, wrong = self._context.robot, []
        for name, joints in file.poses.items():
            place = file.labels[name].label
            try:
                Target.judge(robot, {"joints": Positions(joints)})
            except SkillError as error:
                wrong.append(Mistake(place, f"{name}: {error}"))
                continue
            leaders = ({joint.name for joint in robot.leaders(group)} for group in robot.groups)
            if any(names <= joints.keys() for names in leaders):  # the others as after a reset
                pose = tuple(joints.get(joint.name, joint.boot) for joint in robot.actuated)
                self._places.setdefault(pose, []).append(place)
        return wrong


def _mistakes(error: TreeError) -> list[Mistake]:
    if isinstance(error, FileError):
        return list(error.mistakes)
    path = getattr(error, "path", None)
    return [Mistake(Place(path, 1, 1) if path else Place(Path(), 0, 0), str(error))]


def _refused(
    robot: Robot,
    places: dict[Pose, list[Place]],
    bodies: dict[Body, list[Place]],
    context: Context,
) -> Iterator[Mistake]:
    """What a planner says of every pose, and of every body by itself."""
    if not (places or bodies):
        return
    answers: SimpleQueue[Result] = SimpleQueue()
    with closing(context.pool) as pool:
        pool.start()
        for pose, where in places.items():
            pool.submit(Verify([pose], robot.collision.margin), answers.put)
            answer = answers.get()
            if isinstance(answer, MotionError):
                yield from (Mistake(place, f"this pose collides: {answer}") for place in where)
        for body, where in bodies.items():
            alone = World((replace(body, touches=frozenset()),))  # others may be there by then
            pool.submit(Verify([robot.boot_pose], 0.0, world=alone), answers.put)
            answer = answers.get()
            if isinstance(answer, (BadWorld, WorkerDied)):
                yield from (Mistake(place, f"{body.name}: {answer}") for place in where)


def _context(robot: Robot) -> Context:
    clock = RealClock()
    arm, pool = Arm(robot, None, clock), Pool(robot, 1, clock)
    return Context(robot, arm, pool, 1, 5.0, _ignore, _ignore, clock, _ignore)


def _ignore(*_: object) -> None:
    """Nothing runs here, so nobody is told."""
