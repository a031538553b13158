"""Pictures as a video that every browser and player shows: H.264 in an .mp4 file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from arm3dof.errors import InputError, MissingExtra
from arm3dof.files import draft_of

Picture = NDArray[np.uint8]

_QUALITY = "20"  # x264's constant rate factor: nothing that an eye sees is lost
_BT709 = 1  # the colour space of HD video, in the numbers of ITU-T H.273


def write_mp4(
    path: str | Path,
    frames: Iterable[Picture],
    fps: float,
    *,
    progress: Callable[[int], None] | None = None,
) -> Path:
    """Write pictures as an H.264 video, whole or not at all.

    Frames are taken one at a time, so a generator that draws them needs little memory. Pictures of
    an odd width or height lose their last column or row, which the format cannot hold.

    Args:
        path: the file to write; its folder is made when missing.
        frames: BGR pictures of one size, each shape (height, width, 3), uint8.
        fps: frames per second.
        progress: called after each frame with the number of frames so far.

    Returns:
        The path.

    Raises:
        MissingExtra: PyAV is not installed.
        InputError: there is no frame, a frame is no such picture, ``fps`` is not positive, or the
            folder cannot be written.
    """
    try:
        import av
    except ImportError:
        raise MissingExtra("writing a video", "share") from None
    path = Path(path)
    if not (np.isfinite(fps) and fps > 0):
        raise InputError(f"fps is {fps}; give a positive number of frames per second")
    first, frames = _peek(frames)
    height, width = first.shape[0] // 2 * 2, first.shape[1] // 2 * 2
    with draft_of(path) as draft, av.open(str(draft), "w", format="mp4", options=_ONLINE) as file:
        stream = file.add_stream("libx264", rate=Fraction(fps).limit_denominator(1000))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"crf": _QUALITY, "preset": "veryfast", "tune": "animation"}
        context = stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = _BT709
        for number, frame in enumerate(frames, start=1):
            if frame.shape != first.shape or frame.dtype != np.uint8:
                raise InputError(
                    f"frame {number} has shape {frame.shape} and type {frame.dtype}; "
                    f"the first has shape {first.shape}: give uint8 pictures of one size"
                )
            file.mux(stream.encode(_video_frame(av, frame[:height, :width])))
            if progress is not None:
                progress(number)
        file.mux(stream.encode())
    return path


_ONLINE = {"movflags": "+faststart"}  # a browser plays it before all of it has arrived


def _peek(frames: Iterable[Picture]) -> tuple[Picture, Iterator[Picture]]:
    """Return the first frame, and all frames."""
    rest = iter(frames)
    first = next(rest, None)
    if first is None:
        raise InputError("there are no frames; a video needs at least one")
    first = np.asarray(first)
    if first.ndim != 3 or first.shape[2] != 3 or min(first.shape[:2]) < 2:
        raise InputError(f"frame 1 has shape {first.shape}; give pictures (height, width, 3)")
    return first, chain([first], rest)


def _video_frame(av: Any, picture: Picture) -> Any:
    """Return a picture as PyAV's frame in the colours of HD video."""
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
    colours = av.video.reformatter.Colorspace.ITU709
    return frame.reformat(format="yuv420p", dst_colorspace=colours)
