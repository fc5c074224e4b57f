"""Suggestions for misspelt names: the part of an error message that says "did you mean ...?"."""

from collections.abc import Collection, Iterable


def closest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return the known name that is most similar to a word, or "" if none is similar enough.

    Args:
        word: The word as it was written.
        known: The names to choose from.
        cutoff: Least similarity, from 0 (any name) to 1 (only the word itself).
    """
    from difflib import get_close_matches  # slow to load, and only error messages need it

    return next(iter(get_close_matches(word, list(known), n=1, cutoff=cutoff)), "")


def suggestion(word: str, known: Iterable[str], given: Collection[str] = ()) -> str:
    """Return `; did you mean NAME?`, or "" if no known name is similar.

    Args:
        word: The unknown word.
        known: The names to choose from.
        given: Names that are used already. They are not suggested.
    """
    near = closest(word, [name for name in known if name not in given])
    return f"; did you mean {near}?" if near else ""


def choices(word: str, known: Iterable[str], given: Collection[str] = ()) -> str:
    """Return the known names, and a suggestion for a word that is not among them.

    Args:
        word: The unknown word.
        known: The names to choose from.
        given: Names that are used already. They are suggested only if no other name is similar.
    """
    names = sorted(known)
    near = suggestion(word, names, given) or suggestion(word, names)
    return (", ".join(names) or "none") + near


def corrections(given: Collection[str], known: Collection[str]) -> dict[str, str]:
    """Return the likely spelling of each unknown name. No known name is used twice.

    Args:
        given: The names as they were written.
        known: The names to choose from.
    """
    unused = [name for name in known if name not in given]
    found: dict[str, str] = {}
    for word in given if unused else ():
        if word not in known and (near := closest(word, unused)):
            found[word] = near
            unused.remove(near)
    return found
