import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from arm3dof.errors import ArmError, CameraLost, InputError, MissingFile
from arm3dof.vision.sources import frames, read_image, to_bgr, write_image


@pytest.fixture
def picture():
    rng = np.random.default_rng(0)
    return cv2.GaussianBlur(rng.integers(0, 256, (30, 40, 3)).astype(np.uint8), (7, 7), 0)


def encoded(image, suffix=".png"):
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tiff", ".ppm", ".PNG"])
def test_what_is_written_is_read_again(tmp_path, picture, suffix):
    path = write_image(tmp_path / "new" / f"picture{suffix}", picture)
    assert np.array_equal(read_image(path), picture)
    assert np.array_equal(read_image(str(path)), picture)


@pytest.mark.parametrize("suffix", [".jpg", ".webp"])
def test_lossy_formats_are_close(tmp_path, picture, suffix):
    path = write_image(tmp_path / f"picture{suffix}", picture)
    assert np.abs(read_image(path).astype(int) - picture).mean() < 8


def test_grey_and_deep_pictures_become_bgr_bytes(tmp_path, picture):
    grey = picture[:, :, 0]
    deep = picture.astype(np.uint16) * 257
    for image, expected in (
        (grey, np.dstack([grey] * 3)),
        (deep, picture),
        (deep[:, :, 1], np.dstack([picture[:, :, 1]] * 3)),
    ):
        (tmp_path / "it.png").write_bytes(encoded(image))
        read = read_image(tmp_path / "it.png")
        assert read.dtype == np.uint8
        assert np.array_equal(read, expected)


def test_what_is_transparent_shows_white(tmp_path, picture):
    alpha = np.full(picture.shape[:2], 255, np.uint8)
    alpha[:, :10], alpha[:, 10:20] = 0, 128
    (tmp_path / "it.png").write_bytes(encoded(np.dstack([picture, alpha])))
    read = read_image(tmp_path / "it.png").astype(int)
    assert (read[:, :10] == 255).all()
    assert np.array_equal(read[:, 20:], picture[:, 20:])
    mixed = 255 + (picture[:, 10:20].astype(int) - 255) * 128 / 255
    assert np.abs(read[:, 10:20] - mixed).max() <= 1


@pytest.mark.parametrize(
    "image",
    [np.zeros((3, 4), np.float64), np.zeros((3, 4, 2), np.uint8), np.zeros((2, 3, 4, 3), np.uint8)],
)
def test_arrays_that_are_no_picture_are_refused(image):
    with pytest.raises(InputError, match="give grey, BGR or BGRA"):
        to_bgr(image)


def test_an_array_without_pixels_is_refused():
    with pytest.raises(InputError, match="BGR bytes"):
        to_bgr(np.zeros((0, 4), np.uint8))


