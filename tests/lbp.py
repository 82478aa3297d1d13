"""LBP as plain Python, bit by bit: what the remote is tested against (sserial.md 4)."""

from hostmot2.emulator import EmulatedRemote


def crc8(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8C if crc & 1 else 0)
    return crc


def with_crc(data: bytes) -> bytes:
    return data + bytes([crc8(data)])


def ask(remote: EmulatedRemote, *frame: int | bytes) -> bytes | None:
    """Send a frame; the answer without its CRC, None for silence."""
    data = b"".join(part if isinstance(part, bytes) else bytes([part]) for part in frame)
    answer = remote.exchange(with_crc(data))
    if not answer:
        return None
    assert crc8(answer) == 0, answer.hex(" ")
    return answer[:-1]


def read(remote: EmulatedRemote, address: int, size: int = 1) -> bytes | None:
    return ask(remote, 0x44 | size.bit_length() - 1, address.to_bytes(2, "little"))


def write(remote: EmulatedRemote, address: int, data: bytes) -> bytes | None:
    return ask(remote, 0x64 | len(data).bit_length() - 1, address.to_bytes(2, "little"), data)


def clear_faults(remote: EmulatedRemote) -> None:
    assert ask(remote, 0xE7, 0xFF) == b""
    while ask(remote, 0xC7) != b"\0":
        pass
