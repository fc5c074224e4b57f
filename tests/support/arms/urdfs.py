"""URDFs in a few words."""

from collections.abc import Iterable

LIMIT = '<limit lower="-1" upper="1" velocity="2" effort="1"/>'


def urdf(joints: Iterable[str], shapes: str = "") -> str:
    """A URDF of joints such as `base -> arm: revolute shoulder [more XML]`."""
    elements, links = list[str](), dict[str, None]()
    for each in joints:
        ends, _, rest = each.partition(": ")
        parent, child = ends.split(" -> ")
        kind, name, *more = rest.split(" ", 2)
        links |= {parent: None, child: None}
        body = f'<parent link="{parent}"/><child link="{child}"/>{"".join(more)}'
        limit = LIMIT if kind in ("revolute", "prismatic") and "<limit" not in body else ""
        elements.append(f'<joint name="{name}" type="{kind}">{body}{limit}</joint>')
    made = "".join(f'<link name="{link}">{shapes}</link>' for link in links)
    return f'<robot name="r">{made}{"".join(elements)}</robot>'
