"""The in-process MeshCat: what it keeps, what it sends, and what it refuses."""

from __future__ import annotations

import base64
import gzip
import re
import webbrowser
from collections.abc import Iterator

import msgpack
import numpy as np
import pytest

from arm3dof.errors import InputError
from arm3dof.ui.meshcat_window import MeshcatWindow
from arm3dof.ui.shapes import box, delete, draw, material, move, set_property


@pytest.fixture
def window() -> MeshcatWindow:
    return MeshcatWindow()


def commands(window: MeshcatWindow) -> list[dict[str, object]]:
    message = msgpack.unpackb(window.snapshot())
    assert message["type"] == "batch"
    return message["commands"]


def brief(window: MeshcatWindow) -> list[tuple[str, str]]:
    return [(each["type"], each.get("path", "")) for each in commands(window)]


def a_box(path: str) -> dict[str, object]:
    return draw(path, box((1, 1, 1)), material((1, 0, 0)))


def test_an_empty_scene_is_an_empty_batch(window: MeshcatWindow) -> None:
    assert commands(window) == []
    assert window.client_count == 0
    assert not window.wait(timeout=0.01)


def test_a_scene_keeps_the_last_of_each_kind(window: MeshcatWindow) -> None:
    for k in range(1000):
        window.post(move("/a/b", (k, 0, 0)), set_property("/a", "visible", k % 2 == 0), a_box("/a"))
    assert brief(window) == [
        ("set_transform", "/a/b"),
        ("set_property", "/a"),
        ("set_object", "/a"),
    ]
    assert commands(window)[0]["matrix"][12] == 999
    assert commands(window)[1]["value"] is False


def test_memory_stays_bounded_by_what_is_drawn(window: MeshcatWindow) -> None:
    window.post(set_property("/a", "position", [0, 0, 0]))
    size = len(window.snapshot())
    for k in range(10_000):
        window.post(set_property("/a", "position", [float(k), 0, 0]))
    assert len(window.snapshot()) < size + 32


def test_paths_have_one_spelling(window: MeshcatWindow) -> None:
    window.post(set_property("a//b/", "visible", True), set_property("/a/b", "visible", False))
    assert [each["value"] for each in commands(window)] == [False]


def test_delete_takes_a_node_and_all_below_it_and_no_other(window: MeshcatWindow) -> None:
    window.post(a_box("/a"), a_box("/a/b"), move("/a/b/c", (0, 0, 0)), a_box("/ab"), delete("/a"))
    assert brief(window) == [("set_object", "/ab")]
    window.post(a_box("/c"), {"type": "caption", "title": "x"}, delete("/"))
    assert brief(window) == [("caption", "")]


def test_a_new_object_starts_without_the_properties_of_the_old(window: MeshcatWindow) -> None:
    window.post(a_box("/a"), set_property("/a", "visible", True))
    window.post(set_property("/a/<object>", "castShadow", False), a_box("/a"))
    assert brief(window) == [("set_object", "/a"), ("set_property", "/a")]


def test_animations_and_replays_come_after_the_nodes_that_they_move(window: MeshcatWindow) -> None:
    replay = {"type": "replay", "frames": 0}
    window.post({"type": "set_animation", "path": "", "animations": []}, replay, a_box("/a"))
    assert [kind for kind, _ in brief(window)] == ["set_object", "set_animation", "replay"]


@pytest.mark.parametrize("kind", ["set_control", "capture_image", "batch", "", None, 3])
def test_commands_that_would_run_code_or_are_unknown_are_refused(
    window: MeshcatWindow, kind: object
) -> None:
    with pytest.raises(InputError, match="the page takes no command"):
        window.post(a_box("/a"), {"type": kind, "callback": "alert(1)"})
    assert commands(window) == []  # all or nothing


def test_numbers_of_numpy_are_plain_numbers(window: MeshcatWindow) -> None:
    window.post(set_property("/a", "x", [np.float32(0.5), np.int64(3), np.array([1.0, 2.0])]))
    assert commands(window)[0]["value"] == [0.5, 3, [1.0, 2.0]]


def test_what_cannot_be_sent_is_named(window: MeshcatWindow) -> None:
    with pytest.raises(InputError, match=r"cannot send <object.*give plain numbers"):
        window.post(set_property("/a", "x", object()))


@pytest.mark.filterwarnings("ignore:zmq.eventloop.ioloop is deprecated")  # imported by meshcat
def test_the_meshcat_package_draws_into_it(window: MeshcatWindow) -> None:
    import meshcat
    import meshcat.geometry as mg
    from meshcat.animation import Animation

    viewer = meshcat.Visualizer(window=window)
    viewer["box"].set_object(mg.Box([1, 2, 3]))
    viewer["mesh"].set_object(mg.TriangularMeshGeometry(np.eye(3), [[0, 1, 2]]))
    viewer["box"].set_transform(np.diag([1.0, 2.0, 3.0, 1.0]))
    viewer["/Background"].set_property("visible", False)
    animation = Animation()
    with animation.at_frame(viewer, 0) as frame:
        frame["box"].set_transform(np.eye(4))
    viewer.set_animation(animation)
    viewer["gone"].set_object(mg.Sphere(1.0))
    viewer["gone"].delete()
    assert brief(window) == [
        ("set_object", "/meshcat/box"),
        ("set_object", "/meshcat/mesh"),
        ("set_transform", "/meshcat/box"),
        ("set_property", "/Background"),
        ("set_animation", ""),
    ]
    mesh = commands(window)[1]["object"]["geometries"][0]["data"]
    position = mesh["attributes"]["position"]["array"]
    assert position.code == 0x17
    np.testing.assert_array_equal(np.frombuffer(position.data, np.float32), np.eye(3).ravel())
    assert "embedded-scene" in viewer.static_html()
    assert viewer.url() == ""


def test_the_scene_as_a_page_holds_the_same_commands(window: MeshcatWindow) -> None:
    window.post(a_box("/a"), {"type": "caption", "title": "</script>"})
    page = window.get_scene()
    data = re.search(r'id="embedded-scene"[^>]*>([^<]*)<', page)[1]
    assert gzip.decompress(base64.b64decode(data)) == window.snapshot()
    assert page == window.get_scene()  # the same scene is the same bytes


def test_open_needs_a_server(window: MeshcatWindow, opened: list[str]) -> None:
    with pytest.raises(InputError, match="web_url is empty; serve the window first"):
        window.open()
    window.web_url = "http://127.0.0.1:1/"
    assert window.open() is window
    assert opened == [window.web_url]


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    urls: list[str] = []
    monkeypatch.setattr(webbrowser, "open", lambda url, new: urls.append(url))
    return urls
