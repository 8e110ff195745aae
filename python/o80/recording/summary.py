"""The end of an MCAP file: a summary, with which readers find everything without reading it all."""

import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, McapRecord, Statistics, SummaryOffset

from o80.recording.scan import HEAD, MAGIC, Scan

OF_A_CHUNK = 128  # most bytes of the summary that a chunk adds, with one channel
OF_THE_REST = 65536


def bytes_of(*records: McapRecord) -> bytes:
    """Records as they stand in a file."""
    builder: Any = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


def end_of_file(found: Scan, size: int) -> bytes:
    """All that follows the data of a file, which has this size [bytes]."""
    data_end = bytes_of(DataEnd(0))
    summary_start = size + len(data_end)
    summary = bytearray()
    offsets = bytearray()
    for opcode, records in _groups(found):
        begin = summary_start + len(summary)
        group = bytes_of(*records)
        if group:
            summary += group
            offsets += bytes_of(SummaryOffset(opcode, begin, len(group)))
    offset_start = summary_start + len(summary)
    footer = _footer(bytes(summary + offsets), summary_start, offset_start)
    return bytes(data_end + summary + offsets + footer + MAGIC)


def room_for_end(found: Scan) -> int:
    """More bytes than the end takes after one more chunk."""
    texts = sum(len(each.data) for each in found.schemas.values())
    per_chunk = OF_A_CHUNK + 10 * len(found.channels)
    rest = 512 * len(found.channels) + 256 * (len(found.metadata) + len(found.attachments))
    return OF_THE_REST + texts + rest + per_chunk * (1 + len(found.chunks))


def _groups(found: Scan) -> Iterable[tuple[Opcode, Sequence[McapRecord]]]:
    chunks = found.chunks
    yield Opcode.SCHEMA, list(found.schemas.values())
    yield Opcode.CHANNEL, list(found.channels.values())
    statistics = Statistics(
        attachment_count=len(found.attachments),
        channel_count=len(found.channels),
        channel_message_counts=found.counts,
        chunk_count=len(chunks),
        message_count=sum(found.counts.values()),
        message_end_time=max((chunk.message_end_time for chunk in chunks), default=0),
        message_start_time=min((chunk.message_start_time for chunk in chunks), default=0),
        metadata_count=len(found.metadata),
        schema_count=len(found.schemas),
    )
    yield Opcode.STATISTICS, [statistics]
    yield Opcode.CHUNK_INDEX, chunks
    yield Opcode.ATTACHMENT_INDEX, found.attachments
    yield Opcode.METADATA_INDEX, found.metadata_places


def _footer(summary: bytes, summary_start: int, offset_start: int) -> bytes:
    """The footer record; its checksum covers the summary and itself up to the checksum."""
    head = HEAD.pack(Opcode.FOOTER, 20) + struct.pack("<QQ", summary_start, offset_start)
    return head + struct.pack("<I", zlib.crc32(head, zlib.crc32(summary)))
