"""From a task file to a tree of skills: names, ports and wiring checked, nothing ticked yet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status

from hardware import Robot
from skills import Context, Positions, Skill, SkillError, combine_errors
from trees.errors import Mistake, Place
from trees.reading.document import Located
from trees.reading.grammar import TaskFile
from trees.reading.library import Library

from .arguments import FILE, as_text, wrong
from .assembly import TreeCompiler
from .leaf import Leaf
from .paths import paths
from .resolved import RESOLVED, resolved
from .skill_hooks import Refusal


@dataclass(frozen=True)
class Tree:
    """A tree that can be run once.

    Attributes:
        root: Where to tick.
        skills: Its leaves, in the order of the file.
        files: The files it was built from, and itself as one file, by name.
        namespace: Under which its keys are on the blackboard.
    """

    root: Behaviour
    skills: tuple[Skill, ...]
    files: Mapping[str, str]
    namespace: str

    def halt(self) -> None:
        """Halt the leaves that run, whatever state the nodes above them are in."""
        for skill in self.skills:
            if skill.status is Status.RUNNING:
                skill.stop(Status.INVALID)

    def discard(self) -> None:
        """Take its keys off the blackboard."""
        # Not `Client.unregister`: it fails where two ports of a skill are wired to one key.
        for key in [key for key in Blackboard.metadata if key.startswith(f"/{self.namespace}/")]:
            del Blackboard.metadata[key]
            Blackboard.storage.pop(key, None)
        for skill in self.skills:
            for client in skill.blackboards:
                del Blackboard.clients[client.id()]


def build(
    draft: tuple[TaskFile, list[Mistake]],
    library: Library,
    context: Context,
    namespace: str,
    arguments: Mapping[str, Located] | None = None,
) -> Tree:
    """Build the tree of a task.

    Args:
        draft: The task as far as it could be read, and what is wrong with it.
        library: Where its subtrees are.
        context: What its skills work with.
        namespace: Where on the blackboard it keeps its keys; another for every run.
        arguments: Values of its parameters.

    Raises:
        FileError: With every mistake: unknown skills, ports, subtrees; wrong types; keys that
            nothing writes.
        BadArguments: Only the arguments are wrong.
        SkillError: A skill refuses what the task spells out, such as a target out of bounds.
    """
    assembly = TreeCompiler(library, context)
    if arguments:
        assembly.files[FILE] = as_text(arguments)
    root = assembly.task(*draft, f"/{namespace}", arguments or {})
    refused = refusals(assembly, context.robot)
    if found := mistakes_of(assembly, draft, library, context):
        raise wrong([*found, *(refusal.mistake for refusal in refused)], arguments or {})
    if refused:
        raise _cause(refused, dict(paths(root)))
    for leaf in assembly.leaves:
        _wire(leaf)
    assembly.files[RESOLVED] = resolved(root, assembly, f"/{namespace}")
    skills = tuple(leaf.skill for leaf in assembly.leaves)
    return Tree(root, skills, assembly.files, namespace)


def mistakes_of(
    assembly: TreeCompiler,
    draft: tuple[TaskFile, list[Mistake]],
    library: Library,
    context: Context,
) -> list[Mistake]:
    """What is wrong with a task that was put together, or would be without its defaults."""
    hidden = _hidden(draft, library, context)
    mistyped = {
        declared.default.place: f"the default of {name}: "
        for name, declared in draft[0].parameters.items()
        if isinstance(declared.default, Located)
        and any(f"${name} is " in mistake.message for mistake in hidden)
    }
    # That a default fits no use of a mistyped parameter is told there, of every value.
    told = (m for m in assembly.mistakes.found if m.message.startswith(mistyped.get(m.place, "")))
    return [*told, *hidden]


def _hidden(
    draft: tuple[TaskFile, list[Mistake]], library: Library, context: Context
) -> list[Mistake]:
    """What is wrong with a task whatever its parameters are, and only their defaults hide."""
    task, known = draft
    if all(declared.needed for declared in task.parameters.values()):
        return []
    bare = {name: replace(each, default=None) for name, each in task.parameters.items()}
    assembly = TreeCompiler(library, context)
    assembly.task(replace(task, parameters=bare), known, "/hidden", None)
    return assembly.mistakes.found


def refusals(assembly: TreeCompiler, robot: Robot) -> list[Refusal]:
    """What skills refuse of what a task spells out; they count as doubtful from now on."""
    for leaf in assembly.leaves:
        assembly.asking.judge(leaf, robot)
    return assembly.asking.refused


def _cause(refused: Sequence[Refusal], nodes: Mapping[Behaviour, str]) -> Exception:
    """What is refused as one error: where the first of it stands, with the words of all."""
    for refusal in refused:
        place = refusal.place
        at = f"{place.path.name}:{place.line}:{place.column}"
        refusal.error.args = (f"{refusal.error} ({at})",)
    cause = combine_errors([refusal.error for refusal in refused])
    (first,) = (refusal for refusal in refused if refusal.error is cause)
    if isinstance(cause, SkillError):
        cause.node = nodes[first.node]
    return cause


def target_of(leaf: Leaf) -> Place:
    """Where the first of the joint positions of a skill is written."""
    targets = (
        value.place
        for port, value in leaf.written.items()
        if isinstance(leaf.inputs[port], Positions)
    )
    return next(targets, leaf.place)


def _wire(leaf: Leaf) -> None:
    """Put a skill on the blackboard."""
    skill, namespace = leaf.skill, leaf.namespace
    constants = {port: f"{namespace}/{skill.id}/{port}" for port in leaf.inputs}
    skill.setup_ports({**constants, **leaf.keys}, namespace)
    client = skill.attach_blackboard_client(namespace=namespace)
    for port, key in constants.items():
        client.register_key(key, access=Access.WRITE)
        value: Any = leaf.inputs[port]
        Blackboard.set(key, value)
