"""Converts o80 recordings that another program has filtered, merged, compressed or sorted."""

from pathlib import Path

from mcap.exceptions import EndOfFile
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from o80.base.errors import RecordingError
from o80.base.progress import Progress
from o80.recording.blocks import Block
from o80.recording.file_writer import FileWriter, Form
from o80.recording.scan import CopiedFile, Scan, scan

BYTES = 1 << 20  # size of the messages in a chunk


def copied(path: Path) -> Scan:
    """Copies a file into the layout that o80 needs, chunks with indexes, and scans the copy.

    Of a truncated file the whole records are copied. Raises RecordingError (damaged), OSError.
    """
    copy = CopiedFile(path.name)
    writer = FileWriter(copy.path, Form("lz4"))
    try:
        _Copier(writer).copy(path)
    finally:
        writer.finish()
    found = scan(copy.path)
    found.copy = copy
    return found


class _Copier:
    def __init__(self, writer: FileWriter) -> None:
        self._writer = writer
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, int] = {}  # channel in the copy by channel in the original
        self._waiting: dict[int, list[tuple[int, bytes]]] = {}
        self._bytes = 0

    def copy(self, path: Path) -> None:
        size = path.stat().st_size
        progress = Progress(f"{path} was written by another program: it is copied to be read")
        with path.open("rb") as file, progress:
            try:
                for record in StreamReader(file).records:
                    self._take(record)
                    if not self._waiting:  # a chunk was written
                        progress.at(file.tell() / size)
            except EndOfFile:
                pass
            except Exception as error:  # each compression library has exceptions of its own
                raise RecordingError(f"{path} is damaged: {error!r:.200}") from error
        self._flush()

    def _take(self, record: object) -> None:
        match record:
            case Message():
                message = record.log_time, record.data
                self._waiting.setdefault(self._channels[record.channel_id], []).append(message)
                self._bytes += len(record.data)
                if self._bytes >= BYTES:
                    self._flush()
            case Schema():
                self._schemas[record.id] = record
            case Channel() if record.id not in self._channels:
                self._channels[record.id] = self._writer.copy_channel(
                    record, self._schemas, record.metadata
                )
            case Attachment():
                self._writer.attach(record.name, record.media_type, record.data, record.create_time)
            case Metadata():
                self._writer.add_metadata(record.name, record.metadata)

    def _flush(self) -> None:
        if self._waiting:
            self._writer.add_messages([Block.of(*each) for each in self._waiting.items()])
        self._waiting, self._bytes = {}, 0
