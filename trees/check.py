"""`armtree check`: finds the mistakes in task files without moving anything."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from hardware import Arm, RealClock, Robot
from hardware.description.neighbours import shape_warnings
from hardware.spelling import closest, did_you_mean, suggested
from skills import BadTarget, Context, Positions, Skill, SkillError, WorldChange, joint_errors
from skills.motion import EMPTY, Pool, World

from .analysis.collisions import CollisionChecks
from .analysis.unreachable_nodes import check_outcomes
from .build import refusals
from .compile.arguments import name_of, wrong
from .compile.compiler import CompiledTree, TreeCompiler
from .compile.data_flow import short_name
from .compile.move_words import wrong_units
from .compile.port_types import declarations, known_skills
from .compile.skill_hooks import RefusedInput
from .compile.sources import with_joints
from .declarations import Declaration
from .errors import FileError, Mistake, Place, TreeError
from .reading.document import Located, StandIn, nested
from .reading.grammar import PosesFile
from .reading.library import AS_TEXT, Library, with_robot
from .reading.lines import added_above, block
from .reading.literals import in_other_unit, in_radians, in_smaller_units, near_limit

# Role of a file in its library: the number of a task, the name of a subtree, None for poses, or the
# error of a file without a role.
Named = int | str | None | FileError


@dataclass
class Findings:
    """The result of a check.

    Attributes:
        files: Files that were checked.
        mistakes: Mistakes, ordered by file and line.
        notes: Warnings, ordered like the mistakes, such as ignored files; files that may be for
            another robot; keys that no node reads; long times without a unit; first motions that
            start in collision; points out of reach; timeouts shorter than their motions. The last
            three assume that the arm is in its start pose.
        shipped: Number of shipped files in `files`.
    """

    files: list[Path] = field(default_factory=list)
    mistakes: list[Mistake] = field(default_factory=list)
    notes: list[Mistake] = field(default_factory=list)
    shipped: int = 0


def check(
    robot: Robot, folder: Path | None, files: Sequence[Path] = (), world: World = EMPTY
) -> Findings:
    """Check task files, subtrees and poses.

    Args:
        robot: The robot.
        folder: Folder of the user's files; None for only the shipped ones.
        files: Files to check, and folders of files to check; empty for all files.
        world: Bodies around the arm before each task.
    """
    files = [path for file in files for path in _files(file, robot.name)]
    context = _context(robot)
    findings = Findings()
    collisions = CollisionChecks(robot, context.pool, world)
    try:
        jobs = list(_jobs(robot.name, folder, files))
    except TreeError as error:
        findings.mistakes = _mistakes(error)
        return findings
    libraries = {id(library): library for _, library, _ in jobs}.values()
    named = {_real(path) for path in files}
    for library in libraries:
        findings.mistakes += [
            m for m in library.mistakes if not files or _real(m.place.path) in named
        ]
        findings.notes += [] if files else library.notes
    for path, library, name in jobs:
        findings.files.append(path)
        findings.shipped += path.parent in library.shipped
        checker = _Checker(library, context, collisions)
        findings.mistakes += checker.check(path, name)
    findings.mistakes += collisions.mistakes()
    findings.mistakes += [m for tree in collisions.trees for m in tree.hooks.mistakes]
    findings.mistakes += [
        _absent(place, *absent, collisions.trees)
        for place, absent in collisions.absent.items()
        if not any(_names_body(library, absent[0], place.path) for library in libraries)
    ]
    findings.notes += collisions.notes
    findings.notes += [
        Mistake(key.place, f"nothing reads ${short_name(key)}; let a node read it, or leave it out")
        for tree in collisions.trees
        for key in (() if tree.mistakes.found else tree.unread)
    ]
    findings.notes += [note for tree in collisions.trees for note in tree.mistakes.notes]
    findings.notes += [Mistake(Place(robot.urdf), why) for why in shape_warnings(robot)]
    for library in libraries:
        findings.notes += _for_other_robots(robot, library, collisions.trees)
    findings.notes = list(FileError(findings.notes).mistakes)
    findings.mistakes = list(FileError(findings.mistakes).mistakes)
    return findings


def _for_other_robots(
    robot: Robot, library: Library, trees: Sequence[CompiledTree]
) -> Iterator[Mistake]:
    """Yield a note for each file directly in the user's folder that names unknown joints."""
    known, strange = {*robot.groups, *(j.name for j in robot.joints)}, dict[Path, set[str]]()
    for refusal in (refusal for tree in trees for refusal in tree.hooks.refused):
        within = refusal.error.location[1:] if isinstance(refusal.error, BadTarget) else ()
        if within and not any(closest(str(within[-1]), [each]) for each in known):
            strange.setdefault(refusal.place.path, set()).add(str(within[-1]))
    for path, names in strange.items():
        if library.folder and path.parent == library.folder:
            why = f"names joints that the {robot.name} lacks: {', '.join(sorted(names))}. If this "
            why += f"file is for another robot, move it to the subfolder of {path.parent} with "
            yield Mistake(Place(path), why + "the name of that robot")


