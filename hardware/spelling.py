"""Suggestions for misspelt names ("did you mean ...?"), and lists of known names."""

from collections.abc import Collection, Iterable
from itertools import groupby

_ALL = 8  # a message lists all names if there are at most this many
_SHOWN = 5  # largest number of names in a message if there are more
_NEAR, _NEARER = 0.6, 0.71  # smallest similarity to list a name, and to suggest it
_LEAST_BEGIN = 3  # fewest letters of an abbreviation
_OTHER_START = 0.75  # factor for names with another first letter, which few people mistype


def closest(word: str, known: Iterable[str], cutoff: float = _NEAR) -> str:
    """Return the known name that is most similar to a word; empty if none is similar.

    Case and signs between words do not count. If several names are equally similar, the result
    is empty. If none is similar, the result is the only name that begins with the word.

    Args:
        word: The unknown word.
        known: The known names.
        cutoff: Smallest similarity, from 0 (any name) to 1 (only the word itself).
    """
    known = [*known]
    for similarity, group in groupby(_by_similarity(word, known), lambda each: each[0]):
        names = [name for _, name in group]
        begun = [name for name in names if name.startswith(word)]
        (best, *more) = begun or names
        if similarity >= cutoff:
            return best if not more else ""
        break
    begins = [name for name in known if _folded(name).startswith(_folded(word))]
    short = cutoff == _NEAR and len(word) >= _LEAST_BEGIN
    return begins[0] if short and len(begins) == 1 else ""


def _by_similarity(word: str, known: Iterable[str]) -> list[tuple[float, str]]:
    """Return the known names with their similarities to a word, most similar name first."""
    from difflib import SequenceMatcher  # slow to load, and only error messages need it

    folded = _folded(word)
    matcher = SequenceMatcher(b=folded)
    found = []
    for name in known:
        other = _folded(name)
        matcher.set_seq1(other)
        similarity = matcher.ratio()
        turned = not word.isalnum() and sorted(other) == sorted(folded)  # such as `=>` for `>=`
        # `1` or `J1` for `joint_1`
        digits = folded[1:] if folded[:1].isalpha() else folded
        short = digits.isdecimal() and other.startswith(folded.removesuffix(digits))
        numbered = short and other.removesuffix(digits).isalpha()
        if turned or numbered:
            similarity = 0.9
        elif other[:1] != folded[:1] and other not in folded and folded not in other:
            similarity *= _OTHER_START
        found.append((similarity, name))
    return sorted(found, key=lambda each: (-each[0], each[1]))


def _folded(name: str) -> str:
    """Return a name in lower case, without signs between words."""
    return "".join(filter(str.isalnum, name)).lower() or name


def did_you_mean(near: str) -> str:
    """Return `; did you mean NEAR?`; empty for an empty text."""
    return f"; did you mean {near}?" if near else ""


def suggested(words: str) -> str:
    """Return NAME if a message ends with `; did you mean NAME?`; else an empty text."""
    name = words.removesuffix("?").rpartition("; did you mean ")[2]
    return name if words.endswith(did_you_mean(name)) and " " not in name else ""


def suggestion(word: str, known: Iterable[str], given: Collection[str] = ()) -> str:
    """Return `; did you mean NAME?`; empty if no known name is similar.

    Args:
        word: The unknown word.
        known: The known names.
        given: Names that are already used. They are not suggested.
    """
    return did_you_mean(closest(word, [name for name in known if name not in given]))


def there_are(word: str, known: Iterable[str], given: Collection[str] = ()) -> str:
    """Return words that list the known names, such as `there are NAMES`.

    If there are many names, the words have only the similar names, or the first ones if none is
    similar. If one name is very similar, the words are `did you mean NAME?`.
    """
    names = tuple(known)
    if len(names) == 1:
        return f"there is only {names[0]}"
    if len(names) <= _ALL:
        return f"there are {choices(word, names, given)}"
    found = _similar(word, names)
    if not found:
        return f"there are {', '.join(names[:_SHOWN])} and {len(names) - _SHOWN} more"
    if near := closest(word, names, _NEARER):
        return f"did you mean {near}?"
    return f"the most similar {'is' if len(found) == 1 else 'are'} {', '.join(found)}"


def there_are_numbers(number: int, known: Iterable[int]) -> str:
    """Return `there are NUMBERS`; if there are many, only the ones nearest to `number`."""
    numbers = sorted(known)
    if len(numbers) <= _ALL:
        return f"there are {', '.join(map(str, numbers)) or 'none'}"
    near = sorted(numbers, key=lambda each: abs(each - number))[:_SHOWN]
    return f"the nearest of {len(numbers)} are {', '.join(map(str, sorted(near)))}"


def choices(word: str, known: Iterable[str], given: Collection[str] = ()) -> str:
    """Return the known names, and a suggestion for an unknown word, as a text.

    If there are many names, the text has only similar names and the number of the others.

    Args:
        word: The unknown word.
        known: The known names.
        given: Names that are already used. They are suggested only if no other name is similar.
    """
    names = sorted(known)
    if len(names) <= _ALL:
        near = suggestion(word, names, given) or suggestion(word, names)
        return (", ".join(names) or "none") + near
    found = _similar(word, names) or names[:_SHOWN]
    near = did_you_mean(closest(word, names, _NEARER))
    return f"{', '.join(found)} and {len(names) - len(found)} more{near}"


def _similar(word: str, known: Iterable[str]) -> list[str]:
    """Return the names that are similar enough to a word to list them."""
    found = [name for similarity, name in _by_similarity(word, known) if similarity >= _NEAR]
    return found[:_SHOWN]


def corrections(given: Collection[str], known: Collection[str]) -> dict[str, str]:
    """Return the likely spelling of each unknown name. No known name is used twice.

    Args:
        given: The unknown names.
        known: The known names.
    """
    unused = [name for name in known if name not in given]
    found: dict[str, str] = {}
    for word in given if unused else ():
        if word not in known and (near := closest(word, unused)):
            found[word] = near
            unused.remove(near)
    return found
