"""Encodes and decodes ROS 2 messages in CDR (OMG XCDR1), the format that DDS sends.

The offset of a value, from the end of the header, is a multiple of the value's size. In Python, a
sequence of numbers is a tuple, a sequence of 8-bit numbers is bytes, any other sequence is a list.
"""

import struct
from collections.abc import Callable
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

from .ros_types import Field, fields

Message = SimpleNamespace  # the fields of a message are attributes

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
_PADDING = 3  # largest number of bytes after a message: some writers fill up a 32-bit word

# Codes of numbers in the module `struct`.
_FORMATS = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}

_Write = Callable[[bytearray, Any], None]


def encode(name: str, message: Message) -> bytes:
    """Return a message as bytes.

    Args:
        name: Type of the message, such as `std_msgs/msg/String`.
        message: The message.

    Raises:
        AttributeError: A field of the type is missing.
        struct.error: A number is too large for its field.
    """
    body = bytearray()
    _writer(name)(body, message)
    return _HEADER + body


def decode(name: str, data: bytes) -> Message:
    """Return the message that the given bytes contain.

    Args:
        name: Type of the message, such as `std_msgs/msg/String`.
        data: The message in CDR encoding.

    Raises:
        ValueError: The bytes do not fit the type, or the type is unknown.
    """
    try:
        reader = _Reader(data)
        message = reader.message(name)
    except (struct.error, IndexError) as error:
        raise ValueError(f"its {len(data)} bytes are too few: {error}") from error
    if reader.left > _PADDING:
        raise ValueError(f"{reader.left} bytes follow its last field")
    return message


@cache
def _writer(name: str) -> _Write:
    """Return a function that appends a message of this type to a bytearray."""
    writers = [(field.name, _field_writer(field)) for field in fields(name)]

    def write(body: bytearray, message: Any) -> None:
        for attribute, write_field in writers:
            write_field(body, getattr(message, attribute))

    return write


def _field_writer(field: Field) -> _Write:
    if field.length is None:
        return _value_writer(field.type)
    write_elements = _elements_writer(field.type)
    if field.length:
        return write_elements
    write_count = _value_writer("uint32")

    def write(body: bytearray, values: Any) -> None:
        write_count(body, len(values))
        write_elements(body, values)

    return write


def _value_writer(kind: str) -> _Write:
    if kind == "string":
        return _write_text
    if code := _FORMATS.get(kind):
        return partial(_write_number, struct.Struct(f"<{code}"))
    return _writer(kind)


def _write_number(form: struct.Struct, body: bytearray, value: Any) -> None:
    body += bytes(-len(body) % form.size) + form.pack(value)


def _write_text(body: bytearray, text: str) -> None:
    data = text.encode()
    body += bytes(-len(body) % 4) + (len(data) + 1).to_bytes(4, "little") + data + b"\0"


def _elements_writer(kind: str) -> _Write:
    code = _FORMATS.get(kind)
    if code == "B":
        return bytearray.extend
    if code:
        return partial(_write_numbers, code, struct.calcsize(f"<{code}"))
    write_element = _value_writer(kind)

    def write(body: bytearray, values: Any) -> None:
        for value in values:
            write_element(body, value)

    return write


def _write_numbers(code: str, size: int, body: bytearray, values: Any) -> None:
    if len(values):
        body += bytes(-len(body) % size) + struct.pack(f"<{len(values)}{code}", *values)


class _Reader:
    """Reads the values of a message one after the other."""

    def __init__(self, data: bytes) -> None:
        self._order = "<" if data[1] & 1 else ">"
        self._body, self._at = data[len(_HEADER) :], 0

    @property
    def left(self) -> int:
        """Number of bytes that were not read yet."""
        return len(self._body) - self._at

    def message(self, name: str) -> Message:
        return Message(**{field.name: self._field(field) for field in fields(name)})

    def _field(self, field: Field) -> Any:
        if field.length is None:
            return self._value(field.type)
        count = field.length or self._number("I")
        code = _FORMATS.get(field.type)
        if code == "B":
            return self._bytes(count)
        if code:
            return self._numbers(count, code)
        return [self._value(field.type) for _ in range(count)]

    def _value(self, kind: str) -> Any:
        if kind == "string":
            return self._bytes(self._number("I"))[:-1].decode()  # without the final NUL
        code = _FORMATS.get(kind)
        return self._number(code) if code else self.message(kind)

    def _number(self, code: str) -> Any:
        (value,) = self._numbers(1, code)
        return value

    def _numbers(self, count: int, code: str) -> tuple[Any, ...]:
        form = f"{self._order}{count}{code}"
        if count:
            self._at += -self._at % struct.calcsize(f"{self._order}{code}")
        values = struct.unpack_from(form, self._body, self._at)
        self._at += struct.calcsize(form)
        return values

    def _bytes(self, count: int) -> bytes:
        if count > self.left:
            raise IndexError(f"{count} of them are missing")
        self._at += count
        return self._body[self._at - count : self._at]
