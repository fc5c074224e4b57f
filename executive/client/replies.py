"""What comes back: an answer, a refusal, or nothing."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from .errors import Refused, ServerUnreachable

if TYPE_CHECKING:
    import httpx


@contextmanager
def reached(url: str, silence: float = 0.0) -> Iterator[None]:
    """Say of whatever fails on the way that the server could not be reached.

    Args:
        url: Of the server.
        silence: How long it may say nothing of what is read [s]; 0 where that is not known.

    Raises:
        ServerUnreachable: It could not.
    """
    import httpx

    try:
        yield
    except httpx.ReadTimeout as error:
        words = f"nothing came for {silence:g} s" if silence else "its answer takes too long"
        raise ServerUnreachable(url, words) from error
    except httpx.TransportError as error:
        raise ServerUnreachable(url, str(error) or type(error).__name__) from error


def check(response: "httpx.Response") -> None:
    """Pass an answer that is none of an error.

    Raises:
        Refused: The server says no.
    """
    if not response.is_error:
        return
    try:
        told = json.loads(response.content)
    except ValueError:  # not ours; the status is all there is
        told = None
    words = {"message": f"{response.url} answers {response.status_code}"}
    raise Refused(told if isinstance(told, dict) else words)
