"""FIT files made byte by byte, as the protocol describes them, without any code of the package or of a FIT library."""

import struct
from dataclasses import dataclass, field

FIT_EPOCH_S = 631_065_600
FILE_ID, SESSION, RECORD, FIELD_DESCRIPTION, DEVELOPER_DATA_ID = 0, 18, 20, 206, 207
ENUM, UINT8, SINT16, UINT16, SINT32, UINT32, STRING, FLOAT32, BYTE = (
    *(0x00, 0x02, 0x83, 0x84, 0x85, 0x86, 0x07, 0x88),
    0x0D,
)
_PACKED = {ENUM: "B", UINT8: "B", SINT16: "h", UINT16: "H", SINT32: "i", UINT32: "I", FLOAT32: "f"}
_NIBBLES = (
    *(0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401),
    *(0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400),
)


@dataclass
class Message:
    """Number of the message; base type and value by number of the field; the same of developer fields."""

    number: int
    fields: dict[int, tuple[int, object]]
    developer: dict[int, tuple[int, object]] = field(default_factory=dict)

    def packed(self) -> bytes:
        """Definition and data, as local message 0."""
        values = [_value(*one) for one in self.fields.values()]
        own = [_value(*one) for one in self.developer.values()]
        head = struct.pack("<BBBHB", 0x60 if own else 0x40, 0, 0, self.number, len(values))
        for number, (kind, _), value in zip(self.fields, self.fields.values(), values, strict=True):
            head += struct.pack("BBB", number, len(value), kind)
        if own:
            head += struct.pack("B", len(own))
            for number, value in zip(self.developer, own, strict=True):
                head += struct.pack("BBB", number, len(value), 0)
        return head + b"\x00" + b"".join(values) + b"".join(own)


def fit_file(messages: list[Message]) -> bytes:
    """A whole file with its checksums."""
    return closed(b"".join(message.packed() for message in messages))


def closed(body: bytes) -> bytes:
    """Messages between header and checksum."""
    head = struct.pack("<BBHI4s", 14, 0x20, 2132, len(body), b".FIT")
    head += struct.pack("<H", crc(head))
    return head + body + struct.pack("<H", crc(head + body))


def crc(contents: bytes) -> int:
    """CRC-16 of the FIT protocol, half a byte at a time."""
    found = 0
    for byte in contents:
        for nibble in (byte & 0xF, byte >> 4):
            found = (found >> 4) ^ _NIBBLES[found & 0xF] ^ _NIBBLES[nibble]
    return found


def described(number: int, kind: int, name: str, unit: str, scale: int | None = None) -> Message:
    """A field_description of a developer field."""
    fields = {0: (UINT8, 0), 1: (UINT8, number), 2: (UINT8, kind), 3: (STRING, name), 8: (STRING, unit)}
    return Message(FIELD_DESCRIPTION, fields | ({} if scale is None else {6: (UINT8, scale)}))


def watch(seconds: int, start_s: int = 1_777_620_600 - FIT_EPOCH_S, sport: int = 15) -> list[Message]:
    """What a watch writes every second: position, distance, speed, heart rate, cadence, count of its own."""
    records = [
        Message(
            RECORD,
            {
                253: (UINT32, start_s + k),
                0: (SINT32, round((48.25 + 1e-5 * k) * 2**31 / 180.0)),
                1: (SINT32, round(11.5 * 2**31 / 180.0)),
                5: (UINT32, 400 * k),
                73: (UINT32, 4000),
                3: (UINT8, 130 + k % 3),
                4: (UINT8, 24),
                19: (UINT32, k * 24 // 60),
            },
        )
        for k in range(seconds)
    ]
    session = Message(SESSION, {253: (UINT32, start_s + seconds), 2: (UINT32, start_s), 5: (ENUM, sport)})
    return [Message(FILE_ID, {0: (ENUM, 4)}), *records, session]


def _value(kind: int, value: object) -> bytes:
    if kind == STRING:
        return str(value).encode() + b"\x00"
    if kind == BYTE:
        assert isinstance(value, bytes)
        return value
    return struct.pack("<" + _PACKED[kind], value)
