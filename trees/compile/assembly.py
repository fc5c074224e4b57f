"""Putting a tree together from its files, node by node, and noting every mistake on the way."""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy

import trees
from hardware.suggestions import choices, corrections
from skills import Context, Port, Skill
from trees.analysis.data_flow import Keys
from trees.analysis.reachability import Places, check_flow
from trees.errors import Mistake, Place
from trees.reading.document import REFUSED, Located, StandIn
from trees.reading.grammar import UNTYPED, SubtreeFile, TaskFile
from trees.reading.library import Library
from trees.reading.node_parser import Mistakes
from trees.reading.specs import KINDS, ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value
from trees.reading.values import ANY, Declaration, type_fits, words

from .arguments import MISSING
from .branches import Branches
from .leaf import Leaf
from .port_types import declaration, declarations, known_skills, port_value, type_of, wanted_at
from .scope import Scope, fixed
from .scope import resolve as without_scope
from .skill_hooks import Asking
from .sources import Source, Sources

MAX_NODES = 10_000
MAX_SUBTREES = 8  # within each other


class TreeCompiler:
    """Puts a tree together.

    Args:
        library: Where the files are.
        context: What skills work with.

    Attributes:
        mistakes: What is wrong.
        leaves: The skills, in the order of the file.
        places: Where the nodes stand.
        calls: Where those stand that files of their own are taken for.
        controls: What the nodes above them are: a key of `KINDS`, and the values of its options.
        asking: Asks the code of its skills; knows the nodes that are wrong.
        files: What was read, by name.
    """

    def __init__(self, library: Library, context: Context) -> None:
        self._context = context
        self._sources, self._library = Sources(library), library
        self._branches = Branches(self, context)
        self.known = known_skills()
        self.keys = Keys()
        self.places: dict[Behaviour, Place] = {}
        self.calls: dict[Behaviour, Place] = {}
        self._nodes = 0
        self.mistakes = Mistakes()
        self.leaves: list[Leaf] = []
        self.controls: dict[Behaviour, tuple[str, Mapping[str, Any]]] = {}
        self.asking = Asking()
        self.files = self._sources.files
        self.wrong = self.mistakes.add

    def task(
        self,
        task: TaskFile,
        known: Iterable[Mistake],
        namespace: str,
        arguments: Mapping[str, Located] | None,
    ) -> Behaviour:
        """The tree of a task.

        Args:
            task: As far as it could be read.
            known: What is known to be wrong with it.
            namespace: Of its keys.
            arguments: Values of its parameters; None where it is only checked, and those without a
                default have no value yet.
        """
        self.mistakes = Mistakes(known)
        self.wrong = self.mistakes.add
        self.files[task.path.name] = task.text
        self._sources.load_poses(self.mistakes)
        given = self._arguments(task, arguments)
        unknown = {name: p for name, p in task.parameters.items() if name not in given}
        stand_ins = self._stand_ins(unknown, namespace)
        scope = Scope(namespace, given, (), stand_ins, fixed(task.parameters, "parameter"))
        root = self.node(task.tree, scope, task.name)
        self._finish(root)
        return root

    def subtree(self, file: SubtreeFile, known: Mistakes, namespace: str) -> Behaviour:
        """A subtree by itself, to be checked: its ports are as they are declared."""
        self.mistakes, self.wrong = known, known.add
        self._sources.load_poses(self.mistakes)
        inputs = {name: port for name, port in file.ports.items() if not port.output}
        stand_ins = self._stand_ins(inputs, namespace)
        scope = Scope(namespace, {}, (file.name,), stand_ins, fixed(file.ports, "port"))
        root = self.node(file.tree, scope, file.name)
        for name, port in file.ports.items():
            self._given(name, port, None)
            if port.output:
                key = f"{namespace}/{name}"
                self._check_output(file.tree.place, f"subtree {file.name}", name, port, key)
        self._finish(root)
        return root

    def _stand_ins(self, declared: Mapping[str, Declaration], namespace: str) -> dict[str, StandIn]:
        """What stands for values that nobody has given yet, by the full name of their keys."""
        kinds = {name: port.type or ANY for name, port in declared.items()}
        self.keys.written |= {f"{namespace}/{name}": kind for name, kind in kinds.items()}
        return {f"{namespace}/{name}": StandIn(name, kind) for name, kind in kinds.items()}

    def _finish(self, root: Behaviour) -> None:
        shortest = {leaf.skill: self.asking.shortest(leaf) for leaf in self.leaves}
        places = Places(self.places, self.calls)
        check_flow(root, shortest, places, self.asking.doubtful, self.mistakes)

    def _doubt(self, name: str, place: Place) -> Behaviour:
        """What stands for a node that is wrong."""
        node = Dummy(name)
        self.places[node] = place
        self.asking.doubtful.add(node)
        return node

    def _arguments(
        self, task: TaskFile, arguments: Mapping[str, Located] | None
    ) -> dict[str, Value]:
        asked = arguments or {}
        for name, value in asked.items():
            if name not in task.parameters:
                there = choices(name, task.parameters, asked)
                self.wrong(
                    value.place, f"task {task.number} has no parameter {name}; there are {there}"
                )
        likely = corrections(asked, task.parameters)
        known = {likely.get(name, name): value for name, value in asked.items()}
        given: dict[str, Value] = {}
        for name, declared in task.parameters.items():
            taken = self._given(name, declared, known.get(name))
            if taken is not None:
                given[name] = taken
            elif arguments is not None:
                self.wrong(MISSING, f"the parameter {name} must be given, with --set {name}=VALUE")
        return given

    def _given(self, name: str, declared: Declaration, value: Value | None) -> Value | None:
        """What a parameter or port is given, else its default, checked; None for nothing."""
        default = declared.default if isinstance(declared.default, Located) else None
        if default:
            default = self._taken(default, declared, f"the default of {name}")
        if value is None:
            return default
        return self._taken(value, declared, name) if isinstance(value, Located) else value

    def _taken(self, value: Located, declared: Declaration, what: str) -> Located:
        """A value as it is handed on: where it is wrong, nobody else judges it."""
        if declared.type == UNTYPED or self.fit(value, declared, what) is not None:
            return value
        return Located(value.place, REFUSED, value.label)

    def node(self, spec: TreeNode, scope: Scope, name: str = "") -> Behaviour:
        """The node of a spec, with all below it."""
        self._nodes += 1
        if self._nodes > MAX_NODES:
            if self._nodes == MAX_NODES + 1:
                self.wrong(spec.place, f"the tree has more than {MAX_NODES} nodes")
            return self._doubt("too many", spec.place)
        shown = name or spec.name
        if isinstance(spec, SubtreeNode):
            return self._file(spec, scope, shown)
        node = (
            self._branches.make(spec, scope, shown)
            if isinstance(spec, ControlNode)
            else self._skill(spec, scope, shown)
        )
        self.places[node] = spec.place
        return node

    # Files

    def _file(self, spec: SubtreeNode, scope: Scope, shown: str) -> Behaviour:
        what = f"subtree {spec.source}" if isinstance(spec.source, str) else f"task {spec.source}"
        label = spec.source if isinstance(spec.source, str) else what
        way = (*scope.within, label)
        if label in scope.within:
            self.wrong(spec.place, f"{what} would hold itself: {' -> '.join(way)}")
        elif len(way) > MAX_SUBTREES:
            self.wrong(spec.place, f"more than {MAX_SUBTREES} subtrees within each other")
        elif spec.source != "" and (source := self._sources.get(spec, self.mistakes)):
            ports = self._ports(spec, source, scope, what)
            missing = {
                name: declared
                for name, declared in source.declared.items()
                if name not in ports and not declared.output
            }
            namespace = f"{scope.namespace}/{source.name}_{self._nodes}"
            stand_ins = {**scope.stand_ins, **self._stand_ins(missing, namespace)}
            unwritten = fixed(source.declared, source.what)
            inner = Scope(namespace, ports, way, stand_ins, unwritten)
            node = self.node(source.tree, inner, shown or source.name)
            self._check_written(spec, source, ports, what)
            self.calls[node] = spec.place
            return node
        self._forgive(spec.values.values(), scope)
        return self._doubt(label or "subtree", spec.place)

    def _ports(
        self, spec: SubtreeNode, source: Source, scope: Scope, what: str
    ) -> dict[str, Value]:
        """What the ports of a subtree are given; those that are wrong as a whole are left out."""
        ports: dict[str, Value] = {}
        named = f"{source.what} of {what}" if source.certain else ""
        values = self._named(spec.values, source.declared, named, scope)
        for name, declared in source.declared.items():
            value = values.get(name)
            if declared.output and self._fixed(value, scope, f"{what}: {name}"):
                continue
            given = self._given(name, declared, self.resolve(value, scope))
            if given is None:
                self.wrong(spec.place, f"{what} needs {name}: {declared.description or declared}")
            elif isinstance(given, Located) and declared.output:
                self._unnamed(given, declared.type, f"{what} writes {name}", name, scope)
            else:
                ports[name] = given
            if isinstance(given, Key) and self._typed(given, declared):
                self.keys.copy().read(given, declared.type, f"{what}: {name}", self.mistakes)
        return ports

    def _typed(self, key: Key, declared: Declaration) -> bool:
        """Whether a port that reads a key says of which type."""
        reads = declared.type != UNTYPED and not declared.output
        return reads and key.name in self.keys.written

    def _check_written(
        self, spec: SubtreeNode, source: Source, ports: Mapping[str, Value], what: str
    ) -> None:
        for name, declared in source.declared.items():
            key = ports.get(name)
            if declared.output and isinstance(key, Key):
                self._check_output(spec.place, what, name, declared, key.name)

    def _check_output(
        self, place: Place, what: str, name: str, declared: Declaration, key: str
    ) -> None:
        written = self.keys.written.get(key)
        if written is None:
            self.wrong(place, f"{what} does not write {name} on every way through it")
        elif not type_fits(written, declared.type):
            self.wrong(place, f"{what}: {name} is {declared}, but written is {words(written)}")

    # Skills

    def _skill(self, spec: SkillNode, scope: Scope, shown: str) -> Behaviour:
        kind = self.known.get(spec.skill)
        if kind is None:
            if spec.skill in self._library.subtrees():
                name = spec.skill
                self.wrong(spec.place, f"{name} is a subtree, not a skill: write subtree: {name}")
            elif spec.skill:  # else the file is wrong here, and that is told already
                there = choices(spec.skill, (*self.known, *KINDS, "subtree", "task"))
                own = "; one of your own comes with --skills DIR"
                self.wrong(spec.place, f"no skill {spec.skill}; there are {there}{own}")
            self._forgive(spec.ports.values(), scope)
            return self._doubt(spec.skill, spec.place)
        ports = declarations(kind)
        given = self._named(spec.ports, ports, f"port of {spec.skill}", scope)
        wired = {
            port: self.resolve(value, scope)
            for port, value in given.items()
            if not (ports[port].output and self._fixed(value, scope, f"{spec.skill}.{port}"))
        }
        keys = {port: value.name for port, value in wired.items() if isinstance(value, Key)}
        skill = self.asking.make(kind, shown or spec.skill, self._context, spec.place)
        inputs, types = self._inputs(spec, kind, wired)
        self._outputs(spec, kind, wired, types, scope)
        written = {p: v for p, v in wired.items() if isinstance(v, Located) and p in inputs}
        if isinstance(skill, Skill):
            self.leaves.append(Leaf(skill, spec.place, scope.namespace, keys, inputs, written))
        return skill

    def _forgive(self, values: Iterable[Value], scope: Scope) -> None:
        """Take keys at ports that are not there as read and written: one mistake is told once."""
        for value in values:
            if isinstance(key := self.resolve(value, scope), Key):
                self.keys.written.setdefault(key.name, ANY)
                self.keys.unread.pop(key.name, None)

    def _inputs(
        self, spec: SkillNode, kind: type[Skill], wired: Mapping[str, Value | None]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """The literal inputs of a skill, and the types of all; checks them on the way."""
        inputs: dict[str, Any] = {}
        types: dict[str, str] = {}
        for port, info in kind.input_ports().items():
            value, what = wired.get(port), f"{spec.skill}.{port}"
            wanted = wanted_at(kind, port, value, types)
            if isinstance(value, Key):
                types[port] = self.keys.read(value, wanted.type, what, self.mistakes)
            elif value is not None:
                fitted = self.fit(value, wanted, what)
                inputs[port] = REFUSED if fitted is None else port_value(fitted)
                types[port] = type_of(inputs[port]) if wanted.type == ANY else wanted.type
            elif wanted.needed:
                self.wrong(spec.place, f"{spec.skill} needs {port}: {info.description}")
        if why := kind.mistyped(inputs, types):
            self.wrong(spec.place, f"{spec.skill}: {why}")
        return inputs, types

    def _outputs(
        self,
        spec: SkillNode,
        kind: type[Skill],
        wired: Mapping[str, Value | None],
        types: Mapping[str, str],
        scope: Scope,
    ) -> None:
        for port, info in kind.output_ports().items():
            value = wired.get(port)
            like = types.get(info.like) if isinstance(info, Port) else None
            written = like or declaration(info).type
            if isinstance(value, Key):
                self.keys.write(value, written, self.mistakes)
            elif value is not None:
                self._unnamed(value, written, f"{spec.skill} writes {port}", port, scope)

    def _unnamed(self, value: Located, kind: str, what: str, port: str, scope: Scope) -> None:
        """Tell of a value where a key must be; a name that only lacks its $ counts as written."""
        self.wrong(value.place, f"{what}; name a key such as ${port}")
        if isinstance(value.value, str):
            self.keys.written.setdefault(f"{scope.namespace}/{value.value}", kind)

    def _fixed(self, value: Value | None, scope: Scope, what: str) -> bool:
        """Whether something is written that may not be."""
        if not isinstance(value, Key) or value.name not in scope.fixed:
            return False
        self.wrong(value.place, f"{what}: ${value.name} is {scope.fixed[value.name]}")
        return True

    # Values

    def resolve(self, value: Value | None, scope: Scope) -> Value | None:
        """What a value means outside its file."""
        return None if value is None else without_scope(value, scope, self.mistakes.add_last)

    def fit(self, value: Located, wanted: Declaration, what: str) -> Any:
        """The value that a text means where something is wanted; None where it is wrong."""

        def wrong(place: Place, why: str) -> None:
            self.mistakes.add_last(place, f"{what}: {why}")  # others may want it too

        fitted = trees.fit(value, wanted, self._sources.poses, wrong)
        if wanted.type.endswith("positions") and fitted is not None:
            items = value.value if isinstance(value.value, list) else [value]
            if any(isinstance(item.value, str) for item in items):
                self._sources.use_poses()
        return fitted

    def _named(
        self, given: Mapping[str, Value], known: Collection[str], what: str, scope: Scope
    ) -> dict[str, Value]:
        """The values of known ports, and of those that were probably meant by others.

        Args:
            given: As they are written.
            known: The ports there are.
            what: They are, in words, to tell what is none; empty for not to tell.
            scope: Of the values.
        """
        likely = corrections(given, known)
        for port in given:
            if port not in known:
                there = choices(port, known, given)
                if what:
                    self.wrong(given[port].label, f"{port} is no {what}; there are {there}")
                if port not in likely:
                    self._forgive((given[port],), scope)
        named = {likely.get(port, port): value for port, value in given.items()}
        return {port: value for port, value in named.items() if port in known}
