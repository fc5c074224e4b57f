"""From a task file to a tree of skills: names, ports and wiring checked, nothing ticked yet."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status

from hardware import Robot
from skills import Context, Skill, SkillError
from skills.motion import MotionError
from trees import FileError, Library, Located, Mistake, Place, TaskFile

from .arguments import FILE, as_text
from .assembly import Assembly, Leaf
from .resolved import RESOLVED, resolved


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
        SkillError: A skill refuses what the task spells out, such as a target out of bounds.
    """
    assembly = Assembly(library, context)
    if arguments:
        assembly.files[FILE] = as_text(arguments)
    root = assembly.task(*draft, f"/{namespace}", arguments or {})
    if assembly.mistakes.found:
        raise FileError(assembly.mistakes.found)
    for leaf in assembly.leaves:
        type(leaf.skill).judge(context.robot, leaf.inputs)
    for leaf in assembly.leaves:
        _wire(leaf)
    assembly.files[RESOLVED] = resolved(root, assembly, f"/{namespace}")
    skills = tuple(leaf.skill for leaf in assembly.leaves)
    return Tree(root, skills, assembly.files, namespace)


def refusals(leaves: list[Leaf], robot: Robot) -> list[Mistake]:
    """What skills refuse of what a task spells out, each at its place."""
    refused = []
    for leaf in leaves:
        try:
            type(leaf.skill).judge(robot, leaf.inputs)
        except (SkillError, MotionError) as error:
            refused.append(Mistake(leaf.place, f"{leaf.skill.name}: {error}"))
    return refused


def poses(leaves: list[Leaf], robot: Robot) -> list[tuple[Place, tuple[float, ...]]]:
    """Where a task spells out that the arm goes: values of the actuated joints [rad]."""
    return [
        (leaf.place, pose) for leaf in leaves for pose in type(leaf.skill).poses(robot, leaf.inputs)
    ]


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