def _absent(
    place: Place, name: str, near: str, node: Place, trees: Sequence[CompiledTree]
) -> Mistake:
    """Return the mistake of a node that uses a body that no earlier node adds."""
    why = f"no node before this one adds the body {name}"
    for tree in trees:
        for leaf in tree.leaves.values():
            body = tree.hooks.body(leaf)
            later = leaf.place.path == place.path and leaf.place.line > place.line
            if body and body.name == name and later and (lines := block(leaf.place)):
                why += f", but line {leaf.place.line} adds it later: move that node up"
                return Mistake(place, why, added_above(node, "\n".join(lines)))
    right = place.replaced(name, near) or added_above(node, _adding(name))
    return Mistake(place, why + (did_you_mean(near) or _how_to_add(name)), right)


def _how_to_add(name: str) -> str:
    """Return advice for a missing body: a node that adds it, and other skills that can add it."""
    _, *others = _adding_skills()
    more = f"; or with {', '.join(others)}" if others else ""
    return f": add it above, such as with {_adding(name)}, with the numbers of your body{more}"


def _adding(name: str) -> str:
    """Return the text of a node that adds a body, with example numbers."""
    first, kind = next(iter(_adding_skills().items()))
    ports = {port: _example(each) for port, each in declarations(kind).items() if each.needed}
    written = ", ".join(f"{port}: {value}" for port, value in (ports | {"body": name}).items())
    return f"{first}: {{{written}}}"


def _adding_skills() -> dict[str, type[Skill]]:
    """Return the skills that add a body, by name."""
    return {n: kind for n, kind in known_skills().items() if kind.world_change is WorldChange.ADDS}


def _example(declared: Declaration) -> str:
    """Return an example value. Among lists of three lengths, only a size has a least value."""
    if declared.type != "list of length":
        return "…"
    return "[12 cm, 10 cm, 2 cm]" if declared.least is None else "[4 cm, 4 cm, 4 cm]"


def _names_body(library: Library, name: str, but: Path) -> bool:
    """Return True if a file other than `but` names a body. Bodies stay between tasks."""
    body = re.compile(rf"\bbody['\"]?\s*:\s*['\"]?{re.escape(name)}\b")
    for path, _ in library.files():
        with suppress(FileError):
            if path != but and body.search(library.read(path)):
                return True
    return False


def compile_task(
    robot: Robot,
    library: Library,
    number: int,
    arguments: Mapping[str, Located] | None = None,
    validated: bool = False,
) -> CompiledTree:
    """Compile a task, without a planner.

    Args:
        robot: The robot.
        library: Library with the file of the task.
        number: Number of the task.
        arguments: Values of its parameters; None if they are unknown.
        validated: True to let its skills validate their inputs, too.

    Raises:
        UnknownTask: No task has that number.
        BadArguments: Only the arguments are wrong.
        FileError: The files have mistakes, or a skill refuses an input.
    """
    context = _context(robot)
    tree = TreeCompiler(library.draft(number), library, context, "/show").compile(arguments)
    check_outcomes(tree)
    if tree.mistakes.found or tree.hooks.refused:
        mistakes = [refusal.mistake for refusal in refusals(tree, robot)]
        raise wrong([*tree.mistakes.found, *mistakes], arguments or {})
    if validated and (refused := refusals(tree, robot)):
        given = arguments or {}
        raise wrong([_mistake(each, given) for each in refused], given)
    return tree


def _files(file: Path, robot: str) -> Sequence[Path]:
    """Return the files in a folder for a robot. If there are none, return the path itself."""
    folders = with_robot(file, robot) if file.is_dir() else ()
    return [path for folder in folders for path in sorted(folder.glob("*.yaml"))] or [file]


def _mistake(refusal: RefusedInput, arguments: Mapping[str, Located]) -> Mistake:
    """Return a refusal as a mistake of the argument that has the value, or else of a file."""
    name, value = name_of(refusal.value, arguments), refusal.value
    return Mistake(value.place, f"{name}: {refusal.error}") if name and value else refusal.mistake


def _real(path: Path) -> Path:
    """Return a path without symbolic links. `Path.resolve` raises an error at a loop of links."""
    return Path(os.path.realpath(path))


