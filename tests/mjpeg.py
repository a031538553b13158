"""An MJPEG camera for the tests, which can be switched off and on."""

from __future__ import annotations

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2

from arm3dof.vision.colour import Image


class Stream:
    """An MJPEG camera on the loopback interface that can be switched off and on."""

    def __init__(self, picture: Image) -> None:
        data = cv2.imencode(".jpg", picture)[1].tobytes()
        head = b"--it\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(data)
        self.off = off = threading.Event()

        class Answer(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if off.is_set():
                    self.send_error(503)
                    return
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=it")
                self.end_headers()
                try:
                    while not off.wait(0.02):
                        self.wfile.write(head + data + b"\r\n")
                except OSError:
                    pass  # who watched has gone

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/stream"

    def close(self) -> None:
        self.off.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()
