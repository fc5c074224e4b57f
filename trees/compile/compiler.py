"""The tree compiler: makes a py_trees tree from a task file and skills, and finds every mistake."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.behaviours import Dummy

from hardware.spelling import corrections, did_you_mean
from skills import Context, Port, Skill
from trees.declarations import ANY, Declaration, type_fits, words
from trees.errors import Correction, Mistakes, Place
from trees.nodes.kind import KINDS, Control, ControlNodeKind, Flow
from trees.nodes.unknown import UnknownKind
from trees.reading.document import REFUSED, Located, StandIn, nested, reference
from trees.reading.grammar import UNTYPED, Draft, TaskFile
from trees.reading.library import Library
from trees.reading.lines import replaced_block
from trees.reading.literals import doubt, fit
from trees.reading.specs import ControlNode, Key, SkillNode, SubtreeNode, TreeNode, Value

from .arguments import MISSING
from .data_flow import Keys
from .leaf import Leaf
from .move_words import as_positions, instead_of_width, joints_by_name, wrong_units
from .port_names import known_ports
from .port_types import (
    declaration,
    declarations,
    known_skills,
    port_value,
    type_of,
    wanted_at,
    writers_of,
)
from .scope import Scope, resolve
from .skill_hooks import SkillHooks, named_port
from .sources import Sources
from .unknown_names import (
    TO_POSE,
    is_nothing,
    meant,
    meant_file,
    only_taker,
    target_pose,
    why_unknown,
    without_ports,
)
from .values_by_port import as_mapping, as_subtree, by_port, with_more, with_port

MAX_NODES = 10_000
MAX_SUBTREES = 8  # largest nesting depth

_UNKNOWN = UnknownKind()
_FIXED = {
    "parameter": "a parameter, which must not be written",
    "port": "an input port; declare it with output: true to write it",
}


@dataclass
class CompiledTree:
    """A tree, and all information about it before it runs.

    Attributes:
        namespace: Namespace of its keys.
        mistakes: Mistakes so far.
        files: Texts of the files that were used, by name.
        root: Root of the tree.
        leaves: Its skills, in the order of the file.
        controls: Kinds and options of the nodes that have children.
        places: Places of the nodes in the files.
        calls: Places that use subtrees and other tasks, by the root node of each.
        hooks: Caller of the hooks of its skills. It records refused inputs and wrong nodes.
        unread: Keys that a node writes and no node reads.
        stand_ins: Full names of parameters and ports without a value before the run.
    """

    namespace: str
    mistakes: Mistakes
    files: Mapping[str, str]
    root: Behaviour = field(init=False)
    leaves: dict[Behaviour, Leaf] = field(default_factory=dict)
    controls: dict[Behaviour, Control] = field(default_factory=dict)
    places: dict[Behaviour, Place] = field(default_factory=dict)
    calls: dict[Behaviour, Place] = field(default_factory=dict)
    hooks: SkillHooks = field(default_factory=SkillHooks)
    unread: Sequence[Key] = ()
    stand_ins: set[str] = field(default_factory=set)


class TreeCompiler:
    """Compiles one tree: a task, or a single subtree for a check.

    Args:
        draft: The readable part of the file, and its mistakes.
        library: Library with subtrees, poses and other tasks.
        context: Context of the skills.
        namespace: Namespace of its keys.
    """

    def __init__(self, draft: Draft, library: Library, context: Context, namespace: str) -> None:
        self._task, self._mistakes = draft[0], Mistakes(draft[1])
        self._wrong = self._mistakes.add
        self._context, self._library = context, library
        self._sources, self._skills = Sources(library), known_skills()
        self._keys, self._nodes = Keys(), 0
        self._tree = CompiledTree(namespace, self._mistakes, self._sources.files)

    def compile(self, arguments: Mapping[str, Located] | None = None) -> CompiledTree:
        """Return the compiled tree.

        Args:
            arguments: Values of the parameters of a task. If None, the file is only checked.
                Parameters of a task then have their defaults. Ports, and parameters without a
                default, have only their declared types.
        """
        file, tree, namespace = self._task, self._tree, self._tree.namespace
        self._sources.files[file.path.name] = file.text
        self._sources.load_poses(self._mistakes, self._context.robot)
        tree.hooks.saved = self._sources.poses
        inputs = {name: each for name, each in file.parameters.items() if not each.output}
        within = {} if file.number is not None else {file.name: file.tree.place}
        scope = Scope(file, namespace, {}, within, self._stand_ins(inputs, namespace))
        given = self._arguments(arguments, scope)
        if file.number is not None:
            scope = replace(scope, ports=given)
        tree.root = self._node(file.tree, scope, file.name)
        for name in file.parameters.keys() - inputs:
            what, key = f"subtree {file.name}", f"{namespace}/{name}"
            self._check_output(file.tree.place, what, name, file.parameters[name], key)
            self._keys.reads.add(key)
        tree.unread = self._keys.never_read()
        return tree

    def _stand_ins(self, declared: Mapping[str, Declaration], namespace: str) -> dict[str, StandIn]:
        """Return placeholders of the declared types, by full names of keys."""
        kinds = {name: port.type or ANY for name, port in declared.items()}
        self._keys.written |= {f"{namespace}/{name}": kind for name, kind in kinds.items()}
        stand_ins = {f"{namespace}/{name}": StandIn(name, kind) for name, kind in kinds.items()}
        self._tree.stand_ins |= stand_ins.keys()
        return stand_ins

    def _placeholder(self, name: str, place: Place) -> Behaviour:
        """Return a placeholder for a wrong node."""
        node = Dummy(name)
        self._tree.places[node] = place
        self._tree.hooks.doubtful.add(node)
        return node

    def _arguments(self, arguments: Mapping[str, Located] | None, scope: Scope) -> dict[str, Value]:
        """Return the values of the parameters, from arguments and defaults."""
        task = scope.file
        what = f"{task.port} of task {task.number}"
        known = self._known_ports(arguments or {}, task.parameters, what, scope)
        given: dict[str, Value] = {}
        for name, declared in task.parameters.items():
            checked = self._given(name, declared, known.get(name))
            if checked is not None:
                given[name] = checked
            elif arguments is not None:
                missing = replace(MISSING, location=name)
                self._wrong(missing, f"the parameter {name} must be given, with --set {name}=VALUE")
        return given

    def _given(self, name: str, declared: Declaration, value: Value | None) -> Value | None:
        """Return the checked value of a parameter or port, else its default, else None."""
        default = declared.default if isinstance(declared.default, Located) else None
        if default:
            default = self._checked(default, declared, f"the default of {name}")
        if value is None:
            return default
        return self._checked(value, declared, name) if isinstance(value, Located) else value

    def _checked(self, value: Located, declared: Declaration, what: str) -> Located:
        """Return a value, or REFUSED if it is wrong. Uses of REFUSED report nothing."""
        if declared.type == UNTYPED or self._fit(value, declared, what) is not None:
            return value
        return Located(value.place, REFUSED, value.label)

    def _node(self, spec: TreeNode, scope: Scope, name: str = "") -> Behaviour:
        """Compile a node with its children. A `name` replaces the name in the file."""
        self._nodes += 1
        if self._nodes > MAX_NODES:
            if self._nodes == MAX_NODES + 1:
                self._wrong(spec.place, f"the tree has more than {MAX_NODES} nodes")
            return self._placeholder("too many", spec.place)
        shown = name or spec.name
        if isinstance(spec, SubtreeNode):
            return self._file(spec, scope, shown)
        compiled = self._control if isinstance(spec, ControlNode) else self._skill
        node = compiled(spec, scope, shown)  # type: ignore[arg-type]
        self._tree.places[node] = spec.place
        return node

    # Control nodes

    def _control(self, spec: ControlNode, scope: Scope, shown: str) -> Behaviour:
        kind = KINDS.get(spec.kind, _UNKNOWN)
        given = {option: self._option(spec, option, kind, scope) for option in kind.options}
        wrong = {option for option, value in given.items() if value is REFUSED}
        options = given | {option: _placeholder_value(kind, option) for option in wrong}
        specs = list(spec.children)
        if kind.condition:  # a missing condition is already reported
            specs = [*specs, *[SkillNode(spec.place, "", {})] * 2][:2]
        nodes = self._children(specs, kind, options, scope)
        node = kind.make(shown or spec.kind or kind.name, nodes, options, self._context)
        places = {option: value.label for option, value in spec.options.items()}
        self._tree.controls[node] = Control(kind, options, places)
        if wrong or kind is _UNKNOWN:
            self._tree.hooks.doubtful.add(node)
        return node

    def _option(self, spec: ControlNode, option: str, kind: ControlNodeKind, scope: Scope) -> Any:
        """Return the value of an option, or REFUSED if it is wrong."""
        declared = kind.options[option]
        value = self._resolve(spec.options.get(option), scope)
        if isinstance(value, Key) and value.name in scope.stand_ins:
            stand_in = Located(value.place, scope.stand_ins[value.name], value.label)
            self._fit(stand_in, declared, f"{spec.kind}: {option}")
            return _placeholder_value(kind, option)
        if isinstance(value, Key):
            self._wrong(value.place, f"{spec.kind}: {option} must be known before the run")
            return REFUSED
        if value is None:
            return REFUSED if declared.needed else declared.default
        fitted = self._fit(value, declared, f"{spec.kind}: {option}")
        return REFUSED if fitted is None else fitted

    def _children(
        self,
        specs: Sequence[TreeNode],
        kind: ControlNodeKind,
        options: Mapping[str, Any],
        scope: Scope,
    ) -> list[Behaviour]:
        """Compile children, and merge the keys that they write."""
        flow, before = kind.flow(options), self._keys.copy()
        if flow in (Flow.SEQUENCE, Flow.UNCERTAIN):
            order = reversed(specs) if kind.condition else specs  # the condition is compiled first
            nodes = [self._node(spec, scope) for spec in order]
            if flow is Flow.UNCERTAIN:
                self._keys.merge_alternatives([before, self._keys])
            return nodes[::-1] if kind.condition else nodes
        nodes, branches = self._branches(specs, scope)
        if flow is Flow.ALTERNATIVES:
            self._keys.merge_alternatives(branches)
        elif flow is Flow.PARALLEL:
            self._keys.merge_parallel(branches, self._mistakes)
        else:
            for branch in branches:
                self._keys.written |= branch.written
            self._keys.unread = {}
        return nodes

    def _branches(
        self, specs: Sequence[TreeNode], scope: Scope
    ) -> tuple[list[Behaviour], list[Keys]]:
        """Compile children that cannot pass keys to each other. Return them and their keys."""
        before, nodes, branches = self._keys, list[Behaviour](), list[Keys]()
        for spec in specs:
            self._keys = before.copy()
            nodes.append(self._node(spec, scope))
            branches.append(self._keys)
        self._keys = before
        for branch in branches:  # a key counts as read if one branch reads it
            before.unread = {n: key for n, key in before.unread.items() if n in branch.unread}
        return nodes, branches or [before]

    def _file(self, spec: SubtreeNode, scope: Scope, shown: str) -> Behaviour:
        what = f"subtree {spec.source}" if isinstance(spec.source, str) else f"task {spec.source}"
        label = spec.source if isinstance(spec.source, str) else what
        if spec.source in self._skills and spec.source not in self._library.subtrees():
            values = f": {as_mapping(spec.values).as_yaml()}" if spec.values else ""
            right = replaced_block(spec.place, [f"{label}{values}"])
            why = f"{label} is a skill, not a subtree: write {label} without subtree:"
            self._wrong(spec.place, why, right)
            return self._node(SkillNode(spec.place, label, spec.values, shown), scope)
        if found := meant_file(spec, self._library):
            near, why, right = found
            self._mistakes.add_last(spec.named.place if spec.named else spec.place, why, right)
            return self._file(replace(spec, source=near, head="subtree"), scope, shown)
        way = {**scope.within, label: spec.place}
        source = self._source(spec, scope, label, way)
        if source is None:
            self._assume_used(spec.values.values(), scope)
            return self._placeholder(label or "subtree", spec.place)
        given, known = spec.values.keys() - {""}, source.parameters
        missed = [port for port, each in known.items() if each.needed and port not in given]
        strange = given and not given & known.keys() and not corrections(given, known)
        if len(missed) > 1 and strange and (name := only_taker(spec.values, self._library)):
            first = next(iter(spec.values))
            why = f"{first} is not a port of {what}, but of subtree {name}"
            place = spec.named.place if spec.named else spec.place
            right = place.replaced(source.name, name)
            self._wrong(place, f"{why}: write subtree: {name}", right)
            return self._file(replace(spec, source=name), scope, shown)
        ports = self._ports(spec, source, scope, what)
        missing = {
            name: declared
            for name, declared in source.parameters.items()
            if name not in ports and not declared.output
        }
        namespace = f"{scope.namespace}/{source.name}_{self._nodes}"
        stand_ins = {**scope.stand_ins, **self._stand_ins(missing, namespace)}
        inner = Scope(source, namespace, ports, way, stand_ins)
        node = self._node(source.tree, inner, shown or source.name)
        self._tree.calls[node] = spec.place
        for name, declared in source.parameters.items():
            key = ports.get(name)
            if declared.output and isinstance(key, Key):
                self._check_output(spec.place, what, name, declared, key.name)
        return node

    def _source(
        self, spec: SubtreeNode, scope: Scope, label: str, way: Mapping[str, Place]
    ) -> TaskFile | None:
        """Return the file of a node. Report an unusable file and return None."""
        if label in scope.within:
            self._cycle(label, way)
        elif len(way) > MAX_SUBTREES:
            self._wrong(spec.place, f"more than {MAX_SUBTREES} nested subtrees")
        elif spec.source != "":
            return self._sources.get(spec, self._mistakes)
        return None

    def _cycle(self, label: str, way: Mapping[str, Place]) -> None:
        """Report files that use each other. The place does not depend on the first file."""
        names = list(way)[list(way).index(label) :]
        first = names.index(min(names))
        cycle = [*names[first:], *names[: first + 1]]
        uses = (f"{name} ({way[name].path.name}:{way[name].line})" for name in cycle[1:])
        circle = " -> ".join([cycle[0], *uses])
        why = f"{cycle[0]} would contain itself: {circle}; leave one of these uses out"
        self._wrong(way[cycle[0]], why)

    def _ports(
        self, spec: SubtreeNode, source: TaskFile, scope: Scope, what: str
    ) -> dict[str, Value]:
        """Return the values and keys at the ports of a subtree, without wrong ones."""
        if spec.values and not source.parameters and spec.source not in self._sources.uncertain:
            why, right = without_ports(spec, f"{what} has no {source.port}s", self._context.robot)
            first = next(iter(spec.values.values()))
            self._mistakes.withdraw(first.label)  # that mistake assumes that the subtree has ports
            self._wrong(first.place, why, right)
            self._assume_used(spec.values.values(), scope)
            return {}
        ports: dict[str, Value] = {}
        named = f"{source.port} of {what}" if spec.source not in self._sources.uncertain else ""
        ported = joints_by_name(spec, source, what, self._context.robot, self._wrong)
        ported = by_port(ported, source.parameters, (what, "with"), self._wrong)
        values = self._known_ports(ported, source.parameters, named, scope)
        missing = dict[str, str]()
        for name, declared in source.parameters.items():
            value = values.get(name)
            if declared.output and self._fixed(value, scope, f"{what}: {name}"):
                continue
            given = self._given(name, declared, self._resolve(value, scope))
            if given is None:
                missing[name] = f"{name}: {declared.description or declared}"
            elif isinstance(given, Located) and declared.output:
                self._unnamed(given, declared.type, f"{what} writes {name}", name, scope)
            else:
                ports[name] = given
            reads = declared.type != UNTYPED and not declared.output
            if reads and isinstance(given, Key) and given.name in self._keys.written:
                self._keys.copy().read(given, declared.type, f"{what}: {name}", self._mistakes)
        needs = f"needs {', and '.join(missing.values())}"
        unknown = (value.label for port, value in ported.items() if port not in source.parameters)
        extended = missing and any(self._mistakes.extend(at, f"it {needs}") for at in unknown)
        if missing and not extended:
            poses = {name: self._pose_of(name) for name in missing}
            right = with_more(spec.place, spec.values, poses) if all(poses.values()) else None
            self._wrong(spec.place, f"{what} {needs}", right)
        return ports

    def _pose_of(self, group: str) -> str:
        """Return the name of the first pose with exactly the joints of a group, or ""."""
        robot = self._context.robot
        joints = robot.actuated_in(group) if group in robot.groups else ()
        wanted = {joint.name for joint in joints}
        poses = self._sources.poses.items()
        return next((name for name, pose in poses if wanted and pose.keys() == wanted), "")

    def _check_output(
        self, place: Place, what: str, name: str, declared: Declaration, key: str
    ) -> None:
        written = self._keys.written.get(key)
        if written is None:
            self._wrong(place, f"{what} does not write {name} on every path through it")
        elif not type_fits(written, declared.type):
            self._wrong(place, f"{what}: {name} is {declared}, but {words(written)} is written")

    # Skills

    def _skill(self, spec: SkillNode, scope: Scope, shown: str) -> Behaviour:
        kind = self._skills.get(spec.skill)
        if kind is None:
            subtrees, robot = self._library.subtrees(), self._context.robot
            poses = self._sources.poses
            name = spec.skill and meant(spec, self._skills, self._library, poses, robot)
            if name in subtrees:
                return self._node(self._as_subtree(spec, name, shown), scope)
            if name in self._skills:
                right = spec.place.replaced(spec.skill, name)
                self._wrong(spec.place, f"no skill {spec.skill}{did_you_mean(name)}", right)
                return self._skill(replace(spec, skill=name), scope, shown)
            number = self._library.names().get(spec.skill)
            if number is not None and not spec.ports:
                right = spec.place.replaced(spec.skill, f"{{task: {number}}}")
                why = f"no skill {spec.skill}, but a task: write {{task: {number}}}"
                self._wrong(spec.place, why, right)
            elif spec.skill:  # else the mistake is already reported
                self._wrong(spec.place, why_unknown(spec.skill, self._skills, subtrees))
            self._assume_used(spec.ports.values(), scope)
            return self._placeholder(spec.skill, spec.place)
        ports = declarations(kind)
        ported = by_port(spec.ports, ports, (spec.skill, spec.skill), self._wrong)
        given = self._known_ports(ported, ports, f"port of {spec.skill}", scope)
        if kind.condition and not any(isinstance(value, Key) for value in given.values()):
            given = {port: self._named_key(value, scope) for port, value in given.items()}
        wired = {
            port: self._resolve(value, scope)
            for port, value in given.items()
            if not (ports[port].output and self._fixed(value, scope, f"{spec.skill}.{port}"))
        }
        keys = {port: value.name for port, value in wired.items() if isinstance(value, Key)}
        skill = self._tree.hooks.make(kind, shown or spec.skill, self._context, spec.place)
        inputs, types = self._inputs(spec, kind, wired)
        self._outputs(spec, kind, wired, types, scope)
        written = {p: v for p, v in wired.items() if isinstance(v, Located) and p in inputs}
        if isinstance(skill, Skill):
            leaf = Leaf(skill, spec.place, scope.namespace, keys, inputs, written)
            self._tree.leaves[skill] = leaf
        return skill

    def _named_key(self, value: Value, scope: Scope) -> Value:
        """Report a text that is the name of a key. Return the key; else the value as given."""
        text = value.value if isinstance(value, Located) and isinstance(value.value, str) else ""
        name = reference(text)[1:] or text
        if not isinstance(value, Located) or f"{scope.namespace}/{name}" not in self._keys.written:
            return value
        why = f"{value} is only a text; for the value of the key {name}, write ${name}"
        self._wrong(value.place, why, value.instead(f"${name}"))
        return Key(value.place, name, value.label)

    def _as_subtree(self, spec: SkillNode, name: str, shown: str) -> SubtreeNode:
        """Report a subtree that is written like a skill. Return the node of the subtree."""
        node = SubtreeNode(spec.place, name, spec.ports, shown)
        source, mistakes = self._sources.get(node, self._mistakes), Mistakes()
        given: Mapping[str, Value] = {
            port: value for port, value in spec.ports.items() if not is_nothing(value)
        }
        if source and not source.parameters:
            given = {}
        if not given and spec.skill in {*self._sources.poses} and source and source.parameters:
            given = {"": Located(spec.place, spec.skill, spec.place)}
        pose = target_pose(given, self._sources.poses) if name == TO_POSE else None
        if pose and source and not given.keys() & source.parameters.keys():
            given = {"": pose}
        if name == TO_POSE and source:
            named = replace(node, values=given)
            given = joints_by_name(named, source, "", self._context.robot, mistakes.add)
        whole = given.get("")
        is_list = isinstance(whole, Located) and isinstance(whole.value, list)
        if whole and (name == TO_POSE or not is_list):  # only in TO_POSE, a list has angles
            target = as_positions(whole, self._context.robot)
            given = nested(target) if isinstance(target, Located) and nested(target) else given
        ports = by_port(given, source.parameters if source else {}, ("", ""), mistakes.add)
        ports = ports if any(mistake.instead for mistake in mistakes.found) else given
        why = f"there is no skill {spec.skill}; {name} is a subtree: write subtree: {name}"
        if ports and ports.keys() != spec.ports.keys():
            why += f", with: {as_mapping(ports).as_yaml()}"
        right = as_subtree(spec.place, spec.skill, name, ports)
        declared = source.parameters.items() if source else ()
        needed = [port for port, each in declared if each.needed and not each.output]
        if needed and (not ports or "" in ports):
            why += f", with: {{{', '.join(f'{port}: …' for port in needed)}}}"
            ports = {port: Located(spec.place, REFUSED, spec.place) for port in needed}
            right = None
        self._wrong(spec.place, why, right)
        return SubtreeNode(spec.place, name, ports, shown)

    def _assume_used(self, values: Iterable[Value], scope: Scope) -> None:
        """Treat keys at unknown ports as read and written, to avoid further reports."""
        for value in values:
            if isinstance(key := self._resolve(value, scope), Key):
                self._keys.written.setdefault(key.name, ANY)
                self._keys.unread.pop(key.name, None)
                self._keys.reads.add(key.name)

    def _inputs(
        self, spec: SkillNode, kind: type[Skill], wired: Mapping[str, Value | None]
    ) -> tuple[dict[str, Any], dict[str, str]]:
        """Check the inputs of a skill. Return the literal inputs, and the types of all inputs."""
        inputs: dict[str, Any] = {}
        types: dict[str, str] = {}
        for port, info in kind.input_ports().items():
            value, what = wired.get(port), f"{spec.skill}.{port}"
            wanted = wanted_at(kind, port, value, types)
            if isinstance(value, Key):
                writers = writers_of(port, wanted)
                types[port] = self._keys.read(value, wanted.type, what, self._mistakes, writers)
            elif value is not None:
                fitted = self._fit(value, wanted, named_port(value.place, spec.skill, port))
                inputs[port] = REFUSED if fitted is None else port_value(fitted)
                literal = type_of(inputs[port]) if wanted.type == ANY else wanted.type
                types[port] = value.declared or literal
            elif wanted.needed:
                by = " or ".join(writers_of(port, wanted))
                how = f"; {by} can write it above: {port}: ${port}" if by else ""
                right = with_port(spec, port) if wanted.type == "duration" else None
                why = f"{spec.skill} needs {port}: {info.description}{how}"
                self._wrong(spec.place, why, right)
        if why := kind.mistyped(inputs, types):
            self._wrong(spec.place, f"{spec.skill}: {why}")
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
                self._keys.write(value, written, self._mistakes)
            elif value is not None:
                self._unnamed(value, written, f"{spec.skill} writes {port}", port, scope)

    def _unnamed(self, value: Located, kind: str, what: str, port: str, scope: Scope) -> None:
        """Report an output port that has a plain value instead of a key.

        A text without $ counts as a key of that name, so that nodes that read it are not reported.
        """
        text = value.value if isinstance(value.value, str) else ""
        instead = value.instead(f"${text}") if text.isidentifier() else None
        self._wrong(
            value.place, f"{what}; name a key such as ${text if instead else port}", instead
        )
        if isinstance(value.value, str):
            self._keys.written.setdefault(f"{scope.namespace}/{value.value}", kind)

    def _fixed(self, value: Value | None, scope: Scope, what: str) -> bool:
        """Report a key that must not be written. Return True if the value is such a key."""
        if not isinstance(value, Key) or not (declared := scope.file.parameters.get(value.name)):
            return False
        if declared.type == UNTYPED or declared.output:
            return False
        self._wrong(value.place, f"{what}: ${value.name} is {_FIXED[scope.file.port]}")
        return True

    def _resolve(self, value: Value | None, scope: Scope) -> Value | None:
        """Return a value with its references replaced by their values."""
        return None if value is None else resolve(value, scope, self._keys.written, self._mistakes)

    def _fit(self, value: Located, wanted: Declaration, what: str) -> Any:
        """Return a literal value in the declared type, or None if it is wrong."""

        def wrong(place: Place, why: str, instead: Correction | None = None) -> None:
            # Other uses of the value may report the same mistake.
            self._mistakes.add_last(place, f"{what}: {why}", instead)

        if wanted.type == "positions" and (said := instead_of_width(value, self._context.robot)):
            wrong(*said)
            return None
        items = value.value if isinstance(value.value, list) else [value]
        positions = wanted.type.endswith("positions")
        if positions and [item for item in items if wrong_units(item, self._context.robot, wrong)]:
            return None
        poses, port = self._sources.poses, what.rpartition(".")[2]
        if value.value not in [*poses]:  # messages suggest joints and poses of the group `port`
            group = {*self._context.robot.groups.get(port, ())}
            poses = {name: q for name, q in poses.items() if q and {*q} <= group} or poses
        fitted = fit(value, wanted, poses, wrong)
        if note := doubt(value, wanted, what):
            self._mistakes.notes.append(note)
        if positions and fitted is not None and any(isinstance(i.value, str) for i in items):
            self._sources.use_poses()
        return fitted

    def _known_ports(
        self, given: Mapping[str, Value], known: Mapping[str, Declaration], what: str, scope: Scope
    ) -> dict[str, Value]:
        """Return the values of known ports. A key at an unknown port counts as read and written."""
        joints = [joint.name for joint in self._context.robot.joints]
        found, rest = known_ports(given, known, what, joints, self._mistakes)
        self._assume_used(rest, scope)
        return found


def _placeholder_value(kind: ControlNodeKind, option: str) -> Any:
    """Return a placeholder for an option that is wrong or not known yet."""
    return kind.placeholders.get(option, kind.options[option].default)
