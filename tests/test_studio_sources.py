"""The studio's camera looks at folders, videos and streams, and stands it when they vanish."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from mjpeg import Stream

from arm3dof.cli.studio import eye_spec, file_store, picture_source
from arm3dof.config.camera_file import load_camera
from arm3dof.errors import CameraLost, InputError, MissingFile
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.child import CONTEXT
from arm3dof.runtime.live.eye import Blind, Learned, Pick, SeenPicture, Watch, Watcher
from arm3dof.runtime.live.eye_process import EyeProcess, EyeSpec
from arm3dof.runtime.live.footage import STILL, SourceCamera, fitted, played
from arm3dof.runtime.live.frames import Mode, Ring, frame_type
from arm3dof.runtime.live.pace import SimulatedClock
from arm3dof.runtime.live.process import News
from arm3dof.runtime.live.tuned import Tuned
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.ui.demo_scene import demo_table, draw_demo
from arm3dof.ui.studio import feed
from arm3dof.ui.studio import studio as studios
from arm3dof.ui.studio.status import Tone, describe
from arm3dof.ui.studio.studio import Studio
from arm3dof.vision.colour import Image
from arm3dof.vision.sources import Frame, frames, write_image

SETUP = load_camera("desk")
WATCH = Watch(tuple(SETUP.targets.values()))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def picture() -> Image:
    return draw_demo(SETUP.camera, np.random.default_rng(0))


def eventually(condition: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def video(path: Path, pictures: list[Image], rate: float = 20) -> Path:
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), rate, (width, height))
    for each in pictures:
        writer.write(each)
    writer.release()
    return path


# ---- a source's own time -------------------------------------------------------------------------


def grey(level: int) -> Image:
    return np.full((24, 32, 3), level, np.uint8)


def at_clock(source: Path, count: int) -> list[tuple[float, int]]:
    """When which picture is shown: time [s] and level."""
    clock = SimulatedClock()
    found = []
    for frame in played(partial(frames, source), clock):
        found.append((round(clock.now(), 6), 10 * round(float(frame.image.mean()) / 10)))
        if len(found) == count:
            return found
    raise AssertionError


def test_a_folder_shows_a_picture_a_second_over_and_over(tmp_path: Path) -> None:
    for number, level in enumerate((50, 100, 150)):
        write_image(tmp_path / f"{number}.png", grey(level))
    expected = [(0, 50), (1, 100), (2, 150), (3, 50), (4, 100)]
    assert at_clock(tmp_path, 5) == expected


def test_a_video_runs_at_its_own_rate_over_and_over(tmp_path: Path) -> None:
    path = video(tmp_path / "it.avi", [grey(40), grey(80)], rate=10)
    assert at_clock(path, 5) == [(0, 40), (0.1, 80), (0.2, 40), (0.3, 80), (0.4, 40)]


def test_one_picture_is_read_anew_each_second(tmp_path: Path) -> None:
    path = write_image(tmp_path / "it.png", grey(70))
    assert at_clock(path, 3) == [(0, 70), (STILL, 70), (2 * STILL, 70)]


def test_a_source_without_pictures_ends() -> None:
    assert list(played(lambda: iter(()), SimulatedClock())) == []


def test_a_picture_is_cut_and_scaled_but_never_distorted() -> None:
    wide = np.zeros((720, 1280, 3), np.uint8)
    cv2.circle(wide, (640, 360), 150, (255, 255, 255), -1)
    small = fitted(wide, 640, 480)
    assert small.shape == (480, 640, 3)
    rows, columns = np.nonzero(small[:, :, 0] > 127)
    assert np.ptp(rows) == pytest.approx(200, abs=2)  # 2/3 of the size, and still round
    assert np.ptp(columns) == pytest.approx(200, abs=2)
    assert (rows.mean(), columns.mean()) == pytest.approx((239.5, 319.5), abs=1)
    assert fitted(small, 640, 480) is small
    assert fitted(wide[:1, :1], 640, 480).shape == (480, 640, 3)


# ---- the newest picture --------------------------------------------------------------------------


class Stage:
    """A source whose frames come when the test says so."""

    def __init__(self) -> None:
        self.opened = 0
        self._go = threading.Semaphore(0)
        self._next: list[Frame | Exception | None] = []

    def give(self, *items: Frame | Exception | None) -> None:
        for item in items:
            self._next.append(item)
            self._go.release()

    def play(self) -> Iterator[Frame]:
        self.opened += 1
        while True:
            assert self._go.acquire(timeout=60)
            item = self._next.pop(0)
            if item is None:
                return
            if isinstance(item, Exception):
                raise item
            yield item


def test_the_newest_picture_counts_and_a_lost_source_is_opened_anew() -> None:
    stage = Stage()
    camera = SourceCamera(stage.play, SETUP.camera)
    eye = Watcher(camera.take, SETUP.camera, WATCH)
    assert eye.see() is None  # nothing yet, and nobody waits for it
    assert eye.learn(Pick(1, 1)) == Learned(Pick(1, 1), None, "there is no picture yet")
    stage.give(*(Frame(grey(level), "it", 0.0) for level in (10, 20, 30)))
    eventually(lambda: (taken := camera.take(WATCH)) is not None and taken[0, 0, 0] == 30)
    assert eye.see() is not None
    stage.give(CameraLost("the cable is cut"))

    def lost() -> str:
        try:
            camera.take(WATCH)
        except CameraLost as error:
            return str(error)
        return ""

    eventually(lambda: lost() == "the cable is cut")
    assert camera.take(WATCH) is None
    stage.give(Frame(grey(40), "it", 0.0))
    eventually(lambda: camera.take(WATCH) is not None)
    assert stage.opened == 2
    stage.give(None)
    eventually(lambda: lost() == "the camera gives no more pictures")
    camera.take(WATCH)
    stage.give(None)
    camera.close()


# ---- a stream that comes and goes ----------------------------------------------------------------


@pytest.fixture
def stream(picture: Image) -> Iterator[Stream]:
    made = Stream(picture)
    yield made
    made.close()


# ---- the eye's process ---------------------------------------------------------------------------


class Listener:
    """Hears what the eye says."""

    def __init__(self) -> None:
        self.seen: list[SeenPicture] = []
        self.blind: list[str] = []
        self.learned: list[Learned] = []

    def __call__(self, message: object) -> None:
        if isinstance(message, SeenPicture):
            self.seen.append(message)
        elif isinstance(message, Blind):
            self.blind.append(message.why)
        elif isinstance(message, Learned):
            self.learned.append(message)


@contextmanager
def looking(source: str | Path | int, robot: Robot) -> Iterator[tuple[EyeProcess, Listener]]:
    ring = Ring(frame_type(robot.nv), CONTEXT.RawArray)
    heard = Listener()
    spec = EyeSpec(SETUP.camera, WATCH, source)
    process = EyeProcess(spec, PackedRobot.of(robot), ring, heard)
    try:
        yield process, heard
    finally:
        process.close()


def names(sight: SeenPicture) -> list[str]:
    return [it.target for it in sight.view.located]


@pytest.mark.parametrize("kind", ["folder", "video", "picture"])
def test_files_are_looked_at_as_a_camera_would(
    kind: str, tmp_path: Path, picture: Image, robot: Robot
) -> None:
    if kind == "video":
        source = video(tmp_path / "it.avi", [picture] * 3)
    else:
        source = write_image(tmp_path / "it.png", picture)
    with looking(tmp_path if kind == "folder" else source, robot) as (process, heard):
        eventually(lambda: len(heard.seen) > 2)
        assert "green" in names(heard.seen[-1])
        box = next(it for it in heard.seen[-1].view.located if it.target == "green").box_px
        process.send(Pick(box[0] + box[2] // 2, box[1] + box[3] // 2))
        eventually(lambda: heard.learned)
        assert heard.learned[0].hsv is not None
        assert heard.blind == []
        source.unlink()  # a video goes on until its end, and comes to it soon
        eventually(lambda: heard.blind)
        process.send(WATCH)  # it lives, and goes on asking
        assert process.is_alive
    assert len(heard.blind) == 1
    assert "\n" not in heard.blind[0]
    assert {"folder": "holds no pictures", "video": "no video", "picture": "cannot read"}[
        kind
    ] in heard.blind[0]


def test_a_stream_that_ends_is_said_once_and_seen_again_when_it_is_back(
    stream: Stream, robot: Robot
) -> None:
    with looking(stream.url, robot) as (process, heard):
        eventually(lambda: len(heard.seen) > 2)
        assert "green" in names(heard.seen[-1])
        stream.off.set()
        eventually(lambda: heard.blind)
        before = len(heard.seen)
        stream.off.clear()
        eventually(lambda: len(heard.seen) > before + 2)
        assert process.is_alive
    assert heard.blind == [f"{stream.url} has ended; check the camera"]


def test_a_stream_that_is_not_there_yet_is_waited_for(stream: Stream, robot: Robot) -> None:
    stream.off.set()
    with looking(stream.url, robot) as (_, heard):
        eventually(lambda: heard.blind)
        assert "answers 503" in heard.blind[0]
        assert heard.seen == []
        stream.off.clear()
        eventually(lambda: heard.seen)


# ---- the studio ----------------------------------------------------------------------------------


def test_a_moving_arm_stops_when_its_camera_is_lost(
    stream: Stream, robot: Robot, tmp_path: Path
) -> None:
    spec = EyeSpec(SETUP.camera, WATCH, stream.url)
    studio = Studio(Tuned(), robot, np.zeros(3), spec, tmp_path, file_store())
    studio.begin()

    def after(condition: Callable[[], object]) -> None:
        def met() -> object:
            studio.alive()
            return condition()

        eventually(met)

    def mode() -> Mode | None:
        frame = studio.arm.ring.latest()
        return None if frame is None else Mode(int(frame["mode"]))

    try:
        after(lambda: studio.located() and mode() is Mode.HOLDING)
        studio.ask(cmd.Aim((0.3, 0.8, -0.6)))
        studio.ask(cmd.Run())
        after(lambda: mode() is Mode.RUNNING)
        stream.off.set()
        after(lambda: studio.blind and mode() is Mode.HOLDING)
        why = f"{stream.url} has ended; check the camera"
        assert studio.blind == why
        assert [(it.text, it.bad) for _, it in studio.news] == [
            (f"{why}; the arm was stopped", True)
        ]
        assert studio.located() == ()
        with pytest.raises(InputError, match="no known object is seen"):
            studio.grasp()
        frame = studio.arm.ring.latest()
        status = describe(frame, studio.robot, studio.blind)
        assert status == (f"Holding still. No picture: {why}", Tone.WARN)
        message = feed.numbers_message(frame[None], robot, {}, {}, studio.blind)
        numbers = json.loads(message[1:])
        assert (numbers["status"], numbers["blind"]) == (status.text, why)
        stream.off.clear()
        after(lambda: studio.sight is not None)
        assert studio.blind == ""

        studio.eye.close()  # the process itself is gone: the arm goes on without
        after(lambda: studio.blind)
        assert "looks through the camera has ended" in studio.blind
        studio.rebuild({"link3.mass": 0.1})
        after(lambda: studio.arm.ring.latest()["version"] == 1)
        assert studio.tuned.overrides == {"link3.mass": 0.1}
    finally:
        studio.close()


def test_a_picture_may_come_while_the_studio_is_being_built(
    robot: Robot, tmp_path: Path, picture: Image, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[object] = []
    see, scene = Studio._see, studios.LiveScene

    def noted(self: Studio, message: SeenPicture) -> None:
        see(self, message)
        told.append(message)

    def late(*args: object) -> studios.LiveScene:
        eventually(lambda: told)
        return scene(*args)

    monkeypatch.setattr(Studio, "_see", noted)
    monkeypatch.setattr(studios, "LiveScene", late)
    source = write_image(tmp_path / "it.png", picture)
    spec = EyeSpec(SETUP.camera, WATCH, source)
    studio = Studio(Tuned(), robot, np.zeros(3), spec, tmp_path, file_store())
    studio.close()
    assert studio.located()


def test_a_page_that_fails_inside_says_so_and_stops_the_arm(
    robot: Robot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    spec = EyeSpec(SETUP.camera, WATCH, demo_table(np.random.default_rng(0)))
    studio = Studio(Tuned(), robot, np.zeros(3), spec, tmp_path, file_store())
    told: list[bytes] = []
    monkeypatch.setattr(studio.live, "send", told.append)

    def fail(*_: object) -> None:
        raise SystemError("a tuple broke")

    def mode() -> Mode | None:
        studio.alive()
        frame = studio.arm.ring.latest()
        return None if frame is None else Mode(int(frame["mode"]))

    try:
        studio.begin()
        eventually(lambda: mode() is Mode.HOLDING)
        studio.ask(cmd.Aim((0.3, 0.8, -0.6)))
        studio.ask(cmd.Run())
        eventually(lambda: mode() is Mode.RUNNING)
        monkeypatch.setattr(studio.scene, "show", fail)
        eventually(lambda: mode() is Mode.HOLDING)
        eventually(lambda: any(message.startswith(feed.FAILURE) for message in told))
        (failure,) = (message for message in told if message.startswith(feed.FAILURE))
        assert "start the program again" in failure.decode()
        assert studio.live._welcome() == failure  # for tabs that come later
        assert studio.news[-1][1] == News(failure[1:].decode(), bad=True)
        assert "a tuple broke" in caplog.text
    finally:
        studio.close()


# ---- the command ---------------------------------------------------------------------------------


def test_a_source_is_checked_before_the_page_opens(tmp_path: Path, picture: Image) -> None:
    write_image(tmp_path / "it.png", picture)
    assert eye_spec(str(tmp_path), None).source == str(tmp_path)
    assert picture_source("3") == 3  # may be plugged in later
    assert picture_source("http://127.0.0.1:9/stream").startswith("http")
    (tmp_path / "bad.mp4").write_bytes(b"no video")
    (tmp_path / "none").mkdir()
    for where, kind, why in (
        ("no.mp4", MissingFile, "there is no video"),
        ("nowhere", MissingFile, "cannot read"),
        ("bad.mp4", InputError, "is not a video"),
        ("none", InputError, "holds no pictures"),
    ):
        with pytest.raises(kind, match=why) as refusal:
            picture_source(str(tmp_path / where))
        assert "\n" not in str(refusal.value)
