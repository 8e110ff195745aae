"""GenICam cameras by the library aravis (GigE Vision, USB3 Vision), called through ctypes."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable
from ctypes import (
    POINTER,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_uint32,
    c_uint64,
    c_void_p,
)
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from o80.base.arrays import Image
from o80.errors import DriverError

LIBRARIES = ("libaravis-0.8.so.0", "libgobject-2.0.so.0", "libglib-2.0.so.0")
BUFFERS = 8
"""Number of queued images; more arrivals are underruns."""
SUCCESS = 0
STATUS = {
    1: "cleared",
    2: "timed out",
    3: "packets are missing",
    4: "a packet has a wrong number",
    5: "a packet is larger than the image",
    7: "aborted",
}
"""Texts of the buffer states (ArvBufferStatus)."""


class _Error(ctypes.Structure):
    _fields_ = (("domain", c_uint32), ("code", c_int), ("message", c_char_p))


class CameraError(OSError):
    """A request to a camera failed."""


@cache
def _libraries() -> tuple[Any, Any, Any]:
    try:
        loaded = [ctypes.CDLL(name) for name in LIBRARIES]
    except OSError as error:
        raise DriverError(
            f"GenICam cameras need the library aravis 0.8 ({error}): apt-get install "
            "libaravis-0.8-0"
        ) from None
    aravis, gobject, glib = loaded
    gobject.g_object_unref.argtypes = (c_void_p,)
    glib.g_error_free.argtypes = (c_void_p,)
    return aravis, gobject, glib


@cache
def function(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """Returns a function of the library. Raises DriverError if aravis cannot be loaded."""
    found = getattr(_libraries()[0], name)
    found.restype, found.argtypes = result, arguments
    return found  # type: ignore[no-any-return]


def checked(name: str, result: Any, *arguments: Any) -> Callable[..., Any]:
    """Wraps a function whose last argument is a GError**: a failed call raises CameraError."""
    called = function(name, result, *arguments, POINTER(POINTER(_Error)))

    def call(*values: Any) -> Any:
        error = POINTER(_Error)()
        returned = called(*values, byref(error))
        if error:
            message = (error.contents.message or b"").decode(errors="replace")
            _libraries()[2].g_error_free(error)
            raise CameraError(message or name)
        return returned

    return call


def found() -> list[str]:
    """Lists the names of the cameras that answer. Raises DriverError without aravis."""
    function("arv_update_device_list", None)()
    count = function("arv_get_n_devices", c_uint)()
    name = function("arv_get_device_id", c_char_p, c_uint)
    return [name(k).decode(errors="replace") for k in range(count)]


@dataclass(frozen=True)
class Settings:
    """Settings of a camera; 0 and empty values leave the camera unchanged."""

    pixel_format: str
    region: tuple[int, int, int, int]
    """x, y, width, height [px]"""
    rate: float = 0.0
    """Frame rate [1/s]."""
    exposure: float = 0.0
    """Exposure time [s]."""
    trigger: str = ""


@dataclass(frozen=True)
class Buffer:
    """Buffer received from the camera."""

    status: int
    number: int
    """Number of the frame; GigE Vision wraps from 65535 to 1."""
    stamp: int
    """Stamp of the camera [ns]; 0: none."""
    content: Image
    """Bytes of the image; empty if it is damaged."""
    size: tuple[int, int]
    """Width and height [px]."""


class Camera:
    """An open camera that sends images. Owns the connection: close it."""

    def __init__(self, name: str, settings: Settings) -> None:
        """Opens a camera. name: one of `found()`, an address, or Fake_1. Raises CameraError."""
        self._stream: int | None = None
        if name.startswith("Fake"):
            function("arv_enable_interface", None, c_char_p)(b"Fake")
        self._camera: int | None = checked("arv_camera_new", c_void_p, c_char_p)(name.encode())
        try:
            self._set_up(settings)
            self._begin()
        except BaseException:
            self.abandon()
            raise

    def pop(self, timeout: float) -> Buffer | None:
        """Returns the next image; None if none arrives within `timeout` [s]."""
        pop = function("arv_stream_timeout_pop_buffer", c_void_p, c_void_p, c_uint64)
        buffer = pop(self._stream, round(1e6 * timeout))
        if buffer is None:
            return None
        try:
            return _read(buffer)
        finally:
            function("arv_stream_push_buffer", None, c_void_p, c_void_p)(self._stream, buffer)

    def check(self) -> None:
        """Raises CameraError if the camera does not answer."""
        checked("arv_camera_get_payload", c_uint, c_void_p)(self._camera)

    def close(self) -> None:
        if self._camera is not None and self._stream is not None:
            with contextlib.suppress(CameraError):
                checked("arv_camera_stop_acquisition", None, c_void_p)(self._camera)
        self.abandon()

    def abandon(self) -> None:
        """Closes a camera that does not answer; aravis retries each step, for up to 8 s."""
        camera, stream, self._camera, self._stream = self._camera, self._stream, None, None
        for each in (stream, camera):
            if each is not None:
                _libraries()[1].g_object_unref(each)

    def _set_up(self, settings: Settings) -> None:
        set_text = checked("arv_camera_set_pixel_format_from_string", None, c_void_p, c_char_p)
        set_text(self._camera, settings.pixel_format.encode())
        region = checked("arv_camera_set_region", None, c_void_p, c_int, c_int, c_int, c_int)
        region(self._camera, *settings.region)
        if settings.trigger:
            trigger = checked("arv_camera_set_trigger", None, c_void_p, c_char_p)
            trigger(self._camera, settings.trigger.encode())
        elif settings.rate > 0:
            rate = checked("arv_camera_set_frame_rate", None, c_void_p, c_double)
            rate(self._camera, settings.rate)
        if settings.exposure > 0:
            exposure = checked("arv_camera_set_exposure_time", None, c_void_p, c_double)
            exposure(self._camera, 1e6 * settings.exposure)

    def _begin(self) -> None:
        create = checked("arv_camera_create_stream", c_void_p, c_void_p, c_void_p, c_void_p)
        self._stream = create(self._camera, None, None)
        size = checked("arv_camera_get_payload", c_uint, c_void_p)(self._camera)
        push = function("arv_stream_push_buffer", None, c_void_p, c_void_p)
        for _ in range(BUFFERS):
            made = function("arv_buffer_new_allocate", c_void_p, c_size_t)(size)
            push(self._stream, made)  # the stream now owns the buffer
        checked("arv_camera_start_acquisition", None, c_void_p)(self._camera)


def _read(buffer: int) -> Buffer:
    status = function("arv_buffer_get_status", c_int, c_void_p)(buffer)
    content, size = np.empty(0, np.uint8), (0, 0)
    if status == SUCCESS:
        length = c_size_t()
        data = function("arv_buffer_get_image_data", c_void_p, c_void_p, POINTER(c_size_t))
        place = data(buffer, byref(length))
        if place is not None and length.value:
            content = np.frombuffer(ctypes.string_at(place, length.value), np.uint8)
        width = function("arv_buffer_get_image_width", c_int, c_void_p)(buffer)
        size = (width, function("arv_buffer_get_image_height", c_int, c_void_p)(buffer))
    return Buffer(
        status,
        function("arv_buffer_get_frame_id", c_uint64, c_void_p)(buffer),
        function("arv_buffer_get_timestamp", c_uint64, c_void_p)(buffer),
        content,
        size,
    )
