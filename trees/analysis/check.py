"""`armtree check`: everything that can be found wrong with task files before anything moves."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from queue import SimpleQueue

from py_trees.behaviour import Behaviour

from hardware import Arm, RealClock, Robot
from skills import Context, Positions, SkillError, check_joints, known_errors
from skills.motion import (
    EMPTY,
    BadWorld,
    Body,
    Carry,
    MotionCollides,
    MotionError,
    Pool,
    Reached,
    Result,
    ToolQuery,
    Verify,
    WorkerDied,
    World,
)
from trees.compile.assembly import TreeCompiler
from trees.compile.builder import mistakes_of, refusals
from trees.compile.paths import paths
from trees.compile.skill_hooks import Asking, Pose
from trees.errors import FileError, Mistake, Place, TreeError
from trees.export.outline import Entry, outline
from trees.reading.document import StandIn
from trees.reading.grammar import PosesFile
from trees.reading.library import Library
from trees.reading.node_parser import Mistakes

from .predicted_motion import Motion, foresee

# What a file is in its library: the number of a task, the name of a subtree, None for poses, or
# why it is nothing.
Named = int | str | None | FileError


@dataclass
class Findings:
    """What was found.

    Attributes:
        files: What was checked.
        mistakes: What is wrong, in the order of files and lines.
        notes: Files that were left alone, and why; and tasks that do not get on from where a reset
            puts the arm, as it may stand elsewhere.
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
    asked = _Asked()
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
        checker = _Checker(library, context, asked)
        findings.mistakes += checker.check(path, name)
    findings.mistakes += _refused(asked, context, findings.notes)
    findings.mistakes += [m for _, built in asked.trees for m in built.asking.mistakes]
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


def check_task(robot: Robot, library: Library, number: int) -> None:
    """See that a task is right, as far as that goes without a planner.

    Raises:
        UnknownTask: There is none of that number.
        FileError: It is wrong, or a skill refuses what it spells out.
    """
    assembly, _ = _assembled(robot, library, number)
    _check_refused(assembly, robot)


def motions_of(
    robot: Robot,
    library: Library,
    number: int,
    carry: Callable[[Carry], Body],
    reach: Callable[[ToolQuery], Reached],
    start: Pose,
    world: World,
) -> tuple[list[Motion], list[str]]:
    """Where the arm goes, as far as a task tells, in order, with what is around it by then.

    Args:
        robot: The robot.
        library: Where the task is.
        number: Of the task.
        carry: Hands a body over to another link; may raise a MotionError.
        reach: Says where the joints are for the tool to be at a point; may raise a MotionError.
        start: Where the arm stands at first [rad].
        world: What is around it at first.

    Returns:
        The motions; and in words the moves that are left out.

    Raises:
        UnknownTask: There is none of that number.
        FileError: It is wrong.
    """
    assembly, root = _assembled(robot, library, number)
    _check_refused(assembly, robot)
    asking, leaves = assembly.asking, assembly.leaves
    found = foresee(root, leaves, robot, carry, start, world, asking=asking, reach=reach)
    if broken := asking.mistakes:
        raise FileError(broken)
    nodes = dict(paths(root))
    return found.motions, [f"{nodes[node]}: {why}" for node, why in found.unknown.items()]


def _check_refused(assembly: TreeCompiler, robot: Robot) -> None:
    if refused := refusals(assembly, robot):
        raise FileError(refusal.mistake for refusal in refused)


def _assembled(robot: Robot, library: Library, number: int) -> tuple[TreeCompiler, Behaviour]:
    assembly, draft = TreeCompiler(library, _context(robot)), library.draft(number)
    root = assembly.task(*draft, "/show", None)
    found = mistakes_of(assembly, draft, library, _context(robot))
    if found or assembly.asking.refused:
        raise FileError([*found, *(refusal.mistake for refusal in refusals(assembly, robot))])
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


@dataclass
class _Asked:
    """What a planner is to judge.

    Attributes:
        poses: Of files of poses, and where they are written.
        trees: Root of each tree, and what put it together.
        tasks: Those of them that are no subtrees.
    """

    poses: list[tuple[Place, Pose]] = field(default_factory=list)
    trees: list[tuple[Behaviour, TreeCompiler]] = field(default_factory=list)
    tasks: list[tuple[Behaviour, TreeCompiler]] = field(default_factory=list)


class _Checker:
    """Checks one file of a library.

    Args:
        library: The library.
        context: Of a robot that does nothing.
        asked: Filled with what a planner is to judge.
    """

    def __init__(self, library: Library, context: Context, asked: _Asked) -> None:
        self._library, self._context, self._asked = library, context, asked

    def check(self, path: Path, name: Named) -> list[Mistake]:
        """What is wrong with a file."""
        try:
            if isinstance(name, FileError):
                raise name
            if name is None:
                files, found = self._library.draft_poses()
                found = [mistake for mistake in found if mistake.place.path == path]
                return [*found, *self._reachable(next(f for f in files if f.path == path))]
            assembly = TreeCompiler(self._library, self._context)
            if isinstance(name, int):
                draft = self._library.draft(name)
                root = assembly.task(*draft, "/check", None)
                found = mistakes_of(assembly, draft, self._library, self._context)
            else:
                place = Place(self._library.subtree_path(name), 1, 1)
                file, known = self._library.subtree(name, place)
                root = assembly.subtree(file, Mistakes(known), "/check")
                found = assembly.mistakes.found
        except TreeError as error:
            return _mistakes(error)
        refusals(assembly, self._context.robot)  # told at the end, with those found by then
        self._asked.trees.append((root, assembly))
        if isinstance(name, int):
            self._asked.tasks.append((root, assembly))
        return found

    def _reachable(self, file: PosesFile) -> list[Mistake]:
        """Poses that the robot cannot take, whether or not a task names them."""
        robot, wrong = self._context.robot, []
        for name, joints in file.poses.items():
            place = file.labels[name].label
            known = Positions((j, q) for j, q in joints.items() if not isinstance(q, StandIn))
            try:
                check_joints(robot, known, "joints")
            except (SkillError, ExceptionGroup) as error:
                wrong += [Mistake(place, f"{name}: {why}") for why in known_errors(error)]
                continue
            leaders = ({joint.name for joint in robot.actuated_in(group)} for group in robot.groups)
            if len(known) < len(joints):
                continue
            if any(names <= joints.keys() for names in leaders):  # the others as after a reset
                pose = tuple(joints.get(joint.name, joint.boot) for joint in robot.actuated)
                self._asked.poses.append((place, pose))
        return wrong


