"""Messages between a worker and its parent, over a pair of sockets."""

import socket
import threading
import time
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given, settings, strategies as st

from skills.motion.workers.messages import InvalidMessage, encode, receive


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    here, there = socket.socketpair()
    with here, there:
        yield here, there


@given(message=st.binary(max_size=300), cuts=st.lists(st.integers(0, 320), max_size=5))
def test_a_message_arrives_complete_in_any_number_of_pieces(
    message: bytes, cuts: list[int]
) -> None:
    here, there = socket.socketpair()
    with here, there:
        sent = encode(message)
        edges = [0, *sorted(min(cut, len(sent)) for cut in cuts), len(sent)]

        def send() -> None:
            for begin, end in pairwise(edges):
                there.sendall(sent[begin:end])

        thread = threading.Thread(target=send)
        thread.start()
        assert receive(here, time.monotonic() + 10.0) == message
        thread.join()


def test_a_message_longer_than_any_buffer(pair: tuple[socket.socket, socket.socket]) -> None:
    here, there = pair
    message = bytes(range(256)) * 20_000
    thread = threading.Thread(target=lambda: there.sendall(encode(message)))
    thread.start()
    assert receive(here) == message
    thread.join()


LENGTHS = st.integers(0, 12) | st.integers(0, 2**32 - 1)


@settings(max_examples=300)
@given(length=LENGTHS, comes=st.integers(0, 16), closes=st.booleans())
def test_invalid_messages_are_rejected_in_time(length: int, comes: int, closes: bool) -> None:
    """No pickle begins with an x."""
    here, there = socket.socketpair()
    with here, there:
        there.sendall((length.to_bytes(4) + b"x" * 12)[:comes])
        if closes:
            there.shutdown(socket.SHUT_WR)
        announced, whole = comes >= 4, comes >= 4 + length
        expected: type[Exception] = EOFError if closes else TimeoutError
        if announced and (whole or length > 2**30):
            expected = InvalidMessage
        with pytest.raises(expected):
            receive(here, time.monotonic() + (0.001 if expected is TimeoutError else 20.0))


def test_a_deadline_in_the_past(pair: tuple[socket.socket, socket.socket]) -> None:
    here, there = pair
    there.sendall(encode(1))
    with pytest.raises(TimeoutError):
        receive(here, time.monotonic())
    assert receive(here, time.monotonic() + 1.0) == 1


def test_slow_bytes_do_not_extend_the_timeout(pair: tuple[socket.socket, socket.socket]) -> None:
    """The timeout applies to the whole message, not to each piece."""
    here, there = pair
    stop = threading.Event()

    def trickle() -> None:
        there.sendall((1_000_000).to_bytes(4))
        while not stop.wait(0.001):
            there.sendall(b".")

    thread = threading.Thread(target=trickle)
    thread.start()
    with pytest.raises(TimeoutError):
        receive(here, time.monotonic() + 0.05)
    stop.set()
    thread.join()
