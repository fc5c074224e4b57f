"""From a task file to a tree of skills: names, ports and wiring checked, nothing ticked yet."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.blackboard import Blackboard
from py_trees.common import Access
from py_trees.composites import Composite, Sequence
from py_trees.ports import get_ports_registry
from py_trees.ports_utils import is_instance_of_type

from skills import Context, Positions, Skill
from trees import (
    CompositeNode,
    FileError,
    Key,
    Library,
    Located,
    Mistake,
    Place,
    SkillNode,
    SubtreeNode,
    TaskFile,
    TreeNode,
)

from .join import Join

Value = Located | Key


@dataclass(frozen=True)
class Tree:
    """A tree that can be run once.

    Attributes:
        root: Where to tick.
        skills: Its leaves, in the order of the file.
        files: The files it was built from, by name.
    """

    root: Behaviour
    skills: tuple[Skill, ...]
    files: Mapping[str, str]

    def discard(self) -> None:
        """Take its keys off the blackboard."""
        for skill in self.skills:
            for client in skill.blackboards:
                client.unregister(clear=True)


def build(task: TaskFile, library: Library, context: Context, namespace: str) -> Tree:
    """Build the tree of a task.

    Args:
        task: What to build.
        library: Where its subtrees are.
        context: What its skills work with.
        namespace: Where on the blackboard it keeps its keys; another for every run.

    Raises:
        FileError: With every mistake: unknown skills, ports, subtrees; wrong types; keys that
            nothing writes.
        SkillError: A skill refuses what the task spells out, such as a target out of bounds.
    """
    builder = _Builder(library, context)
    builder.files[task.path.name] = task.text
    root = builder.node(task.tree, _Scope(f"/{namespace}"), task.name)
    if builder.mistakes:
        raise FileError(builder.mistakes)
    for skill, inputs in builder.spelled_out:
        type(skill).judge(context.robot, inputs)
    return Tree(root, tuple(skill for skill, _ in builder.spelled_out), builder.files)


@dataclass(frozen=True)
class _Scope:
    """Names within one subtree.

    Attributes:
        namespace: Of its own keys.
        ports: What it was given.
        within: Names of the subtrees around it.
    """

    namespace: str
    ports: Mapping[str, Value] = field(default_factory=dict)
    within: tuple[str, ...] = ()


class _Builder:
    def __init__(self, library: Library, context: Context) -> None:
        self._library, self._context = library, context
        self._known = {
            name: kind for name, kind in get_ports_registry().items() if issubclass(kind, Skill)
        }
        self._written: set[str] = set()
        self.mistakes: list[Mistake] = []
        self.spelled_out: list[tuple[Skill, dict[str, Any]]] = []
        self.files: dict[str, str] = {}

    def node(self, spec: TreeNode, scope: _Scope, name: str = "") -> Behaviour:
        """The node of a spec, with all below it."""
        if isinstance(spec, SubtreeNode):
            return self._subtree(spec, scope, name)
        if isinstance(spec, CompositeNode):
            return self._composite(spec, scope, name)
        return self._skill(spec, scope)

    def _composite(self, spec: CompositeNode, scope: _Scope, name: str) -> Composite:
        children = [self.node(child, scope) for child in spec.children]
        if spec.kind == "parallel":
            return Join(name or "parallel", children)
        return Sequence(name or "sequence", memory=True, children=children)

    def _subtree(self, spec: SubtreeNode, scope: _Scope, name: str) -> Behaviour:
        if spec.name in scope.within:
            way = " -> ".join((*scope.within, spec.name))
            self._wrong(spec.place, f"subtree {spec.name} would hold itself: {way}")
            return Dummy(spec.name)
        try:
            file = self._library.subtree(spec.name, spec.place)
        except FileError as error:
            self.mistakes += error.mistakes
            return Dummy(spec.name)
        self.files[file.path.name] = file.text
        self._check_names(spec.values, file.ports, f"port of subtree {spec.name}")
        for port in file.ports:
            if port not in spec.values:
                self._wrong(spec.place, f"subtree {spec.name} needs {port}")
        inner = _Scope(
            f"{scope.namespace}/{spec.name}_{len(self.spelled_out)}",
            {port: self._resolve(value, scope) for port, value in spec.values.items()},
            (*scope.within, spec.name),
        )
        return self.node(file.tree, inner, name or spec.name)

    def _skill(self, spec: SkillNode, scope: _Scope) -> Behaviour:
        kind = self._known.get(spec.skill)
        if kind is None:
            there = _choices(spec.skill, list(self._known))
            self._wrong(spec.place, f"no skill {spec.skill}; there are {there}")
            return Dummy(spec.skill)
        skill: Skill = kind(spec.skill, self._context)
        ports = {**kind.input_ports(), **kind.output_ports()}
        self._check_names(spec.ports, tuple(ports), f"port of {spec.skill}")
        wired = {p: self._resolve(v, scope) for p, v in spec.ports.items() if p in ports}
        inputs = self._inputs(spec, skill, wired)
        if not any(mistake.place == spec.place for mistake in self.mistakes):
            self._wire(skill, scope, wired, inputs)
        self.spelled_out.append((skill, inputs))
        return skill

    def _resolve(self, value: Value, scope: _Scope) -> Value:
        """What a value means outside its subtree: a literal, or a key with its full name."""
        if isinstance(value, Located) or value.name.startswith("/"):
            return value
        given = scope.ports.get(value.name)
        return given or Key(value.place, f"{scope.namespace}/{value.name}")

    def _inputs(self, spec: SkillNode, skill: Skill, wired: Mapping[str, Value]) -> dict[str, Any]:
        """The literal inputs of a skill; checks all the others on the way."""
        inputs = {}
        for port, declared in skill.input_ports().items():
            value = wired.get(port)
            if value is None:
                if declared.required and not declared.has_default:
                    self._wrong(spec.place, f"{spec.skill} needs {port}: {declared.description}")
            elif isinstance(value, Key):
                if value.name not in self._written:
                    name = value.name.rpartition("/")[2]
                    self._wrong(value.place, f"nothing writes ${name} before {spec.skill} reads it")
            else:
                inputs[port] = self._fit(value, declared.data_type, f"{spec.skill}.{port}")
        for port in skill.output_ports():
            value = wired.get(port)
            if isinstance(value, Key):
                self._written.add(value.name)
            elif value is not None:
                self._wrong(value.place, f"{spec.skill} writes {port}; name a key such as ${port}")
        return inputs

    def _fit(self, value: Located, kind: Any, what: str) -> Any:
        plain = value.plain()
        fitted = _with_floats(plain, kind)
        if not is_instance_of_type(fitted, kind):
            self._wrong(value.place, f"{what}: {plain!r} is not {_KINDS.get(kind, kind.__name__)}")
        return fitted

    def _wire(
        self,
        skill: Skill,
        scope: _Scope,
        wired: Mapping[str, Value],
        inputs: Mapping[str, Any],
    ) -> None:
        constants = {port: f"{scope.namespace}/{skill.id}/{port}" for port in inputs}
        keys = {port: value.name for port, value in wired.items() if isinstance(value, Key)}
        skill.setup_ports({**constants, **keys}, scope.namespace)
        client = skill.attach_blackboard_client(namespace=scope.namespace)
        for port, key in constants.items():
            client.register_key(key, access=Access.WRITE)
            Blackboard.set(key, inputs[port])

    def _check_names(self, given: Mapping[str, Value], known: tuple[str, ...], what: str) -> None:
        for port, value in given.items():
            if port not in known:
                there = _choices(port, list(known))
                self._wrong(value.place, f"{port} is no {what}; there are {there}")

    def _wrong(self, place: Place, message: str) -> None:
        self.mistakes.append(Mistake(place, message))


def _with_floats(plain: Any, kind: Any) -> Any:
    """The value with whole numbers as floats and mappings as positions, where those are wanted."""
    if kind is float and type(plain) is int:
        return float(plain)
    if kind is Positions and isinstance(plain, dict):
        fitted = {name: _with_floats(q, float) for name, q in plain.items()}
        if all(isinstance(q, float) for q in fitted.values()):
            return Positions(fitted)
    return plain


_KINDS = {
    Positions: "a mapping from joint names to numbers",
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
}


def _choices(word: str, known: list[str]) -> str:
    near = get_close_matches(word, known, n=1)
    return (", ".join(sorted(known)) or "none") + (f"; did you mean {near[0]}?" if near else "")