def _jobs(
    robot: str, folder: Path | None, files: Sequence[Path]
) -> Iterator[tuple[Path, Library, Named]]:
    if not files:
        library = Library(folder, robot)
        yield from ((path, library, name) for path, name in library.files())
        return
    libraries: dict[Path, dict[Path, tuple[Library, Named]]] = {}
    for file in files:
        real = _real(file)
        own = real.parent.name == robot
        parent = real.parent.parent if own else real.parent
        if parent not in libraries:
            folder = file.parent.parent if own else file.parent
            library = Library(folder, robot)
            libraries[parent] = {_real(path): (library, name) for path, name in library.files()}
        library = next(iter(libraries[parent].values()))[0]  # some subtrees are shipped
        named = [m for m in library.mistakes if _real(m.place.path) == real]
        if real in libraries[parent]:
            yield file, *libraries[parent][real]
        elif named:
            yield file, library, FileError(named)
        else:
            wrong = "does not exist; give a file, such as trees/3_wave.yaml"
            if file.exists():
                wrong = "is not read: name a task like 3_wave.yaml, and a subtree like reach.yaml"
            if saved := AS_TEXT.fullmatch(file.name):
                wrong = f"is not read, because its name ends in .txt; rename it to {saved[1]}"
            if file.is_dir():
                wrong = "is a folder without task files"
            yield file, library, FileError([Mistake(Place(file, 1, 1), wrong)])


class _Checker:
    """Checks one file of a library.

    Args:
        library: The library.
        context: Context of an arm that does not move.
        collisions: Receives the bodies and configurations that a planner must check.
    """

    def __init__(self, library: Library, context: Context, collisions: CollisionChecks) -> None:
        self._library, self._context, self._collisions = library, context, collisions

    def check(self, path: Path, name: Named) -> list[Mistake]:
        """Return the mistakes of a file that are found without a planner."""
        try:
            if isinstance(name, FileError):
                raise name
            if name is None:
                files, found = self._library.draft_poses()
                found = with_joints(found, files, self._context.robot)
                found = [mistake for mistake in found if mistake.place.path == path]
                file = next(f for f in files if f.path == path)
                return [*found, *self._poses(file)]
            draft, context = self._library.draft(name, path), self._context
            tree = TreeCompiler(draft, self._library, context, "/check").compile()
        except TreeError as error:
            return _mistakes(error)
        check_outcomes(tree)
        refusals(tree, self._context.robot)  # reported at the end, with refusals of other hooks
        self._collisions.trees.append(tree)
        if isinstance(name, int):
            self._collisions.tasks.append(tree)
        return tree.mistakes.found

    def _poses(self, file: PosesFile) -> list[Mistake]:
        """Return the mistakes of all poses in a file, used or unused."""
        robot, wrong = self._context.robot, []
        for name, joints in file.poses.items():
            place = file.labels[name].label
            known = Positions((j, q) for j, q in joints.items() if not isinstance(q, StandIn))
            label = file.labels[name]
            if wrong_units(label, robot, _ignore):
                continue  # the compiler reports these for every tree
            if errors := joint_errors(robot, known):
                wrong += [self._refused(label, known, why) for why in errors]
                continue
            leaders = ({joint.name for joint in robot.actuated_in(group)} for group in robot.groups)
            if len(known) < len(joints):
                continue
            if any(names <= joints.keys() for names in leaders):
                # Other joints are at their boot positions.
                pose = tuple(joints.get(joint.name, joint.boot) for joint in robot.actuated)
                self._collisions.poses.append((place, pose))
        return wrong

    def _refused(self, pose: Located, known: Positions, error: SkillError) -> Mistake:
        """Return the mistake of a refused pose, at its joint. Suggests a likely unit or value."""
        location, robot = error.location, self._context.robot
        joint = str(location[-1]) if location else ""
        item = nested(pose).get(joint)
        name = pose.label.location.rpartition(".")[2]
        if not item:
            return Mistake(pose.label, f"{name}: {error}")
        if joint not in {each.name for each in robot.joints}:
            right = item.label.replaced(joint, suggested(str(error)))
            return Mistake(item.label, f"{name}: {error}", right)
        unit = robot.joint(joint).unit
        for text, factor in in_smaller_units(item.value, unit):
            if not joint_errors(robot, Positions({joint: known[joint] * factor})):
                instead = item.instead(text)
                words = in_other_unit(f"{name}: {error}", item, unit, text)
                return Mistake(item.label, words, instead)
        words, limit = f"{name}: {error}", getattr(error, "limit", None)
        for text, q in () if limit is None else near_limit(item, limit, unit):
            if not joint_errors(robot, Positions({joint: q})):
                words = in_radians(words, item, unit, q, text)
                return Mistake(item.label, words, item.instead(text))
        return Mistake(item.label, words)


def _mistakes(error: TreeError) -> list[Mistake]:
    if isinstance(error, FileError):
        return list(error.mistakes)
    path = getattr(error, "path", None)
    return [Mistake(Place(path, 1, 1) if path else Place(Path()), str(error))]


def _context(robot: Robot) -> Context:
    clock = RealClock()
    arm, pool = Arm(robot, None, clock), Pool(robot, 1, clock)
    return Context(robot, arm, pool, 1, 5.0, _ignore, _ignore, clock, _ignore)


def _ignore(*_: object) -> None:
    """Do nothing: no skill runs here."""
