"""Pictures from files, folders, videos, devices and streams, always as BGR bytes."""

from __future__ import annotations

import os
import threading
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic

import cv2
import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import CameraLost, InputError, MissingFile
from arm3dof.files import unreadable
from arm3dof.vision.colour import Image, check_image
from arm3dof.vision.stream import mjpeg_parts

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff", ".ppm", ".pgm")
VIDEO_SUFFIXES = (".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v")

_MOST_DAMAGED = 10  # pictures of a stream one after another
_STDERR = threading.Lock()


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a source.

    Attributes:
        image: BGR picture, shape (h, w, 3), uint8.
        name: where it came from, for people to read.
        t: time since the source's first picture [s].
    """

    image: Image
    name: str
    t: float


def read_image(path: str | Path) -> Image:
    """Read a picture file.

    Grey and 16-bit pictures become BGR bytes; what is transparent shows white.

    Args:
        path: a file in a format that OpenCV reads.

    Returns:
        BGR picture, shape (h, w, 3), uint8.

    Raises:
        MissingFile: there is no such file, or it may not be read.
        InputError: the file is empty, cut short or no picture.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder; give one picture file")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(str(path), error, "give a picture file") from None
    return decode_image(data, str(path))


def decode_image(data: bytes, name: str) -> Image:
    """Decode the bytes of a picture file.

    Args:
        data: the file's bytes.
        name: what messages call it.

    Returns:
        BGR picture, shape (h, w, 3), uint8; see ``read_image``.

    Raises:
        InputError: the data is empty, cut short, no picture, or one too large to hold.
    """
    if not data:
        raise InputError(f"{name} is empty; give a picture file")
    if _is_cut_short(data):
        raise InputError(f"{name} is cut short: its end is missing; copy or download it again")
    try:
        with _quiet_stderr():
            raw = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError):
        raw = None
    if raw is None:
        raise InputError(
            f"{name} is not a picture that can be read, is damaged or too large; give a whole PNG, "
            "JPEG, BMP, TIFF or WebP file"
        )
    return to_bgr(np.asarray(raw))


def to_bgr(image: NDArray[np.generic]) -> Image:
    """Turn a grey, BGR or BGRA picture of 8 or 16 bits into BGR bytes.

    Args:
        image: shape (h, w), (h, w, 1), (h, w, 3) or (h, w, 4), uint8 or uint16.

    Returns:
        Shape (h, w, 3), uint8; what is transparent shows white.

    Raises:
        InputError: the array has another shape or type, or no pixels.
    """
    array = np.atleast_3d(image)
    known = array.dtype in (np.uint8, np.uint16) and array.ndim == 3 and array.shape[2] in (1, 3, 4)
    if not known:
        raise InputError(
            f"the picture has shape {image.shape} and type {image.dtype}; give grey, BGR or BGRA "
            "of 8 or 16 bits"
        )
    if array.dtype == np.uint16:
        array = (array.astype(np.uint32) * 255 + 32767) // 65535
    if array.shape[2] == 1:
        array = np.repeat(array, 3, axis=2)
    if array.shape[2] == 4:
        alpha = array[:, :, 3:].astype(np.uint32)
        array = (array[:, :, :3] * alpha + 255 * (255 - alpha) + 127) // 255
    return check_image(array.astype(np.uint8))


def write_image(path: str | Path, image: NDArray[np.generic]) -> Path:
    """Write a picture file, in the format that the name's ending says.

    Args:
        path: where to; folders on the way are made.
        image: BGR picture, shape (h, w, 3), uint8.

    Returns:
        The path.

    Raises:
        InputError: ``image`` is not a BGR picture, the ending is no picture format, or the
            file cannot be written.
    """
    path = Path(path)
    picture = check_image(image)
    if path.suffix.lower() not in IMAGE_SUFFIXES:
        raise InputError(
            f"{path} does not end in a picture format; use one of: {', '.join(IMAGE_SUFFIXES)}"
        )
    _, data = cv2.imencode(path.suffix, picture)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.tobytes())
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(f"cannot write {path}: {reason}; give a place to write to") from None
    return path


