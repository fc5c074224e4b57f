"""`armtree check`: finds the mistakes in task files without moving anything."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from queue import SimpleQueue

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

from .analysis.predicted_motion import Motion, predict_motions
from .analysis.reachability import check_outcomes
from .build import mistakes_of, refusals
from .compile.compiler import CompiledTree, TreeCompiler
from .compile.paths import paths
from .compile.skill_hooks import Pose, SkillHooks
from .errors import FileError, Mistake, Place, TreeError
from .reading.document import StandIn
from .reading.grammar import PosesFile
from .reading.library import Library

# What a file is in its library: the number of a task, the name of a subtree, None for poses, or
# the reason why it is none of these.
Named = int | str | None | FileError


@dataclass
class Findings:
    """The result of a check.

    Attributes:
        files: Files that were checked.
        mistakes: Mistakes, ordered by file and line.
        notes: Files that were ignored, and tasks whose first motion starts in collision if the arm
            is in its boot pose.
    """

    files: list[Path] = field(default_factory=list)
    mistakes: list[Mistake] = field(default_factory=list)
    notes: list[Mistake] = field(default_factory=list)


def check(robot: Robot, folder: Path | None, files: Sequence[Path] = ()) -> Findings:
    """Check task files, subtrees and poses.

    Args:
        robot: The robot.
        folder: Folder of the user's files; None for only those that ship.
        files: Files to check; empty for all.
    """
    context = _context(robot)
    findings = Findings()
    pending = _Pending()
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
        checker = _Checker(library, context, pending)
        findings.mistakes += checker.check(path, name)
    findings.mistakes += _refused(pending, context, findings.notes)
    findings.mistakes += [m for tree in pending.trees for m in tree.hooks.mistakes]
    findings.mistakes = list(FileError(findings.mistakes).mistakes)
    return findings


def compile_task(robot: Robot, library: Library, number: int) -> CompiledTree:
    """Compile a task, to show it.

    Args:
        robot: The robot.
        library: Files of the task.
        number: Number of the task.

    Raises:
        UnknownTask: No task has that number.
        FileError: The files have mistakes.
    """
    context = _context(robot)
    draft = library.draft(number)
    tree = TreeCompiler(library, context).task(*draft, "/show", None)
    found = mistakes_of(tree, draft, library, context)
    if found or tree.hooks.refused:
        raise FileError([*found, *(refusal.mistake for refusal in refusals(tree, robot))])
    return tree


def check_task(robot: Robot, library: Library, number: int) -> CompiledTree:
    """Check a task, as far as possible without a planner.

    Args:
        robot: The robot.
        library: Files of the task.
        number: Number of the task.

    Raises:
        UnknownTask: No task has that number.
        FileError: The files have mistakes, or a skill refuses an input.
    """
    tree = compile_task(robot, library, number)
    if refused := refusals(tree, robot):
        raise FileError(refusal.mistake for refusal in refused)
    return tree


def motions_of(
    robot: Robot,
    library: Library,
    number: int,
    carry: Callable[[Carry], Body],
    reach: Callable[[ToolQuery], Reached],
    start: Pose,
    world: World,
) -> tuple[list[Motion], list[str]]:
    """Predict the motions of a task.

    Args:
        robot: The robot.
        library: Files of the task.
        number: Number of the task.
        carry: Fixes a body to another link; may raise a MotionError.
        reach: Finds joint positions that bring the tool to a point; may raise a MotionError.
        start: Configuration before the task [rad].
        world: World before the task.

    Returns:
        The motions in order, each in the world at that time; and a description of each motion that
        is left out.

    Raises:
        UnknownTask: No task has that number.
        FileError: The files have mistakes, or a skill refuses an input.
    """
    tree = check_task(robot, library, number)
    found = predict_motions(tree, robot, carry, start, world, reach=reach)
    if broken := tree.hooks.mistakes:
        raise FileError(broken)
    nodes = dict(paths(tree.root))
    return found.motions, [f"{nodes[node]}: {why}" for node, why in found.unknown.items()]


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
        library = next(iter(libraries[parent].values()))[0]  # not empty, because poses ship
        if named := [m for m in library.mistakes if m.place.path.resolve() == file.resolve()]:
            yield file, library, FileError(named)
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
        with suppress(FileError):  # several files have it, which is a mistake of the library
            yield library.path(number), library, number


@dataclass
class _Pending:
    """What remains to be checked by a planner.

    Attributes:
        poses: Poses of files of poses, and their places.
        trees: Compiled tasks and subtrees.
        tasks: Compiled tasks.
    """

    poses: list[tuple[Place, Pose]] = field(default_factory=list)
    trees: list[CompiledTree] = field(default_factory=list)
    tasks: list[CompiledTree] = field(default_factory=list)


class _Checker:
    """Checks one file of a library.

    Args:
        library: The library.
        context: Context of an arm that does not move.
        pending: Receives what a planner must check.
    """

    def __init__(self, library: Library, context: Context, pending: _Pending) -> None:
        self._library, self._context, self._pending = library, context, pending

    def check(self, path: Path, name: Named) -> list[Mistake]:
        """Return the mistakes of a file that are found without a planner."""
        try:
            if isinstance(name, FileError):
                raise name
            if name is None:
                files, found = self._library.draft_poses()
                found = [mistake for mistake in found if mistake.place.path == path]
                return [*found, *self._poses(next(f for f in files if f.path == path))]
            compiler = TreeCompiler(self._library, self._context)
            if isinstance(name, int):
                draft = self._library.draft(name)
                tree = compiler.task(*draft, "/check", None)
                found = mistakes_of(tree, draft, self._library, self._context)
                self._pending.tasks.append(tree)
            else:
                place = Place(self._library.subtree_path(name), 1, 1)
                tree = compiler.subtree(*self._library.subtree(name, place), "/check")
                check_outcomes(tree)
                found = tree.mistakes.found
        except TreeError as error:
            return _mistakes(error)
        refusals(tree, self._context.robot)  # reported at the end, with those of other hooks
        self._pending.trees.append(tree)
        return found

    def _poses(self, file: PosesFile) -> list[Mistake]:
        """Return mistakes of poses, whether or not a task uses them."""
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
            if any(
                names <= joints.keys() for names in leaders
            ):  # other joints are at their boot positions
                pose = tuple(joints.get(joint.name, joint.boot) for joint in robot.actuated)
                self._pending.poses.append((place, pose))
        return wrong


def _mistakes(error: TreeError) -> list[Mistake]:
    if isinstance(error, FileError):
        return list(error.mistakes)
    path = getattr(error, "path", None)
    return [Mistake(Place(path, 1, 1) if path else Place(Path(), 0, 0), str(error))]


def _refused(pending: _Pending, context: Context, notes: list[Mistake]) -> Iterator[Mistake]:
    """Return what a planner reports of every body alone, and of every pose in its world."""
    if not (pending.poses or pending.trees):
        return
    with closing(context.pool) as pool:
        pool.start()
        broken = set[Body]()
        for body, where in _bodies(pending).items():
            alone = World(
                (replace(body, touches=frozenset()),)
            )  # without the bodies that it may touch
            answer = _ask(pool, Verify([context.robot.boot_pose], 0.0, world=alone))
            if isinstance(answer, (BadWorld, WorkerDied)):
                broken.add(body)
                yield from (Mistake(place, f"{body.name}: {answer}") for place in where)
        poses, boot = _poses(pending, context), context.robot.boot_pose
        for (pose, world), uses in poses.items():
            if broken.isdisjoint(world.bodies) and (hit := _hit(context, pose, world)):
                yield from (Mistake(place, f"{words}: {_words(hit)}") for place, words in uses)
        for world, place in _unmoved(pending, context).items():
            new = (boot, world) not in poses and broken.isdisjoint(world.bodies)
            if new and (hit := _hit(context, boot, world)):
                why = "in its boot pose the arm collides before it moves here"
                notes.append(Mistake(place, f"{why}: {_words(hit)}"))


def _words(hit: MotionError) -> str:
    """Describe a collision of a pose; the error describes one of a motion."""
    return hit.contact if isinstance(hit, MotionCollides) else str(hit)


def _hit(context: Context, pose: Pose, world: World) -> MotionError | None:
    """Return the collision of a pose, or None."""
    answer = _ask(context.pool, Verify([pose], context.robot.collision.margin, world=world))
    # A subtree may name bodies to touch that only its users add.
    return answer if isinstance(answer, MotionError) and not isinstance(answer, BadWorld) else None


def _bodies(pending: _Pending) -> dict[Body, list[Place]]:
    """Return all bodies that are added, and their places in the files."""
    bodies: dict[Body, list[Place]] = {}
    for tree in pending.trees:
        for leaf in tree.leaves.values():
            if body := tree.hooks.body(leaf):
                bodies.setdefault(body, []).append(leaf.place)
    return bodies


def _poses(
    pending: _Pending, context: Context
) -> dict[tuple[Pose, World], list[tuple[Place, str]]]:
    """Return all configurations and their worlds, with the places and messages of a collision."""
    poses: dict[tuple[Pose, World], list[tuple[Place, str]]] = {}
    goal, start = "this pose collides", "before it moves here, the arm collides"
    for place, pose in pending.poses:
        poses.setdefault((pose, EMPTY), []).append((place, goal))
    carry = partial(_carried, context.pool)
    for tree in pending.trees:
        for motion in predict_motions(tree, context.robot, carry).motions:
            if motion.start and (motion.start, motion.world) not in poses:
                poses[motion.start, motion.world] = [(motion.place, start)]
            poses.setdefault((motion.pose, motion.world), []).append((motion.place, goal))
    return poses


def _unmoved(pending: _Pending, context: Context) -> dict[World, Place]:
    """Return the worlds in which tasks first move the arm, and the places of these motions."""
    worlds, boot = dict[World, Place](), context.robot.boot_pose
    carry = partial(_carried, context.pool)
    for tree in pending.tasks:
        # Refusals that concern only this pose are not mistakes.
        hooks = SkillHooks(tree.hooks.doubtful)
        found = predict_motions(tree, context.robot, carry, boot, hooks=hooks)
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
    """Do nothing: no skill runs here."""
