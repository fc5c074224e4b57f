"""Corrections of several lines, such as all lines of a node."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from trees.errors import Correction, Place

from .document import Located, nested


def block(place: Place) -> list[str]:
    """Return the lines of the node at a place, without its indentation.

    The result is empty if the line has other content before the node, or if the node is in braces.
    """
    row, margin = place.line - 1, place.column - 1
    if not 0 <= row < len(place.lines):
        return []
    before, after = place.lines[row][:margin], place.lines[row][margin:]
    if before.strip(" -") or after[:1] in ("{", "["):
        return []
    lines = [after]
    for line in place.lines[row + 1 :]:
        if line.strip() and len(line) - len(line.lstrip()) < margin:
            break
        lines.append(line[margin:])
    while not lines[-1].split("#")[0].strip():
        lines.pop()
    return lines or [after]


def key_block(place: Place) -> list[str]:
    """Return the lines of a key and its value; empty if its line has other content before it."""
    lines = block(place)
    inside = (n for n, line in enumerate(lines) if n and line.strip() and line[:1] != " ")
    return lines[: next((n for n in inside if not lines[n].startswith("- ")), len(lines))]


def replaced_block(place: Place, lines: Sequence[str]) -> Correction | None:
    """Return the correction that replaces the node at a place by `lines`, or None."""
    old = block(place)
    if not old:
        return None
    first = place.lines[place.line - 1][: place.column - 1] + lines[0]
    indent = " " * (place.column - 1)
    rest = [f"{indent}{line}" if line.strip() else line for line in lines[1:]]
    return Correction("\n".join([first, *rest]), place.line, len(old))


def rewritten(place: Place, node: Mapping[str, str | Sequence[str]]) -> Correction | None:
    """Return the correction that writes other keys in place of a node, in braces or over lines.

    Args:
        place: Place of the node.
        node: Values of the keys as YAML. A list of nodes has one text for each node.
    """
    if place.brackets:
        texts = {k: v if isinstance(v, str) else f"[{', '.join(v)}]" for k, v in node.items()}
        braces = ", ".join(f"{key}: {text}" for key, text in texts.items())
        return place.replaced(place.brackets, f"{{{braces}}}")
    lines = list[str]()
    for key, text in node.items():
        one = isinstance(text, str)
        lines += [f"{key}: {text}"] if one else [f"{key}:", *(f"  - {item}" for item in text)]
    return replaced_block(place, lines)


def added_below(place: Place, line: str) -> Correction | None:
    """Return the correction that adds a line below the node at a place, in its column."""
    old = block(place)
    text = " " * (place.column - 1) + line
    return Correction(text, place.line + len(old), 0) if old else None


def in_node(place: Place, head: str) -> Correction | None:
    """Return the correction that puts the list of nodes at a place below the new node `head`."""
    line, column = place.lines[place.line - 1], place.column - 1
    before, after = line[:column], line[column:]
    if not after.startswith("["):
        if before.strip() == "-":  # for a list of one item, one `-` may be too many
            lines = [f"  {line}" for line in block(place)]
            several = len([line for line in lines if line.startswith("  - ")]) > 1
            return replaced_block(place, [f"{head}:", *lines]) if several else None
        above = re.match(r"[\s-]*", place.lines[place.line - 2])
        if above and above.end() == column:  # the items of the list are in the column of its key
            lines, indent = key_block(place), " " * (column + 2)
            text = "\n".join([f"{indent}{head}:", *(f"{indent}  {each}" for each in lines)])
            return Correction(text, place.line, len(lines))
        return Correction(f"{' ' * column}{head}:", place.line, 0)
    if found := re.fullmatch(r"( *)[\w-]+: +", before):
        return Correction(f"{before.rstrip()}\n{found[1]}  {head}: {after}", place.line)
    if not before.strip(" -"):
        return Correction(f"{before}{head}: {after}", place.line)
    return place.replaced(place.brackets, f"{{{head}: {place.brackets}}}")


def added_above(place: Place, node: str) -> Correction | None:
    """Return the correction that adds a node above a node that is an item of a list, or None."""
    before = place.lines[place.line - 1][: place.column - 1] if place.lines else ""
    text = before + node.replace("\n", "\n" + " " * len(before))
    return Correction(text, place.line, 0) if before.strip() == "-" else None


def left_out(place: Place) -> Correction | None:
    """Return the line without the key at a place and its value, for a mapping in braces."""
    line = place.lines[place.line - 1] if 0 < place.line <= len(place.lines) else ""
    before, after = line[: place.column - 1].rstrip(), line[place.column - 1 :]
    value = re.match(r"\w+: [^][{},#]+(, *)?", after)
    if value is None or not before.endswith((",", "{")):
        return None
    if before.endswith(",") and not value[1]:
        before = before[:-1]
    rest = after[value.end() :]
    return Correction(before + (" " if before.endswith(",") else "") + rest, place.line)


def as_mapping(value: Located) -> Correction | None:
    """Return the correction that writes a list of mappings as one mapping."""
    items = value.value if isinstance(value.value, list) else []
    given = {key: each for item in items for key, each in nested(item).items()}
    if value.place.brackets:
        return value.instead(replace(value, value=given).as_yaml())
    lines, rows = [*value.place.lines], [item.place.line - 1 for item in items]
    for row in rows:
        lines[row] = re.sub(r"^(\s*)-( +)", r"\1 \2", lines[row])
    begin, end = rows[0], rows[-1] + len(block(items[-1].place))
    return Correction("\n".join(lines[begin:end]), begin + 1, end - begin)


def retyped(place: Place, name: str, old: str, new: str) -> Correction | None:
    """Return the correction of the line that declares a name, with the type `new`; or None."""
    text = "\n".join(place.lines)
    found = re.search(rf"^ +{name}:(?: |[^\n]*\n)[^}}\n]*?(?=\b{old}\b)", text, re.MULTILINE)
    if found is None:
        return None
    row = text.count("\n", 0, found.end())
    column = found.end() - text.rfind("\n", 0, found.end()) - 1
    line = place.lines[row]
    return Correction(f"{line[:column]}{new}{line[column + len(old) :]}", row + 1)


def declared_above(place: Place, head: str, line: str) -> Correction | None:
    """Return the correction that adds a line below a top-level key. It adds a missing key."""
    tops = {line.partition(":")[0]: row for row, line in enumerate(place.lines, 1)}
    if head not in tops:
        return Correction(f"{head}:\n  {line}", tops["tree"], 0) if "tree" in tops else None
    first, *below = place.lines[tops[head] - 1 :]
    if below and below[0][:1] == " " and not re.match(r" +[\w$-]+:", below[0]):
        return None  # the lines below the key are not declarations
    if first.split("#")[0].rstrip() == f"{head}:":
        return Correction(f"  {line}", tops[head] + 1, 0)
    inline = re.fullmatch(rf"({head}: \{{.*)\}}\s*", first)
    return Correction(f"{inline[1]}, {line}}}", tops[head]) if inline else None


def pieces(value: Located) -> list[Located]:
    """Return the items of a list that is written in place of a mapping of names; else []."""
    items = value.value if isinstance(value.value, list) else []
    keys = [key for item in items for key in nested(item)]
    flow = not value.place.brackets and any(item.place.brackets for item in items)
    unique = all(map(nested, items)) and len(keys) == len({*keys})
    return items if unique and not flow and not {"name", "type"} <= {*keys} else []
