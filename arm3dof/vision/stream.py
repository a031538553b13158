"""Pictures from an MJPEG stream: JPEG files one after another in an HTTP answer that never ends."""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from collections.abc import Generator
from contextlib import closing
from time import monotonic

from arm3dof.errors import CameraLost, InputError

_LINE = 8192  # the longest line of a header
_PART = 64 * 2**20  # the largest picture
_CHUNK = 65536


def mjpeg_parts(url: str, timeout: float = 5.0) -> Generator[bytes]:
    """Yield the pictures of a stream as they come, each a JPEG file.

    Args:
        url: ``http://...``, answered by ``multipart/x-mixed-replace``, or by one picture.
        timeout: the longest wait for the answer, and then for each picture [s].

    Raises:
        InputError: nothing answers there, or it is no such stream.
        CameraLost: the stream has ended or stopped in the midst.
    """
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        answer = opener.open(url, timeout=timeout)
    except urllib.error.HTTPError as error:
        error.close()
        raise InputError(f"{url} answers {error.code} {error.reason}; check the address") from None
    except (OSError, http.client.HTTPException, ValueError) as error:
        reason = " ".join(str(getattr(error, "reason", None) or error).split())
        raise InputError(f"{url} cannot be opened: {reason}; is the camera on?") from None
    with closing(answer):
        kind = answer.headers.get_content_type()
        reader = _Reader(answer, url, timeout)
        if kind.startswith("image/"):
            yield reader.rest()
            return
        boundary = answer.headers.get_param("boundary")
        if not kind.startswith("multipart/") or not isinstance(boundary, str):
            raise InputError(f"{url} is '{kind}'; give the address of an MJPEG stream")
        yield from _parts(reader, boundary.strip('"').removeprefix("--").encode())


def _parts(reader: _Reader, boundary: bytes) -> Generator[bytes]:
    mark = b"--" + boundary
    while True:
        reader.begin()
        while not (line := reader.line()).startswith(mark):
            pass
        if line.startswith(mark + b"--"):
            raise reader.lost("has ended")
        length = None
        while line := reader.line():
            name, _, value = line.partition(b":")
            if name.strip().lower() == b"content-length" and value.strip().isdigit():
                length = int(value)
        yield reader.until(b"\r\n" + mark) if length is None else reader.exactly(length)


class _Reader:
    """Reads from an answer, each picture with a deadline, so that a trickle does not hold us."""

    def __init__(self, answer: http.client.HTTPResponse, url: str, timeout: float) -> None:
        self._answer, self._url, self._timeout = answer, url, timeout
        self._kept = bytearray()
        self.begin()

    def begin(self) -> None:
        """Start the clock for the next picture."""
        self._deadline = monotonic() + self._timeout

    def lost(self, how: str) -> CameraLost:
        """Return the error that says how the stream was lost."""
        return CameraLost(f"{self._url} {how}; check the camera")

    def line(self) -> bytes:
        """Read a line, without its end."""
        while (end := self._kept.find(b"\n")) < 0:
            if len(self._kept) > _LINE:
                raise InputError(f"{self._url} is no MJPEG stream: a line of it has no end")
            self._more()
        return self._take(end + 1).rstrip(b"\r\n")

    def exactly(self, length: int) -> bytes:
        """Read so many bytes."""
        self._check(length)
        while len(self._kept) < length:
            self._more()
        return self._take(length)

    def until(self, mark: bytes) -> bytes:
        """Read up to a mark, which stays."""
        searched = 0
        while (end := self._kept.find(mark, searched)) < 0:
            searched = max(len(self._kept) - len(mark), 0)
            self._check(len(self._kept))
            self._more()
        return self._take(end)

    def rest(self) -> bytes:
        """Read to the end of the answer."""
        while self._more(may_end=True):
            self._check(len(self._kept))
        return bytes(self._kept)

    def _check(self, size: int) -> None:
        if size > _PART:
            raise InputError(f"{self._url} has a picture of {size} bytes; the most is {_PART}")

    def _take(self, length: int) -> bytes:
        taken = bytes(self._kept[:length])
        del self._kept[:length]
        return taken

    def _more(self, *, may_end: bool = False) -> bool:
        if monotonic() > self._deadline:
            raise self.lost(f"has given no picture for {self._timeout:g} s")
        try:
            chunk = self._answer.read1(_CHUNK)
        except TimeoutError:
            raise self.lost(f"has given no picture for {self._timeout:g} s") from None
        except (OSError, http.client.HTTPException) as error:
            raise self.lost(f"has broken off ({error})") from None
        if not chunk and not may_end:
            raise self.lost("has ended")
        self._kept += chunk
        return bool(chunk)
