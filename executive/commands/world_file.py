"""The bodies around the arm, from a file of their own."""

import json
from pathlib import Path

from skills.motion import BadWorld, World
from trees import FileError, Mistake, Place


class BadWorldFile(FileError):
    """A file of bodies is wrong."""

    code = "file.world"


def read_world(file: Path) -> World:
    """The bodies of a JSON file, as the README has it.

    Raises:
        BadWorldFile: It cannot be read, or holds no list of bodies.
    """
    try:
        return World.parse(json.loads(file.read_text(encoding="utf-8")))
    except BadWorld as error:
        raise _wrong(Place(file, 0, 0), str(error)) from error
    except OSError as error:
        raise _wrong(Place(file, 0, 0), f"cannot be read: {error.strerror}") from error
    except json.JSONDecodeError as error:
        why = f"is no JSON: {error.msg}"
        lines = error.doc.splitlines()
        raise _wrong(Place(file, error.lineno, error.colno, lines=lines), why) from error
    except (ValueError, RecursionError) as error:  # no UTF-8, a huge number, nested too deep
        raise _wrong(Place(file, 0, 0), f"is no JSON: {error}") from error


def _wrong(place: Place, why: str) -> BadWorldFile:
    return BadWorldFile([Mistake(place, why)])