def broken_files(folder, picture):
    """Write files that are no pictures, and say what each message must hold."""
    rng = np.random.default_rng(1)
    png, jpg = encoded(picture), encoded(picture, ".jpg")
    spoilt = bytearray(png)
    spoilt[60:90] = bytes(30)
    cases = {
        "empty.png": (b"", "is empty"),
        "text.png": (b"this is not a picture", "is not a picture"),
        "noise.jpg": (rng.bytes(3000), "is not a picture"),
        "header.png": (png[:20], "cut short"),
        "half.png": (png[: len(png) // 2], "cut short"),
        "almost.png": (png[:-6], "cut short"),
        "half.jpg": (jpg[: len(jpg) // 2], "cut short"),
        "almost.jpg": (jpg[:-2], "cut short"),
        "half.bmp": (encoded(picture, ".bmp")[:1500], "is not a picture"),
        "half.tiff": (encoded(picture, ".tiff")[:600], "is not a picture"),
        "half.webp": (encoded(picture, ".webp")[:200], "is not a picture"),
        "spoilt.png": (bytes(spoilt), "is not a picture"),
    }
    for name, (data, _) in cases.items():
        (folder / name).write_bytes(data)
    return {name: message for name, (_, message) in cases.items()}


def test_broken_files_give_one_clear_line_and_the_codecs_say_nothing(tmp_path, picture, capfd):
    for name, message in broken_files(tmp_path, picture).items():
        with pytest.raises(InputError, match=message) as caught:
            read_image(tmp_path / name)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_every_cut_of_a_picture_is_refused(tmp_path, picture):
    for suffix in (".png", ".jpg"):
        data = encoded(picture, suffix)
        for end in range(0, len(data) - 1, 37):
            (tmp_path / "cut").write_bytes(data[:end])
            with pytest.raises(InputError):
                read_image(tmp_path / "cut")


def test_a_missing_file_and_a_folder(tmp_path):
    with pytest.raises(MissingFile, match=r"cannot read .*no\.png: No such file"):
        read_image(tmp_path / "no.png")
    with pytest.raises(FileNotFoundError):
        read_image(tmp_path / "no.png")
    with pytest.raises(InputError, match="is a folder"):
        read_image(tmp_path)


def test_reading_works_where_stderr_is_closed(tmp_path, picture):
    path = write_image(tmp_path / "it.png", picture)
    code = (
        "import os; os.close(2)\n"
        "from arm3dof.vision.sources import read_image\n"
        f"print(read_image({os.fspath(path)!r}).shape)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "(30, 40, 3)\n"


def test_places_that_cannot_be_written(tmp_path, picture):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot write"):
        write_image(tmp_path / "file" / "it.png", picture)
    with pytest.raises(InputError, match="does not end in a picture format"):
        write_image(tmp_path / "it.xyz", picture)
    with pytest.raises(InputError, match="BGR bytes"):
        write_image(tmp_path / "it.png", picture[:, :, 0])


def test_a_file_is_one_frame_and_a_folder_many(tmp_path, picture):
    for k, name in enumerate(("b.png", "a.png", "c.PNG")):
        write_image(tmp_path / name, picture + np.uint8(k))
    (tmp_path / "notes.txt").write_text("x")
    (only,) = frames(tmp_path / "b.png")
    assert np.array_equal(only.image, picture)
    assert only.t == 0
    many = list(frames(tmp_path))
    assert [Path(it.name).name for it in many] == ["a.png", "b.png", "c.PNG"]
    assert [it.t for it in many] == [0, 1, 2]
    assert np.array_equal(many[0].image, picture + np.uint8(1))


@pytest.mark.parametrize(("suffix", "codec"), [(".avi", "MJPG"), (".mp4", "mp4v")])
def test_a_video_is_played_to_its_end(tmp_path, suffix, codec):
    path = tmp_path / f"it{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 20, (64, 48))
    for k in range(7):
        writer.write(np.full((48, 64, 3), 30 * k, np.uint8))
    writer.release()
    seen = list(frames(path))
    assert len(seen) == 7
    assert [it.t for it in seen] == pytest.approx(np.arange(7) / 20)
    assert [round(it.image.mean() / 30) for it in seen] == list(range(7))
    assert seen[3].name.endswith("frame 3")


def test_sources_that_give_nothing_say_so(tmp_path, capfd):
    (tmp_path / "bad.mp4").write_bytes(b"no video")
    (tmp_path / "none").mkdir()
    for source, kind, message in (
        (tmp_path / "bad.mp4", InputError, "is not a video"),
        (tmp_path / "no.mp4", MissingFile, "there is no video"),
        (tmp_path / "none", InputError, "holds no pictures"),
        (tmp_path / "no.png", MissingFile, "cannot read"),
        (9999, InputError, "camera 9999 is not connected"),
    ):
        with pytest.raises(kind, match=message) as caught:
            list(frames(source))
        assert isinstance(caught.value, ArmError)
    assert capfd.readouterr().err == ""


def test_a_video_without_pictures_says_so(tmp_path):
    path = tmp_path / "it.avi"
    cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20, (64, 48)).release()
    with pytest.raises(InputError, match=r"no pictures|is not a video"):
        list(frames(path))


def test_a_video_that_is_left_early_is_closed(tmp_path):
    path = tmp_path / "it.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 20, (64, 48))
    for _ in range(5):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    source = frames(path)
    next(source)
    source.close()
    opened = {os.path.realpath(it) for it in Path("/proc/self/fd").iterdir()}
    assert str(path) not in opened


class Vanishing:
    """A camera device that is pulled out after some pictures."""

    def __init__(self, pictures):
        self.left, self.released = list(pictures), False

    def isOpened(self):
        return True

    def get(self, _):
        return 0.0

    def read(self):
        return (True, self.left.pop(0)) if self.left else (False, None)

    def release(self):
        self.released = True


def test_a_camera_that_vanishes_says_so_and_is_let_go(picture, monkeypatch):
    device = Vanishing([picture, picture])
    monkeypatch.setattr(cv2, "VideoCapture", lambda _: device)
    source = frames(0)
    first, second = next(source), next(source)
    assert first.t <= second.t
    assert second.name == "camera 0 frame 1"
    with pytest.raises(CameraLost, match="camera 0 gives no more pictures; check its cable"):
        next(source)
    assert device.released
    monkeypatch.setattr(cv2, "VideoCapture", lambda _: Vanishing([]))
    with pytest.raises(InputError, match="camera 0 gives no pictures"):
        next(frames(0))


def test_whatever_a_file_holds_it_is_bgr_bytes_or_one_line(tmp_path, picture):
    rng = np.random.default_rng(3)
    kinds = [picture, picture[:, :, 0], picture.astype(np.uint16) * 200, picture[:1, :1]]
    read = 0
    for trial in range(200):
        suffix = str(rng.choice([".png", ".jpg", ".bmp", ".tiff", ".webp", ".ppm"]))
        image = kinds[trial % 4 if suffix in (".png", ".tiff") else 3 * (trial % 2)]
        data = bytearray(encoded(image, suffix))
        for _ in range(trial % 6):
            spot = int(rng.integers(len(data)))
            data[spot] = rng.integers(256)
        if trial % 3 == 0:
            del data[int(rng.integers(len(data))) :]
        path = tmp_path / f"it{suffix}"
        path.write_bytes(data)
        said = ""
        try:
            (frame,) = frames(path)
        except ArmError as error:
            said = str(error)
        if said:
            assert "\n" not in said
            continue
        read += 1
        assert (frame.image.dtype, frame.image.shape[2]) == (np.uint8, 3)
    assert 40 < read < 180
