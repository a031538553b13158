"""Seeing beside the control loop: the latest wins, its age is known, and nothing hangs."""

import threading
from queue import Queue

import numpy as np
import pytest

from arm3dof.errors import CameraLost
from arm3dof.vision.camera import Camera
from arm3dof.vision.colour import ColourTarget, HsvRange
from arm3dof.vision.eye import Eye
from arm3dof.vision.latest import Latest
from arm3dof.vision.locate import View
from arm3dof.vision.sources import Frame

GREEN = ColourTarget("green", HsvRange((45, 90, 30), (85, 255, 255)), 0.03)
CAMERA = Camera.pinhole(64, 48, 60)
PATIENCE = 20  # a test that waits this long has failed [s]


def frame(k, size=(48, 64)):
    return Frame(np.full((*size, 3), k, np.uint8), f"picture {k}", float(k))


def drawn_from(queue):
    """Yield what is put into a queue; None ends, an error is raised."""
    while (it := queue.get(timeout=PATIENCE)) is not None:
        if isinstance(it, Exception):
            raise it
        yield it


def threads():
    return {it.name for it in threading.enumerate()}


def test_the_newest_wins_and_each_is_given_once():
    queue = Queue()
    with Latest(drawn_from(queue)) as latest:
        assert latest.item is None
        assert latest.wait(timeout=0) is None
        for k in range(5):
            queue.put(k)
        assert latest.wait(5, PATIENCE) == 4
        fresh = latest.fresh()
        assert next(fresh) == 4  # the first four were missed
        queue.put(5)
        assert next(fresh) == 5
        queue.put(None)
        assert list(fresh) == []
        assert latest.ended
        assert latest.failure is None
        assert latest.item == 5


def test_an_eye_looks_at_the_newest_picture_and_knows_its_age():
    queue = Queue()
    busy, seen = threading.Semaphore(0), []

    def slow(image):
        seen.append(int(image[0, 0, 0]))
        assert busy.acquire(timeout=PATIENCE)
        return View((), ())

    with Eye(drawn_from(queue), CAMERA, [GREEN], looker=slow) as eye:
        assert eye.latest is None
        queue.put(frame(0))
        while not seen:
            pass
        for k in range(1, 9):  # they come while the eye is busy with the first
            queue.put(frame(k))
        eye._frames.wait(9, PATIENCE)
        busy.release()
        first = eye.wait(1, PATIENCE)
        assert first.frame.name == "picture 0"
        busy.release()
        latest = eye.wait(2, PATIENCE)
        assert latest.frame.name == "picture 8"
        assert seen == [0, 8]
        assert eye.failure is None
        assert latest.age() >= 0
        assert latest.age(latest.taken_at + 0.25) == pytest.approx(0.25)
        assert latest.taken_at >= first.taken_at
        queue.put(None)
        busy.release()
    assert not {"eye", "frames"} & threads()


def test_a_camera_that_vanishes_leaves_the_last_view_and_says_why():
    queue = Queue()
    with Eye(drawn_from(queue), CAMERA, [GREEN]) as eye:
        queue.put(frame(3))
        assert eye.wait(1, PATIENCE).frame.name == "picture 3"
        queue.put(CameraLost("camera 0 gives no more pictures;\ncheck its cable"))
        eye.wait(99, PATIENCE)
        assert eye.failure == "camera 0 gives no more pictures; check its cable"
        assert eye.latest.frame.name == "picture 3"
    with Eye(iter([frame(1)]), CAMERA, [GREEN]) as eye:
        eye.wait(99, PATIENCE)
        assert eye.failure == "the source has ended; start it again"


def test_a_picture_of_another_size_ends_the_eye_with_its_reason():
    with Eye(iter([frame(1, (10, 10))]), CAMERA, [GREEN]) as eye:
        eye.wait(1, PATIENCE)
        assert "the picture is 10 x 10 px" in eye.failure
        assert eye.latest is None


def test_closing_does_not_wait_for_a_source_that_is_silent(monkeypatch):
    monkeypatch.setattr("arm3dof.vision.latest._PATIENCE", 0.05)
    never = threading.Event()

    def silent():
        never.wait(PATIENCE)
        yield frame(0)

    eye = Eye(silent(), CAMERA, [GREEN])
    eye.close()
    assert eye.wait(1) is None
    for thread in threading.enumerate():
        if thread.name == "eye":  # on a busy machine it outlives its last word by a moment
            thread.join(PATIENCE)
    assert "eye" not in threads()
    never.set()


def test_a_source_that_is_left_early_is_closed():
    closed = threading.Event()

    def endless():
        try:
            k = 0
            while True:
                yield frame(k % 200)
                k += 1
        finally:
            closed.set()

    with Eye(endless(), CAMERA, [GREEN]) as eye:
        assert eye.wait(3, PATIENCE) is not None
    assert closed.wait(PATIENCE)
