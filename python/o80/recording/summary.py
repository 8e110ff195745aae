"""Writes the end of an MCAP file: a summary, so that readers need not read the whole file."""

import struct
import zlib
from collections.abc import Iterator

from mcap.opcode import Opcode
from mcap.records import DataEnd, Statistics, SummaryOffset

from o80.recording.chunks import HEAD, bytes_of
from o80.recording.scan import MAGIC, Scan

OF_A_CHUNK = 128  # most bytes that a chunk with one channel adds to the summary
OF_THE_REST = 65536


def end_of_file(found: Scan, size: int) -> Iterator[bytes | bytearray]:
    """Yields the end of a file, in pieces; size: bytes of the data before it."""
    data_end = bytes_of(DataEnd(0))
    yield data_end
    at = begin = size + len(data_end)
    offsets, checksum = b"", 0
    for opcode, group in _groups(found):
        if group:
            yield group
            offsets += bytes_of(SummaryOffset(opcode, at, len(group)))
            checksum = zlib.crc32(group, checksum)
            at += len(group)
    footer = HEAD.pack(Opcode.FOOTER, 20) + struct.pack("<QQ", begin, at)
    checksum = zlib.crc32(offsets + footer, checksum)
    yield offsets + footer + struct.pack("<I", checksum) + MAGIC


def room_for_end(found: Scan) -> int:
    """Returns an upper bound of the size of the end after one more chunk [bytes]."""
    texts = sum(len(each.data) for each in found.schemas.values())
    rest = 512 * len(found.channels) + 256 * (len(found.metadata) + len(found.attachments))
    next_chunk = OF_A_CHUNK + 10 * len(found.channels)
    return OF_THE_REST + texts + rest + len(found.chunks.records) + next_chunk


def _groups(found: Scan) -> Iterator[tuple[Opcode, bytes | bytearray]]:
    chunks = found.chunks
    yield Opcode.SCHEMA, bytes_of(*found.schemas.values())
    yield Opcode.CHANNEL, bytes_of(*found.channels.values())
    statistics = Statistics(
        attachment_count=len(found.attachments),
        channel_count=len(found.channels),
        channel_message_counts=found.counts,
        chunk_count=len(chunks),
        message_count=sum(found.counts.values()),
        message_end_time=chunks.end,
        message_start_time=chunks.start if chunks else 0,
        metadata_count=len(found.metadata),
        schema_count=len(found.schemas),
    )
    yield Opcode.STATISTICS, bytes_of(statistics)
    yield Opcode.CHUNK_INDEX, chunks.records
    yield Opcode.ATTACHMENT_INDEX, bytes_of(*found.attachments)
    yield Opcode.METADATA_INDEX, bytes_of(*found.metadata_places)
