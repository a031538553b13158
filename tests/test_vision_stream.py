"""MJPEG streams of every kind, sound and broken, from a server on the loopback interface."""

import socket
import threading
from collections import deque
from contextlib import contextmanager, suppress

import cv2
import numpy as np
import pytest

from arm3dof.errors import ArmError, CameraLost, InputError
from arm3dof.vision.sources import frames

PICTURES = [np.full((24, 32, 3), 40 + 30 * k, np.uint8) for k in range(4)]
HEAD = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=%s\r\n\r\n"


def jpeg(picture):
    return cv2.imencode(".jpg", picture)[1].tobytes()


def part(picture, boundary=b"it", *, length=True):
    data = jpeg(picture)
    size = b"Content-Length: %d\r\n" % len(data) if length else b""
    return b"--%s\r\nContent-Type: image/jpeg\r\n%s\r\n%s\r\n" % (boundary, size, data)


@contextmanager
def server(*answer, hold=False):
    """Answer one request with some bytes, and then close, or hold the line until the test ends."""
    done = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve():
            line, _ = listening.accept()
            with line, suppress(ConnectionError):  # who has seen enough may leave before the end
                line.recv(65536)
                for piece in answer:
                    line.sendall(piece)
                if hold:
                    done.wait(20)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listening.getsockname()[1]}/stream"
        finally:
            done.set()
            thread.join(20)


def shades(found):
    return [round((it.image.mean() - 40) / 30) for it in found]


@pytest.mark.parametrize("length", [True, False])
@pytest.mark.parametrize("boundary", [b"it", b'"--it"', b"--it"])
def test_pictures_come_in_order_until_the_stream_ends(length, boundary):
    body = b"".join(part(it, length=length) for it in PICTURES)
    with server(HEAD % boundary, body + b"--it--\r\n") as url:
        seen = []
        for frame in (source := frames(url)):
            seen.append(frame)
            if len(seen) == 4:
                break
        with pytest.raises(CameraLost, match="has ended; check the camera"):
            next(source)
    assert shades(seen) == [0, 1, 2, 3]
    assert sorted(it.t for it in seen) == [it.t for it in seen]
    assert seen[2].name == f"{url} frame 2"


def test_bytes_that_come_one_by_one_are_the_same():
    body = b"".join(part(it) for it in PICTURES[:2])
    with server(HEAD % b"it", *(body[k : k + 1] for k in range(len(body)))) as url:
        source = frames(url)
        assert shades([next(source), next(source)]) == [0, 1]
        source.close()


def test_a_damaged_picture_is_passed_over_and_a_cut_line_is_a_loss():
    broken = jpeg(PICTURES[0])[:-40]
    damaged = b"--it\r\nContent-Length: %d\r\n\r\n%s\r\n" % (len(broken), broken)
    half = part(PICTURES[1])[:-60]
    with server(HEAD % b"it", part(PICTURES[2]), damaged, part(PICTURES[3]), half) as url:
        source = frames(url)
        assert shades([next(source), next(source)]) == [2, 3]
        with pytest.raises(CameraLost, match="has ended"):
            next(source)


def test_a_stream_that_falls_silent_is_a_loss_and_does_not_hang():
    with server(HEAD % b"it", part(PICTURES[0]), hold=True) as url:
        source = frames(url, timeout=0.5)  # long enough for the first one on a busy machine
        next(source)
        with pytest.raises(CameraLost, match=r"has given no picture for 0.5 s"):
            next(source)


def test_a_server_that_never_answers_does_not_hang():
    with server(hold=True) as url, pytest.raises(InputError, match="cannot be opened: timed out"):
        next(frames(url, timeout=0.05))


def test_nothing_but_damage_is_an_error():
    broken = b"--it\r\nContent-Length: 5\r\n\r\nhello\r\n"
    with server(HEAD % b"it", *[broken] * 20) as url, pytest.raises(InputError, match="picture"):
        next(frames(url))


def test_one_picture_is_a_stream_of_one():
    data = jpeg(PICTURES[2])
    head = b"HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(data)
    with server(head + data) as url:
        assert shades(frames(url)) == [2]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"HTTP/1.0 404 Not Found\r\n\r\n", "answers 404 Not Found"),
        (b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<p>", "is 'text/html'; give the addr"),
        (b"HTTP/1.0 200 OK\r\nContent-Type: multipart/mixed\r\n\r\n", "give the address"),
        (b"hello\r\n\r\n", "cannot be opened"),
        (HEAD % b"it" + b"x" * 10000, "a line of it has no end"),
        (HEAD % b"it" + b"--it\r\nContent-Length: 99999999999\r\n\r\n", "the most is"),
    ],
)
def test_what_is_no_stream_says_so_in_one_line(answer, message):
    with server(answer) as url, pytest.raises(ArmError, match=message) as caught:
        next(frames(url))
    assert "\n" not in str(caught.value)


def test_no_server_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(InputError, match=r"cannot be opened: .*is the camera on\?"):
        next(frames(f"http://127.0.0.1:{port}/"))
    with pytest.raises(InputError, match="cannot be opened"):
        next(frames("http://"))


def test_whatever_a_server_sends_it_ends_in_one_line():
    rng = np.random.default_rng(0)
    whole = b"".join(part(it) for it in PICTURES)
    for _ in range(40):
        body = bytearray(whole)
        for _ in range(rng.integers(1, 30)):  # bytes are changed, lost and put in
            spot = int(rng.integers(len(body)))
            match rng.integers(3):
                case 0:
                    body[spot] = rng.integers(256)
                case 1:
                    del body[spot : spot + int(rng.integers(1, 200))]
                case _:
                    body[spot:spot] = rng.bytes(int(rng.integers(1, 200)))
        with server(HEAD % b"it", bytes(body)) as url, pytest.raises(ArmError) as caught:
            deque(frames(url, timeout=1.0), maxlen=0)
        assert "\n" not in str(caught.value)
