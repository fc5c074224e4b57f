"""From a task file to a tree of skills: names, ports and wiring checked, nothing ticked yet."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, get_args, get_origin

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status
from py_trees.composites import Composite, Sequence
from py_trees.ports import get_ports_registry
from py_trees.ports_utils import is_instance_of_type

from skills import Context, Positions, Skill
from trees import (
    COMPOSITES,
    CompositeNode,
    FileError,
    Key,
    Library,
    Located,
    Mistake,
    Place,
    SkillNode,
    SubtreeFile,
    SubtreeNode,
    TaskFile,
    TreeNode,
    choices,
)

from .join import Join

Value = Located | Key

MAX_NODES = 10_000
MAX_SUBTREES = 8  # within each other


@dataclass(frozen=True)
class Tree:
    """A tree that can be run once.

    Attributes:
        root: Where to tick.
        skills: Its leaves, in the order of the file.
        files: The files it was built from, by name.
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
    for leaf in builder.leaves:
        type(leaf.skill).judge(context.robot, leaf.inputs)
    for leaf in builder.leaves:
        leaf.wire()
    return Tree(root, tuple(leaf.skill for leaf in builder.leaves), builder.files, namespace)


@dataclass(frozen=True)
class _Leaf:
    """A skill and what its ports are wired to.

    Attributes:
        skill: Which.
        namespace: Of its keys.
        keys: Full names of keys, by port.
        inputs: Values that are spelled out, by port.
    """

    skill: Skill
    namespace: str
    keys: Mapping[str, str]
    inputs: Mapping[str, Any]

    def wire(self) -> None:
        """Put it on the blackboard."""
        constants = {port: f"{self.namespace}/{self.skill.id}/{port}" for port in self.inputs}
        self.skill.setup_ports({**constants, **self.keys}, self.namespace)
        client = self.skill.attach_blackboard_client(namespace=self.namespace)
        for port, key in constants.items():
            client.register_key(key, access=Access.WRITE)
            Blackboard.set(key, self.inputs[port])


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
        self._written: dict[str, Any] = {}  # the type of every key that is written so far
        self._read: dict[str, SubtreeFile | None] = {}
        self._nodes = 0
        self.mistakes: list[Mistake] = []
        self.leaves: list[_Leaf] = []
        self.files: dict[str, str] = {}

    def node(self, spec: TreeNode, scope: _Scope, name: str = "") -> Behaviour:
        """The node of a spec, with all below it."""
        self._nodes += 1
        if self._nodes > MAX_NODES:
            if self._nodes == MAX_NODES + 1:
                self._wrong(spec.place, f"the tree has more than {MAX_NODES} nodes")
            return Dummy("too many")
        if isinstance(spec, SubtreeNode):
            return self._subtree(spec, scope, name)
        if isinstance(spec, CompositeNode):
            return self._composite(spec, scope, name)
        return self._skill(spec, scope)

    def _composite(self, spec: CompositeNode, scope: _Scope, name: str) -> Composite:
        if spec.kind == "parallel":
            children = self._side_by_side(spec, scope)
            if sum(map(_moves, children)) > 1:
                self._wrong(spec.place, "only one node of a parallel may move the arm")
            return Join(name or "parallel", children)
        children = [self.node(child, scope) for child in spec.children]
        return Sequence(name or "sequence", memory=True, children=children)

    def _side_by_side(self, spec: CompositeNode, scope: _Scope) -> list[Behaviour]:
        """Children that run at once: none may read what another writes."""
        before, children = self._written, []
        after = dict(before)
        for child in spec.children:
            self._written = dict(before)
            children.append(self.node(child, scope))
            after |= self._written
        self._written = after
        return children

    def _subtree(self, spec: SubtreeNode, scope: _Scope, name: str) -> Behaviour:
        way = (*scope.within, spec.name)
        if spec.name in scope.within:
            self._wrong(spec.place, f"subtree {spec.name} would hold itself: {' -> '.join(way)}")
        elif len(way) > MAX_SUBTREES:
            self._wrong(spec.place, f"more than {MAX_SUBTREES} subtrees within each other")
        elif (file := self._file(spec)) and self._has_ports(spec, file):
            ports = {port: self._resolve(value, scope) for port, value in spec.values.items()}
            inner = _Scope(f"{scope.namespace}/{spec.name}_{self._nodes}", ports, way)
            return self.node(file.tree, inner, name or spec.name)
        return Dummy(spec.name)

    def _file(self, spec: SubtreeNode) -> SubtreeFile | None:
        """The file of a subtree, read once."""
        if spec.name not in self._read:
            self._read[spec.name] = None
            try:
                file = self._library.subtree(spec.name, spec.place)
            except FileError as error:
                self.mistakes += error.mistakes
            else:
                self._read[spec.name] = file
                self.files[file.path.name] = file.text
        return self._read[spec.name]

    def _has_ports(self, spec: SubtreeNode, file: SubtreeFile) -> bool:
        missing = [port for port in file.ports if port not in spec.values]
        for port in missing:
            self._wrong(spec.place, f"subtree {spec.name} needs {port}")
        known = self._check_names(spec.values, file.ports, f"port of subtree {spec.name}")
        return known and not missing

    def _skill(self, spec: SkillNode, scope: _Scope) -> Behaviour:
        kind = self._known.get(spec.skill)
        if kind is None:
            there = choices(spec.skill, (*self._known, *COMPOSITES, "subtree"))
            self._wrong(spec.place, f"no skill {spec.skill}; there are {there}")
            return Dummy(spec.skill)
        ports = {**kind.input_ports(), **kind.output_ports()}
        self._check_names(spec.ports, ports, f"port of {spec.skill}")
        wired = {p: self._resolve(v, scope) for p, v in spec.ports.items() if p in ports}
        keys = {port: value.name for port, value in wired.items() if isinstance(value, Key)}
        skill: Skill = kind(spec.skill, self._context)
        inputs = self._inputs(spec, kind, wired)
        self._outputs(spec, kind, wired)
        self.leaves.append(_Leaf(skill, scope.namespace, keys, inputs))
        return skill

    def _resolve(self, value: Value, scope: _Scope) -> Value:
        """What a value means outside its subtree: a literal, or a key with its full name."""
        if isinstance(value, Located):
            return value
        given = scope.ports.get(value.name)
        return given or Key(value.place, f"{scope.namespace}/{value.name}", value.label)

    def _inputs(
        self, spec: SkillNode, kind: type[Skill], wired: Mapping[str, Value]
    ) -> dict[str, Any]:
        """The literal inputs of a skill; checks all the others on the way."""
        inputs = {}
        for port, declared in kind.input_ports().items():
            value, what = wired.get(port), f"{spec.skill}.{port}"
            if isinstance(value, Key):
                self._check_key(value, declared.data_type, what)
            elif value is not None:
                inputs[port] = self._fit(value, declared.data_type, what)
            elif declared.required and not declared.has_default:
                self._wrong(spec.place, f"{spec.skill} needs {port}: {declared.description}")
        return inputs

    def _outputs(self, spec: SkillNode, kind: type[Skill], wired: Mapping[str, Value]) -> None:
        for port, declared in kind.output_ports().items():
            value = wired.get(port)
            if isinstance(value, Key):
                self._written[value.name] = declared.data_type
            elif value is not None:
                self._wrong(value.place, f"{spec.skill} writes {port}; name a key such as ${port}")

    def _check_key(self, key: Key, wanted: Any, what: str) -> None:
        name = key.name.rpartition("/")[2]
        if key.name not in self._written:
            self._wrong(key.place, f"nothing has written ${name} when {what} reads it")
        elif self._written[key.name] != wanted:
            written = self._written[key.name]
            self._wrong(key.place, f"{what}: ${name} is {_kind(written)}, not {_kind(wanted)}")

    def _fit(self, value: Located, kind: Any, what: str) -> Any:
        plain = value.plain()
        fitted = _with_floats(plain, kind)
        truth = isinstance(plain, bool) and kind is not bool  # which Python counts as a number
        if truth or not is_instance_of_type(fitted, kind):
            self._wrong(value.place, f"{what}: {value} is not {_kind(kind)}")
        return fitted

    def _check_names(self, given: Mapping[str, Value], known: Collection[str], what: str) -> bool:
        unknown = [port for port in given if port not in known]
        for port in unknown:
            self._wrong(given[port].label, f"{port} is no {what}; there are {choices(port, known)}")
        return not unknown

    def _wrong(self, place: Place, message: str) -> None:
        self.mistakes.append(Mistake(place, message))


def _moves(node: Behaviour) -> bool:
    return any(isinstance(below, Skill) and below.moves for below in node.iterate())


def _with_floats(plain: Any, kind: Any) -> Any:
    """The value with whole numbers as floats and mappings as positions, where those are wanted."""
    if kind is float and type(plain) is int:
        return float(plain)
    if kind is Positions and isinstance(plain, dict):
        fitted = {name: _with_floats(q, float) for name, q in plain.items()}
        if all(isinstance(q, float) for q in fitted.values()):
            return Positions(fitted)
    if get_origin(kind) is list and isinstance(plain, list):
        return [_with_floats(each, get_args(kind)[0]) for each in plain]
    return plain


_KINDS = {
    Positions: "a mapping from joint names to numbers",
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a text",
    list[float]: "a list of numbers",
    list[str]: "a list of texts",
    list[Positions]: "a list of mappings from joint names to numbers",
}


def _kind(kind: Any) -> str:
    return _KINDS.get(kind) or f"a {getattr(kind, '__name__', kind)}"
