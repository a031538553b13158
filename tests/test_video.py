"""Videos: what was drawn is what plays, at its time, whole or not at all."""

from __future__ import annotations

import sys
from pathlib import Path

import av
import numpy as np
import pytest

from arm3dof.errors import InputError, MissingExtra
from arm3dof.ui.video import write_mp4

COLOURS = ((0, 0, 255), (0, 255, 0), (255, 0, 0), (40, 120, 200), (255, 255, 255), (0, 0, 0))


def plain(colour: tuple[int, int, int], height: int = 48, width: int = 64) -> np.ndarray:
    return np.full((height, width, 3), colour, np.uint8)


def read(path: Path) -> tuple[list[np.ndarray], list[float], object]:
    """Frames as BGR, their times and the stream's codec, as a player reads them."""
    with av.open(str(path)) as file:
        stream = file.streams.video[0]
        frames = list(file.decode(stream))
        pictures = [frame.to_ndarray(format="bgr24") for frame in frames]
        return pictures, [frame.time for frame in frames], stream.codec_context.name


def test_frames_come_back_in_order_with_their_colours_and_times(tmp_path: Path) -> None:
    done: list[int] = []
    frames = (plain(colour) for colour in COLOURS)
    path = write_mp4(tmp_path / "new" / "a.mp4", frames, 25.0, progress=done.append)
    pictures, times, codec = read(path)
    assert codec == "h264"
    assert done == [1, 2, 3, 4, 5, 6]
    assert np.allclose(times, np.arange(6) / 25.0, atol=1e-6)
    for colour, picture in zip(COLOURS, pictures, strict=True):
        assert picture.shape == (48, 64, 3)
        assert np.abs(picture.astype(int) - colour).max() <= 6, colour
    assert list(path.parent.iterdir()) == [path]


def test_odd_sizes_and_broken_rates_work(tmp_path: Path) -> None:
    path = write_mp4(tmp_path / "a.mp4", [plain((9, 9, 9), 33, 51)] * 5, 29.97)
    pictures, times, _ = read(path)
    assert pictures[0].shape == (32, 50, 3)
    assert np.allclose(np.diff(times), 1 / 29.97, rtol=1e-3)


def test_the_same_frames_are_the_same_file(tmp_path: Path) -> None:
    files = [write_mp4(tmp_path / name, map(plain, COLOURS), 20) for name in ("a.mp4", "b.mp4")]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize(
    ("frames", "fps", "message"),
    [
        ([], 25, "no frames"),
        ([np.zeros((48, 64), np.uint8)], 25, r"frame 1 has shape \(48, 64\)"),
        ([plain((0, 0, 0)), plain((0, 0, 0), 20, 20)], 25, "frame 2 has shape"),
        ([np.zeros((48, 64, 3))], 25, "type float64"),
        ([plain((0, 0, 0))], 0, "fps is 0"),
        ([plain((0, 0, 0))], float("nan"), "fps is nan"),
    ],
)
def test_what_is_no_video_is_refused(
    tmp_path: Path, frames: list[np.ndarray], fps: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        write_mp4(tmp_path / "a.mp4", frames, fps)
    assert not list(tmp_path.iterdir())


def test_a_stop_midway_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_bytes(b"old")

    def stopped():
        yield plain((0, 0, 0))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_mp4(path, stopped(), 25)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"a\.mp4: cannot be written"):
        write_mp4(tmp_path / "file" / "a.mp4", [plain((0, 0, 0))], 25)


def test_without_pyav_the_cure_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtra, match=r"arm3dof\[share\]"):
        write_mp4(tmp_path / "a.mp4", [plain((0, 0, 0))], 25)