def frames(source: str | Path | int, *, timeout: float = 5.0) -> Generator[Frame]:
    """Go through the pictures of a source.

    Args:
        source: a picture file (one frame), a folder (its pictures by name), a video file, the
            number of a camera device, or the address of an MJPEG stream, ``http://...``.
        timeout: the longest wait for a picture of a stream [s].

    Yields:
        The frames in order. A folder's pictures count as one a second.

    Raises:
        MissingFile: there is no such file or folder.
        InputError: a picture, video or stream cannot be read, or a folder has no pictures.
        CameraLost: a device or stream gives no more pictures.
    """
    if isinstance(source, int):
        yield from _live(_captured(source, f"camera {source}"), f"camera {source}")
        return
    if is_stream(source):
        yield from _streamed(str(source), timeout)
        return
    path = Path(source)
    if path.is_dir():
        try:
            found = sorted(it for it in path.iterdir() if it.suffix.lower() in IMAGE_SUFFIXES)
        except OSError as error:  # it went, or may not be read
            raise unreadable(str(path), error, "give a folder of pictures") from None
        if not found:
            raise InputError(f"{path} holds no pictures; give a folder with PNG or JPEG files")
        for count, it in enumerate(found):
            yield Frame(read_image(it), str(it), float(count))
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        if not path.is_file():
            raise MissingFile(f"there is no video {path}; check the path")
        yield from _captured(str(path), str(path))
    else:
        yield Frame(read_image(path), str(path), 0.0)


def is_stream(source: str | Path | int) -> bool:
    """Whether a source is an address rather than a path or a device."""
    return isinstance(source, str) and source.lower().startswith(("http://", "https://"))


def _streamed(url: str, timeout: float) -> Iterator[Frame]:
    """Decode a stream's pictures; some that the way has damaged are passed over."""
    start, damaged = monotonic(), 0
    with closing(mjpeg_parts(url, timeout)) as parts:
        for count, part in enumerate(parts):
            name = f"{url} frame {count}"
            try:
                image = decode_image(part, name)
            except InputError:
                damaged += 1
                if damaged > _MOST_DAMAGED:
                    raise
                continue
            damaged = 0
            yield Frame(image, name, monotonic() - start)


def _live(captured: Iterator[Frame], name: str) -> Iterator[Frame]:
    """Give a device's frames the time at which they come; its end is a loss."""
    start = None
    for frame in captured:
        start = monotonic() if start is None else start
        yield replace(frame, t=monotonic() - start)
    raise CameraLost(f"{name} gives no more pictures; check its cable")


def _captured(source: str | int, name: str) -> Iterator[Frame]:
    with _quiet_stderr():
        capture = cv2.VideoCapture(source)
    try:
        if not capture.isOpened():
            what = "is not connected" if isinstance(source, int) else "is not a video"
            raise InputError(f"{name} {what} or cannot be opened; check it with another program")
        rate = float(capture.get(cv2.CAP_PROP_FPS)) or 30.0
        count = 0
        while True:
            # a device may be slow to answer, and others need their stderr meanwhile
            with nullcontext() if isinstance(source, int) else _quiet_stderr():
                read, image = capture.read()
            if not read:
                break
            yield Frame(to_bgr(np.asarray(image)), f"{name} frame {count}", count / rate)
            count += 1
        if count == 0:
            raise InputError(f"{name} gives no pictures; check it with another program")
    finally:
        capture.release()


def _is_cut_short(data: bytes) -> bool:
    """Whether a PNG or JPEG lacks its end: some decoders would fill in grey without a word."""
    if data.startswith(b"\x89PNG"):
        return b"IEND" not in data[-64:] and b"IEND\xaeB`\x82" not in data
    if data.startswith(b"\xff\xd8"):
        # a thumbnail in the header ends too, but before the scan of the picture itself
        return data.rfind(b"\xff\xd9") <= data.rfind(b"\xff\xda")
    return False


@contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Keep what the codecs write to the process's stderr off it; the caller says it in one line."""
    with _STDERR:
        try:
            kept = os.dup(2)
        except OSError:  # there is no stderr to keep clean
            yield
            return
        try:
            sink = os.open(os.devnull, os.O_WRONLY)
            os.dup2(sink, 2)
            os.close(sink)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
