"""Packets of Dynamixel servos: `FF FF FD 00 id length instruction parameters crc`."""

XL430, XL330_WEAK, XL330 = 1060, 1190, 1200
KOCH, KOCH_LEADER = (XL430, XL430, XL330, XL330, XL330, XL330), (XL330_WEAK,) * 6


def packet(servo: int, instruction: int, parameters: bytes) -> bytes:
    body = stuffed(bytes([instruction]) + parameters)
    head = b"\xff\xff\xfd\x00" + bytes([servo]) + (len(body) + 2).to_bytes(2, "little")
    return head + body + crc(head + body).to_bytes(2, "little")


def unpacked(received: bytes) -> tuple[int, bytes, bytes] | None:
    """Returns servo and body of the first complete packet, and the remaining bytes."""
    begin = received.find(b"\xff\xff\xfd\x00")
    while begin >= 0:
        found = received[begin:]
        size = int.from_bytes(found[5:7], "little") + 7
        if 10 <= size <= len(found) and has_crc(found[:size]):
            return found[4], unstuffed(found[7 : size - 2]), found[size:]
        begin = received.find(b"\xff\xff\xfd\x00", begin + 1)
    return None


def crc(data: bytes) -> int:
    """Computes the CRC-16 with the polynomial 0x8005."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x8005 if value & 0x8000 else 0)) & 0xFFFF
    return value


def has_crc(whole: bytes) -> bool:
    return len(whole) > 2 and crc(whole[:-2]) == int.from_bytes(whole[-2:], "little")


def stuffed(body: bytes) -> bytes:
    """Inserts an FD after each header inside a body."""
    return body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuffed(body: bytes) -> bytes:
    return body.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
