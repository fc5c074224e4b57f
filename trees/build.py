"""Builds a tree from a task file. The tree is compiled, analysed, wired and ready to run."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status

from hardware import Robot
from hardware.loading.dataclass import dataclass
from skills import Context, Skill, SkillError, combine_errors

from .analysis.unreachable_nodes import check_outcomes
from .compile.arguments import FILE, as_text, name_of, wrong
from .compile.compiler import CompiledTree, TreeCompiler
from .compile.leaf import Leaf
from .compile.node_paths import paths
from .compile.skill_hooks import RefusedInput
from .export.resolved import RESOLVED, resolved
from .reading.document import Located
from .reading.grammar import Draft
from .reading.library import Library


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree that can run once.

    Attributes:
        root: Root of the tree.
        skills: All leaves of the tree, in the order of the file.
        files: Texts of its source files and of the resolved task, by file name.
        namespace: Namespace of its keys on the blackboard.
    """

    root: Behaviour
    skills: tuple[Skill, ...]
    files: Mapping[str, str]
    namespace: str

    def halt(self) -> None:
        """Halt all running leaves, independent of the states of the nodes above them."""
        for skill in self.skills:
            if skill.status is Status.RUNNING:
                skill.stop(Status.INVALID)

    def discard(self) -> None:
        """Remove the keys of the tree from the blackboard."""
        # Not `Client.unregister`: it fails if two ports of a skill have the same key.
        for key in [key for key in Blackboard.metadata if key.startswith(f"/{self.namespace}/")]:
            del Blackboard.metadata[key]
            Blackboard.storage.pop(key, None)
        for skill in self.skills:
            for client in skill.blackboards:
                del Blackboard.clients[client.id()]


def build(
    draft: Draft,
    library: Library,
    context: Context,
    namespace: str,
    arguments: Mapping[str, Located] | None = None,
    in_file: bool = True,
) -> Tree:
    """Build the tree of a task.

    Args:
        draft: The readable part of the task, and its mistakes.
        library: Library with the subtrees and poses.
        context: Context of its skills.
        namespace: Namespace of its keys on the blackboard; a different one for every run.
        arguments: Values of its parameters.
        in_file: True if the task is in a file of the user. Messages then name places in the file.

    Raises:
        FileError: The files have mistakes; the error has all of them.
        BadArguments: Only the arguments are wrong.
        SkillError: A skill refuses an input of the task, such as a target out of bounds.
    """
    given = arguments or {}
    tree = TreeCompiler(draft, library, context, f"/{namespace}").compile(given)
    refusals(tree, context.robot)
    check_outcomes(tree)
    refused = tree.hooks.refused  # also refusals of hooks that the analysis called
    if found := tree.mistakes.found:
        raise wrong([*found, *(refusal.mistake for refusal in refused)], given)
    files = {**({FILE: as_text(given)} if given else {}), **tree.files}
    if refused:
        raise _cause(refused, tree, files, in_file, given)
    for leaf in tree.leaves.values():
        _wire(leaf)
    skills = tuple(leaf.skill for leaf in tree.leaves.values())
    return Tree(tree.root, skills, {**files, RESOLVED: resolved(tree)}, namespace)


def refusals(tree: CompiledTree, robot: Robot) -> list[RefusedInput]:
    """Let the skills validate their inputs, and return the refusals.

    A skill that refuses an input is then in `tree.hooks.doubtful`.
    """
    for leaf in tree.leaves.values():
        tree.hooks.validate(leaf, robot)
    return tree.hooks.refused


def _cause(
    refused: Sequence[RefusedInput],
    tree: CompiledTree,
    files: Mapping[str, str],
    in_file: bool,
    arguments: Mapping[str, Located],
) -> Exception:
    """Combine refusals into one error with all messages. See `combine_errors`."""
    for refusal in refused if in_file else ():
        place = refusal.place
        at = f"{place.path.name}:{place.line}:{place.column}"
        refusal.error.args = (f"{refusal.error} ({at})",)
    cause = combine_errors([refusal.error for refusal in refused])
    (first,) = (refusal for refusal in refused if refusal.error is cause)
    if isinstance(cause, SkillError):
        cause.node = dict(paths(tree.root))[first.node]
        cause.place = ", used by ".join(_places(tree, first.node)) if in_file else ""
        cause.files = files
        cause.argument = name_of(first.value, arguments)
    return cause


def _places(tree: CompiledTree, node: Behaviour) -> Iterator[str]:
    """Yield file and line of a node, and of each use of a subtree around this node."""
    yield tree.places[node].file_line
    above: Behaviour | None = node
    while above:
        if call := tree.calls.get(above):
            yield call.file_line
        above = above.parent


def _wire(leaf: Leaf) -> None:
    """Connect the ports of a skill to the blackboard, and write its literal inputs."""
    skill, namespace = leaf.skill, leaf.namespace
    constants = {port: f"{namespace}/{skill.id}/{port}" for port in leaf.inputs}
    skill.setup_ports({**constants, **leaf.keys}, namespace)
    parameters = {port for port, value in leaf.written.items() if value.declared}
    skill.named_ports = frozenset(parameters | leaf.keys.keys())
    client = skill.attach_blackboard_client(namespace=namespace)
    for port, key in constants.items():
        client.register_key(key, access=Access.WRITE)
        value: Any = leaf.inputs[port]
        Blackboard.set(key, value)