def _mistakes(error: TreeError) -> list[Mistake]:
    if isinstance(error, FileError):
        return list(error.mistakes)
    path = getattr(error, "path", None)
    return [Mistake(Place(path, 1, 1) if path else Place(Path(), 0, 0), str(error))]


def _refused(asked: _Asked, context: Context, notes: list[Mistake]) -> Iterator[Mistake]:
    """What a planner says of every body by itself, and of every pose among the bodies there."""
    if not (asked.poses or asked.trees):
        return
    with closing(context.pool) as pool:
        pool.start()
        broken = set[Body]()
        for body, where in _bodies(asked).items():
            alone = World((replace(body, touches=frozenset()),))  # others may be there by then
            answer = _ask(pool, Verify([context.robot.boot_pose], 0.0, world=alone))
            if isinstance(answer, (BadWorld, WorkerDied)):
                broken.add(body)
                yield from (Mistake(place, f"{body.name}: {answer}") for place in where)
        poses, boot = _poses(asked, context), context.robot.boot_pose
        for (pose, world), told in poses.items():
            if broken.isdisjoint(world.bodies) and (hit := _hit(context, pose, world)):
                yield from (Mistake(place, f"{words}: {_told(hit)}") for place, words in told)
        for world, place in _unmoved(asked, context).items():
            new = (boot, world) not in poses and broken.isdisjoint(world.bodies)
            if new and (hit := _hit(context, boot, world)):
                why = "where a reset puts the arm, it collides before it moves here"
                notes.append(Mistake(place, f"{why}: {_told(hit)}"))


def _told(hit: MotionError) -> str:
    """In words: of a pose by itself, where a planner speaks of a motion."""
    return hit.contact if isinstance(hit, MotionCollides) else str(hit)


def _hit(context: Context, pose: Pose, world: World) -> MotionError | None:
    """What a pose collides with."""
    answer = _ask(context.pool, Verify([pose], context.robot.collision.margin, world=world))
    # What a body may touch may be there only where a subtree is used.
    return answer if isinstance(answer, MotionError) and not isinstance(answer, BadWorld) else None


def _bodies(asked: _Asked) -> dict[Body, list[Place]]:
    """What is added, and where that is written."""
    bodies: dict[Body, list[Place]] = {}
    for _, assembly in asked.trees:
        for leaf in assembly.leaves:
            if body := assembly.asking.body(leaf):
                bodies.setdefault(body, []).append(leaf.place)
    return bodies


def _poses(asked: _Asked, context: Context) -> dict[tuple[Pose, World], list[tuple[Place, str]]]:
    """Where the arm is among which bodies; where that is written, and what is wrong if it hits."""
    poses: dict[tuple[Pose, World], list[tuple[Place, str]]] = {}
    goal, start = "this pose collides", "before it moves here, the arm collides"
    for place, pose in asked.poses:
        poses.setdefault((pose, EMPTY), []).append((place, goal))
    carry = partial(_carried, context.pool)
    for root, built in asked.trees:
        leaves, asking = built.leaves, built.asking
        for motion in foresee(root, leaves, context.robot, carry, asking=asking).motions:
            if motion.start and (motion.start, motion.world) not in poses:
                poses[motion.start, motion.world] = [(motion.place, start)]
            poses.setdefault((motion.pose, motion.world), []).append((motion.place, goal))
    return poses


def _unmoved(asked: _Asked, context: Context) -> dict[World, Place]:
    """What is around the arm when a task first moves it, and where that is written."""
    worlds, boot = dict[World, Place](), context.robot.boot_pose
    carry = partial(_carried, context.pool)
    for root, built in asked.tasks:
        # What skills refuse of this pose alone is no mistake either.
        asking = Asking(built.asking.doubtful)
        found = foresee(root, built.leaves, context.robot, carry, boot, asking=asking)
        for motion in found.motions:
            if motion.start == boot:
                worlds.setdefault(motion.world, motion.place)
    return worlds


def _carried(pool: Pool, request: Carry) -> Body:
    answer = _ask(pool, request)
    if isinstance(answer, MotionError):
        raise answer
    assert isinstance(answer, Body)
    return answer


def _ask(pool: Pool, request: Verify | Carry) -> Result:
    answers: SimpleQueue[Result] = SimpleQueue()
    pool.submit(request, answers.put)
    return answers.get()


def _context(robot: Robot) -> Context:
    clock = RealClock()
    arm, pool = Arm(robot, None, clock), Pool(robot, 1, clock)
    return Context(robot, arm, pool, 1, 5.0, _ignore, _ignore, clock, _ignore)


def _ignore(*_: object) -> None:
    """Nothing runs here, so nobody is told."""
