"""Responses of a server. They are bounded and checked, because another program may answer."""

from collections.abc import Iterator
from functools import cache
from typing import Any

from executive.api import strict_json
from executive.api.events import Event, event_from_json
from executive.api.operations import OPERATIONS
from executive.api.outcome import Cause
from executive.api.schemas import ERROR, inlined
from executive.errors import Refused, WrongAnswer
from logs.records.field_types import has_type

MAX_BYTES = 4 * 1024 * 1024  # largest size of an answer or of an event


class ResponseBody:
    """Collects and checks the body of a response.

    Args:
        url: URL of the server.
        status: HTTP status of the response.
    """

    def __init__(self, url: str, status: int) -> None:
        self._url, self._status = url, status
        self._data = bytearray()

    def add(self, piece: bytes) -> None:
        """Add a piece of the body.

        Raises:
            WrongAnswer: The body is too long.
        """
        self._data += piece
        if len(self._data) > MAX_BYTES:
            raise WrongAnswer(self._url, f"its answer has more than {MAX_BYTES >> 20} MiB")

    def value(self, name: str) -> Any:
        """Return the JSON of an answer that has ended.

        Args:
            name: Name of the operation.

        Raises:
            Refused: The answer is an error.
            WrongAnswer: The response is not an answer of this operation.
        """
        try:
            value = strict_json.parse(bytes(self._data))
        except strict_json.NotJson as error:
            value, wrong = None, f"it answers {self._status} without JSON"
            raise WrongAnswer(self._url, wrong) from error
        if self._status >= 400 and _fits_schema("", value):
            raise Refused(Cause.from_json(value))
        if self._status != OPERATIONS[name].status or not _fits_schema(name, value):
            raise WrongAnswer(self._url, f"it answers {self._status} with wrong fields")
        if name == "plan":  # its schema does not have the fields of events
            for event in value["events"]:
                _event(self._url, event)
        return value


class EventReader:
    """Reads events from a stream.

    Args:
        url: URL of the server.
    """

    def __init__(self, url: str) -> None:
        self._url, self._rest = url, bytearray()

    def read(self, piece: bytes) -> Iterator[Event]:
        """Add a piece of the stream, and yield the events that it completes.

        Raises:
            WrongAnswer: The stream has other events than armtree's.
        """
        complete, newline, rest = piece.rpartition(b"\n")
        lines = list[bytes]()
        if newline:
            lines = bytes(self._rest + complete).split(b"\n")
            self._rest = bytearray()
        self._rest += rest
        if len(self._rest) > MAX_BYTES:
            raise WrongAnswer(self._url, f"an event has more than {MAX_BYTES >> 20} MiB")
        for line in lines:
            if line.startswith(b"data: "):
                yield self._parsed(line.removeprefix(b"data: "))

    def _parsed(self, text: bytes) -> Event:
        try:
            plain = strict_json.parse(text)
        except strict_json.NotJson as error:
            raise WrongAnswer(self._url, "it sends events without JSON") from error
        return _event(self._url, plain)


def _event(url: str, plain: Any) -> Event:
    """Return the event of a JSON value. Raise WrongAnswer if it is not an event."""
    try:
        event = event_from_json(plain)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise WrongAnswer(url, "it sends unknown events") from error
    if not has_type(event, type(event)):
        raise WrongAnswer(url, "it sends events with wrong fields")
    return event


@cache
def _checker(name: str) -> Any:
    import fastjsonschema  # slow to import

    answer = OPERATIONS[name].answer if name else ERROR
    return fastjsonschema.compile(inlined(answer), detailed_exceptions=False)  # in half the time


def _fits_schema(name: str, value: Any) -> bool:
    """Return True if a value fits the answer of an operation; for an empty name, an error."""
    import fastjsonschema

    try:
        _checker(name)(value)
    except fastjsonschema.JsonSchemaValueException:
        return False
    return True
