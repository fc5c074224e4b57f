"""Packets: the manual's examples, pieces, noise."""

from hypothesis import given, strategies as st

from hardware.drivers.feetech.packets import (
    Packet,
    read,
    sync_read,
    sync_write,
    take_packets,
    write,
)

PACKETS = st.builds(Packet, st.integers(0, 0xFE), st.integers(0, 255), st.binary(max_size=200))


def test_packets_have_the_bytes_of_the_makers_manual() -> None:
    """Its examples of ping, read, write and sync read; the sync write follows its rules."""
    assert Packet(1, 1).data.hex(" ") == "ff ff 01 02 01 fb"
    assert read(1, 0x38, 2).hex(" ") == "ff ff 01 04 02 38 02 be"
    assert write(1, 0x2A, bytes.fromhex("00080000e803")).hex(" ") == (
        "ff ff 01 09 03 2a 00 08 00 00 e8 03 d5"
    )
    assert sync_read([1, 2], 0x38, 8).hex(" ") == "ff ff fe 06 82 38 08 01 02 36"
    values = {1: bytes([0, 8]), 2: bytes([0, 8])}
    assert sync_write(0x2A, values).hex(" ") == "ff ff fe 0a 83 2a 02 01 00 08 02 00 08 35"


@given(st.lists(PACKETS, max_size=5), st.lists(st.integers(1, 40), min_size=1), st.data())
def test_packets_arrive_in_any_pieces(
    packets: list[Packet], sizes: list[int], data: st.DataObject
) -> None:
    stream, received, found = b"".join(each.data for each in packets), bytearray(), list[Packet]()
    while stream:
        size = data.draw(st.sampled_from(sizes))
        received += stream[:size]
        stream = stream[size:]
        found += take_packets(received)
    assert found == packets
    assert not received


@given(st.binary(max_size=300))
def test_noise_keeps_no_more_than_a_packet(noise: bytes) -> None:
    received = bytearray(noise)
    take_packets(received)
    assert len(received) < 256


@given(PACKETS, st.integers(0, 1000), st.integers(1, 255))
def test_a_damaged_packet_is_dropped(packet: Packet, place: int, change: int) -> None:
    data = bytearray(packet.data)
    data[place % len(data)] ^= change
    assert packet not in take_packets(data)
