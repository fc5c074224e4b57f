"""Attributes of the elements of a URDF, and suggestions for misspelt attributes."""

from xml.etree.ElementTree import Element

from hardware.spelling import closest

# For each kind of shape, the attributes that hold sizes, and the count of numbers in each.
SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}
SHAPES = (*SIZES, "mesh")
# Attributes of the elements that are read.
_ATTRIBUTES = {
    **{shape: tuple(sizes) for shape, sizes in SIZES.items()},
    "mesh": ("filename", "scale"),
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "velocity", "effort"),
    "mimic": ("joint", "multiplier", "offset"),
}


def given(element: Element, key: str, default: str) -> str:
    """Return the value of an attribute; "" if it seems misspelt, or the default if it is absent."""
    return element.get(key, "" if misspelt(element, key) else default)


def _unknown(element: Element) -> list[str]:
    """Return the names of the attributes that a URDF does not have."""
    return [name for name in element.attrib if name not in _ATTRIBUTES.get(element.tag, (name,))]


def misspelt(element: Element, key: str) -> str:
    """Return the name of the attribute that most likely means `key`; empty if none does."""
    return "" if key in element.attrib else closest(key, _unknown(element))


def others(element: Element, value: str | None) -> str:
    """Return words about the unknown attributes of an element; empty if there are none.

    Args:
        element: The element.
        value: Value of the attribute that a message is about. If it is not None, the words are
            empty.
    """
    names = _unknown(element) if value is None else []
    verb = "are" if names[1:] else "is"
    return f"; {' and '.join(names)} {verb} not known in <{element.tag}>" if names else ""


def corrected_end(joint: Element, tag: str) -> str:
    """Return the right element for a link of a joint, such as `<parent link="base"/>`.

    The link is the value of the first attribute of the wrong element, or NAME if it has none.

    Args:
        joint: The joint.
        tag: parent or child.
    """
    element = joint.find(tag)
    values = [] if element is None else [*element.attrib.values()]
    return f'<{tag} link="{values[0] if values else "NAME"}"/>'
