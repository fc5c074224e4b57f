"""Texts from outside, such as files, servers and names of ports, on a terminal or in a log."""


def printable(text: str) -> str:
    r"""Return a text that cannot control a terminal: other characters become escapes, as `\x1b`.

    Lines and tabs stay.
    """
    if text.isprintable():
        return text
    return "".join(
        each if each.isprintable() or each in "\n\t" else each.encode("unicode_escape").decode()
        for each in text
    )
