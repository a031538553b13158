"""The page in a real browser: what it shows is what Pinocchio says, and it keeps to itself."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import psutil
import pytest
from browser import POSE_JS, chromium, poses, visit, wait_until
from runs import TARGET, smooth_run
from starlette.applications import Starlette
from starlette.responses import HTMLResponse
from starlette.routing import Route

from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui import shapes
from arm3dof.ui.meshcat_scene import Scene, recording_scene
from arm3dof.ui.report import write_replay
from arm3dof.ui.server import LocalServer, serve
from arm3dof.ui.shapes import move

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = [pytest.mark.browser, pytest.mark.slow]
EXACT = 1e-9
DRAWN = """window.drawn = () => {  // draw, and return the picture's bytes
  viewer.render();
  const gl = viewer.renderer.getContext();
  const pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
  gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA,
    gl.UNSIGNED_BYTE, pixels);
  return Array.from(pixels);
}, null"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def run(robot: Robot) -> Recording:
    return smooth_run(robot, duration=1.5)


def barrier(scene: Scene, page: Page, number: int) -> None:
    """Wait until the page has done everything that was sent before."""
    scene.window.post(move("/barrier", (number, 0, 0)))
    wait_until(page, f"viewer.scene_tree.children.barrier?.object.position.x === {number}")


def assert_shows(page: Page, robot: Robot, scene: Scene, q: np.ndarray) -> None:
    links = scene.drawing.link_names
    for link, found in zip(links, poses(page, [f"/robot/{link}" for link in links]), strict=True):
        assert_pose(robot, link, q, found)


def assert_pose(robot: Robot, link: str, q: np.ndarray, found: list[float] | None) -> None:
    expected = robot.placement(q, link).homogeneous
    np.testing.assert_allclose(np.reshape(found, (4, 4)).T, expected, atol=EXACT, err_msg=link)


def assert_playing(page: Page, robot: Robot, run: Recording) -> None:
    """Check every link's pose in many moments of a playing replay, and that it moves."""
    links = [frame.name for frame in robot.model.frames if str(frame.type) == "BODY"]
    seen: set[int] = set()
    while len(seen) < 6:
        page.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
        now = page.evaluate(
            f"(paths) => {{ {POSE_JS} return [player.playing, player.frame, player.fps, "
            f"paths.map(pose)]; }}",
            [f"/robot/{link}" for link in links],
        )
        playing, frame, fps, found = now
        assert playing
        seen.add(frame)
        q = np.array([np.interp(frame / fps, run.t, column) for column in run.q.T])
        for link, matrix in zip(links, found, strict=True):
            assert_pose(robot, link, q, matrix)


# ---- the live page -----------------------------------------------------------------------------


def test_the_page_shows_every_pose_that_is_sent(browser: Browser, robot: Robot) -> None:
    scene = Scene(robot)
    rng = np.random.default_rng(3)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        for number in range(1, 11):
            q = robot.random_configuration(rng)
            scene.display(q)
            barrier(scene, opened.page, number)
            assert_shows(opened.page, robot, scene, q)
        assert opened.complaints == []
        assert opened.requests
        ours = (server.url, server.url.replace("http", "ws"), "data:")
        assert all(url.startswith(ours) for url in opened.requests)


def test_a_playing_run_is_exact_in_every_moment(
    browser: Browser, robot: Robot, run: Recording
) -> None:
    scene = recording_scene(run)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "player.frames > 1")
        assert_playing(page, robot, run)
        wait_until(page, "player.frame === player.frames - 1")
        wait_until(page, "player.frame < player.frames / 2")  # and begins anew
        assert page.inner_text("#caption h1") == "arm3dof"
        assert page.inner_text("#verdict").startswith("Settled in ")
        assert page.locator("#joints tbody tr").count() == 3
        assert opened.complaints == []
        scene.display(TARGET)  # a live pose ends the replay
        barrier(scene, page, 1)
        assert_shows(page, robot, scene, TARGET)
        assert page.locator("#transport").is_hidden()


def test_a_person_can_pause_scrub_and_look_around(
    browser: Browser, robot: Robot, run: Recording
) -> None:
    scene = recording_scene(run)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "player.frames > 1")
        page.keyboard.press("Space")
        assert page.get_attribute("#play", "aria-label") == "Play"
        page.evaluate("player.seek(10)")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowLeft")
        assert page.input_value("#time") == "11"
        assert page.inner_text("#clock").startswith("0.18 / ")
        q = np.array([np.interp(11 / 60, run.t, column) for column in run.q.T])
        assert_shows(page, robot, scene, q)
        eyes = []
        for name in ("Front", "Side", "Top", "Corner"):
            page.click(f"#views >> text={name}")
            eyes.append(tuple(page.evaluate("viewer.camera.position.toArray()")))
        assert len(set(eyes)) == 4
        page.keyboard.press("3")
        assert page.get_attribute("#views button:nth-child(3)", "aria-pressed") == "true"
        page.click("#views >> text=Scene")
        assert page.locator(".dg.main").is_visible()
        page.click("#views >> text=Scene")
        assert page.locator(".dg.main").is_hidden()
        page.select_option("#speed", "2")
        page.click("#play")
        wait_until(page, "player.playing && player.frame > 20")
        assert opened.complaints == []


def test_the_page_heals_after_a_restart(browser: Browser, robot: Robot, run: Recording) -> None:
    scene = recording_scene(run)
    server = serve(scene.window).start()
    with visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "player.frames > 1")
        server.stop()
        wait_until(page, "!document.querySelector('#status').hidden")
        assert "Trying again" in page.inner_text("#status")
        other = Scene(robot)
        other.display(TARGET)
        with serve(other.window, server.port):
            wait_until(page, "document.querySelector('#status').hidden")
            barrier(other, page, 1)
            assert_shows(page, robot, other, TARGET)
            assert poses(page, ["/target", "/path"]) == [None, None]  # of the old scene
            assert page.locator("#transport").is_hidden()


def test_reloads_and_tabs_leave_nothing_behind(browser: Browser, robot: Robot) -> None:
    scene = Scene(robot)
    with serve(scene.window) as server:
        with visit(browser, server.url) as first, visit(browser, server.url) as second:
            for number in range(1, 5):
                first.page.reload(wait_until="domcontentloaded")
                barrier(scene, first.page, number)
            barrier(scene, second.page, 11)
            assert scene.window.client_count == 2
        with visit(browser, server.url) as third:
            barrier(scene, third.page, 12)
            assert scene.window.client_count == 1


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_nothing_overlaps_or_leaves_the_window(
    browser: Browser, run: Recording, width: int, height: int
) -> None:
    with (
        serve(recording_scene(run).window) as server,
        visit(browser, server.url, width=width, height=height) as opened,
    ):
        wait_until(opened.page, "player.frames > 1")
        cards = [card.bounding_box() for card in opened.page.locator(".card:visible").all()]
        assert len(cards) == 4
        for card in cards:
            assert card["x"] >= 0
            assert card["y"] >= 0
            assert card["x"] + card["width"] <= width
            assert card["y"] + card["height"] <= height
        for k, one in enumerate(cards):
            for two in cards[k + 1 :]:
                assert (
                    one["x"] + one["width"] <= two["x"]
                    or two["x"] + two["width"] <= one["x"]
                    or one["y"] + one["height"] <= two["y"]
                    or two["y"] + two["height"] <= one["y"]
                )


def test_a_slow_machine_draws_motion_coarser_and_rest_in_full(
    browser: Browser, run: Recording
) -> None:
    with (
        serve(recording_scene(run).window) as server,
        visit(browser, server.url, width=320, height=240) as opened,
    ):
        page = opened.page
        wait_until(page, "player.frames > 1")
        sun = "viewer.scene_tree.find(['Lights', 'Key', '<object>']).object"
        page.evaluate("quality.slow = 0")  # every frame comes too late
        wait_until(page, "quality.level === quality.levels.length - 1")
        assert page.evaluate("viewer.renderer.getPixelRatio()") == 1  # so small a picture
        page.evaluate("quality.enough = 0, quality.apply()")
        assert page.evaluate("viewer.renderer.getPixelRatio()") < 0.5
        assert not page.evaluate(f"{sun}.castShadow")
        page.evaluate("quality.slow = 1e6")  # and now each is in time
        wait_until(page, "quality.level === quality.least")
        page.evaluate("quality.slow = 0")
        page.keyboard.press("Space")
        wait_until(page, "quality.level === 0")
        # without a graphics card, smooth edges come from drawing a still picture larger
        full = 2 if page.evaluate("software") else 1
        assert page.evaluate("viewer.renderer.getPixelRatio()") == full
        assert page.evaluate(f"{sun}.castShadow")


# The box around a link that is drawn in one go, and that around its pieces, in the link's frame.
BOXES = """() => {
  const { Box3 } = MeshCat.THREE;
  const { whole, solids } = united.wholes.get("/robot/link2");
  const numbers = ({ min, max }) => [...min.toArray(), ...max.toArray()];
  const around = new Box3();
  viewer.scene.updateMatrixWorld(true);
  const toLink = whole.parent.matrixWorld.clone().invert();
  for (const solid of solids) {
    const placed = solid.geometry.clone().applyMatrix4(toLink.clone().multiply(solid.matrixWorld));
    placed.computeBoundingBox();
    around.union(placed.boundingBox);
  }
  whole.geometry.computeBoundingBox();
  return [numbers(whole.geometry.boundingBox), numbers(around)];
}"""


def test_what_hangs_together_is_drawn_in_one_go(browser: Browser, run: Recording) -> None:
    scene = recording_scene(run)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "player.frames > 1 && united.wholes.size > 3")
        link = "united.wholes.get('/robot/link2')"
        count = page.evaluate(f"{link}.solids.length")
        assert count == sum(it.link == "link2" for it in scene.drawing.visuals)
        assert not page.evaluate(f"{link}.solids.some((it) => it.visible)")
        whole, pieces = page.evaluate(BOXES)
        np.testing.assert_allclose(whole, pieces, atol=1e-6)
        assert page.evaluate("viewer.renderer.info.render.calls") < 60
        # it has a coarse twin for motion where drawing is slow, of the same size
        looks = f"[{link}.whole.visible, {link}.coarse.visible]"
        page.evaluate("quality.moves = quality.rests = () => false, quality.set(1), null")
        assert page.evaluate(looks) == [False, True]
        page.evaluate("quality.set(0)")
        assert page.evaluate(looks) == [True, False]
        corners = page.evaluate(
            f"[{link}.whole, {link}.coarse].map((it) => it.geometry.index.count)"
        )
        assert corners[1] < 0.6 * corners[0]
        coarse = page.evaluate(BOXES.replace("{ whole, solids }", "{ coarse: whole, solids }"))[0]
        np.testing.assert_allclose(coarse, whole, atol=2e-3)
        # a piece that is drawn anew takes its link apart, which is then made whole again
        page.evaluate(f"() => {{ window.before = {link}.whole; }}")
        look = shapes.material((1.0, 0.0, 0.0))
        scene.window.post(shapes.draw("/robot/link2/0", shapes.box((0.1, 0.1, 0.1)), look))
        wait_until(page, f"{link} && {link}.whole !== before && !before.parent")
        assert page.evaluate(f"{link}.solids.length") == count
        scene.window.post(shapes.delete("/robot"))
        wait_until(page, "united.wholes.size === 0")


def test_a_shader_outlives_the_last_thing_that_used_it(browser: Browser, run: Recording) -> None:
    scene = recording_scene(run)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "player.frames > 1")
        page.keyboard.press("Space")
        ids = "viewer.renderer.info.programs.map((it) => it.id)"
        wait_until(page, f"quality.level === 0 && {ids}.length > 3")
        before = page.evaluate(ids)
        scene.window.post(shapes.delete("/path"), shapes.delete("/target"))
        wait_until(page, "!viewer.scene_tree.children.path")
        page.evaluate("breath.until = 0, viewer.render()")
        assert set(before) <= set(page.evaluate(ids))


def test_nothing_is_asked_of_the_screen_while_nothing_moves(browser: Browser, robot: Robot) -> None:
    scene = Scene(robot)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        page = opened.page
        wait_until(page, "viewer.scene_tree.children.robot && !viewer.needs_render")
        page.evaluate("window.asked = 0, window.ask = window.requestAnimationFrame, null")
        page.evaluate(
            "window.requestAnimationFrame = (call) => { asked += 1; return ask(call); }, null"
        )
        page.evaluate("new Promise((done) => setTimeout(done, 300))")
        assert page.evaluate("asked") <= 2  # what the last picture took is measured
        drawn = page.evaluate("viewer.renderer.info.render.frame")
        scene.display([0.3, 0.4, -0.5])
        wait_until(page, f"viewer.renderer.info.render.frame > {drawn} && !viewer.needs_render")


def test_the_floor_behind_a_motion_looks_as_drawn(browser: Browser, robot: Robot) -> None:
    scene = Scene(robot)
    scene.window.post(shapes.move("/robot", [0, 0, 0.01]))  # the grid lies a hair above the floor
    grab = """() => {
      breath.until = 0;
      quality.set(1);
      return [drawn(), backdrop.usable];
    }"""
    with serve(scene.window) as server, visit(browser, server.url, width=200, height=150) as opened:
        page = opened.page
        page.evaluate(DRAWN)
        wait_until(page, "viewer.scene_tree.children.robot && !viewer.needs_render")
        page.evaluate("quality.rests = () => false, null")
        page.evaluate("viewer.set_dirty = () => {}, null")
        page.evaluate("backdrop.view = '', null")
        direct, usable = page.evaluate(grab)
        assert not usable
        kept, usable = page.evaluate(grab)
        assert usable
        apart = np.abs(np.array(direct, int) - np.array(kept, int))
        assert np.ptp(direct) > 100
        assert apart.max() <= 2
        assert page.evaluate("viewer.scene_tree.children.floor.object.visible")
        page.evaluate("night.set(true)")
        assert not page.evaluate(grab)[1]  # the floor has changed
        page.evaluate("viewer.camera.position.x += 0.1, null")
        assert page.evaluate(grab)[1] is False  # the view has turned


@pytest.mark.parametrize("level", [1, 2])
def test_only_what_changes_of_a_motion_is_drawn_anew(
    browser: Browser, robot: Robot, level: int
) -> None:
    scene = Scene(robot)
    scene.show_target([0.12, 0.05, 0.1])
    grab = """([level, whole]) => {
      breath.until = quality.enough = 0;
      quality.set(level);
      region.whole ||= whole;
      const pixels = drawn();
      const [, , width, height] = window.area ?? [0, 0, 0, 0];
      return [pixels, 4 * width * height / pixels.length];
    }"""
    with serve(scene.window) as server, visit(browser, server.url, width=200, height=150) as opened:
        page = opened.page
        page.evaluate(DRAWN)
        wait_until(page, "viewer.scene_tree.children.target && !viewer.needs_render")
        page.evaluate("quality.rests = () => false, quality.moves = () => {}, null")
        page.evaluate("window.limit = region.limit, null")
        page.evaluate(
            "region.limit = (area) => { window.area = area; limit.call(region, area); }, null"
        )
        page.evaluate("viewer.set_dirty = () => {}, null")
        for _ in range(3):  # the floor becomes a picture
            page.evaluate(grab, [level, True])
        joint = "viewer.scene_tree.find(['robot', 'link3']).object"
        ring = "viewer.scene_tree.find(['target', 'ring']).object"
        for change in (
            f"{joint}.position.z += 0.01, null",
            f"{ring}.visible = false, null",
            f"{ring}.visible = true, {joint}.position.x += 0.02, null",
            "viewer.delete_path(['target'])",
        ):
            before, _ = page.evaluate(grab, [level, False])
            page.evaluate(change)
            changed, share = page.evaluate(grab, [level, False])
            anew, all_of_it = page.evaluate(grab, [level, True])
            assert changed == anew
            assert changed != before
            assert share < 0.5
            assert all_of_it == 1.0


def test_light_at_the_corners_looks_like_light_at_every_pixel(
    browser: Browser, robot: Robot
) -> None:
    scene = Scene(robot)
    grab = """(draw) => {
      breath.until = 0;
      corners.draw = draw ? drawnAtCorners : (scene, drawAll) => drawAll();
      return drawn();
    }"""
    with serve(scene.window) as server, visit(browser, server.url, width=200, height=150) as opened:
        page = opened.page
        page.evaluate(DRAWN)
        wait_until(page, "viewer.scene_tree.children.robot && !viewer.needs_render")
        scene.window.post(
            shapes.draw("/thing", shapes.sphere(0.03), shapes.material((1, 0.5, 0), "Lambert")),
            shapes.draw("/ball", shapes.sphere(0.02), shapes.material((0, 0.5, 1, 0.5))),
            shapes.move("/ball", [0.1, -0.1, 0.05]),
        )
        wait_until(page, "viewer.scene_tree.children.ball && !viewer.needs_render")
        page.evaluate("quality.rests = () => false, quality.slow = 1e6, quality.needed = 1, null")
        page.evaluate("viewer.set_dirty = () => {}, window.drawnAtCorners = corners.draw, null")
        page.evaluate(grab, True)  # from now on the floor is a picture
        pixels, at_corners = page.evaluate(grab, False), page.evaluate(grab, True)
        apart = np.abs(np.array(pixels, int) - np.array(at_corners, int))
        assert apart.max() > 0  # it was another way
        assert apart.mean() < 0.5
        assert np.percentile(apart, 99) <= 12
        lit = "viewer.scene_tree.children.thing.children['<object>'].object.material.type"
        assert page.evaluate(lit) == "MeshLambertMaterial"  # and all is as it was


# ---- the wall ----------------------------------------------------------------------------------

TRY = """([url, socket]) => Promise.all([
  fetch(url).then(() => "answered", () => "refused"),
  new Promise((done) => {
    const line = new WebSocket(socket);
    line.onmessage = () => done("answered");
    line.onclose = () => done("refused");
  }),
])"""


def test_pages_of_other_sites_get_nothing(browser: Browser, robot: Robot) -> None:
    async def hello(request: object) -> HTMLResponse:
        return HTMLResponse("<title>another site</title>")

    scene = Scene(robot)
    with (
        serve(scene.window) as server,
        LocalServer(Starlette(routes=[Route("/", hello)])) as foreign,
        visit(browser, foreign.url) as opened,
    ):
        addresses = [f"{server.url}scene.js", f"ws://127.0.0.1:{server.port}/scene"]
        assert opened.page.evaluate(TRY, addresses) == ["refused", "refused"]
        opened.page.goto("about:blank")  # its origin is "null"
        assert opened.page.evaluate(TRY, addresses) == ["refused", "refused"]
        assert scene.window.client_count == 0


def test_after_a_stop_with_a_page_open_nothing_is_left(browser: Browser, robot: Robot) -> None:
    threads = set(threading.enumerate())
    processes = {process.pid for process in psutil.Process().children(recursive=True)}
    scene = Scene(robot)
    with serve(scene.window) as server, visit(browser, server.url) as opened:
        barrier(scene, opened.page, 1)
        listening = [
            each.laddr
            for each in psutil.Process().net_connections("inet")
            if each.status == psutil.CONN_LISTEN
        ]
        assert ("127.0.0.1", server.port) in listening
        assert {address.ip for address in listening} == {"127.0.0.1"}
        server.stop()
        wait_until(opened.page, "!document.querySelector('#status').hidden")
    assert not [thread for thread in set(threading.enumerate()) - threads if thread.is_alive()]
    left = {process.pid for process in psutil.Process().children(recursive=True)} - processes
    assert not [pid for pid in left if "chrom" not in psutil.Process(pid).name()]
    assert not [
        each for each in psutil.Process().net_connections() if each.laddr[1:] == (server.port,)
    ]


# ---- the replay as a file ----------------------------------------------------------------------


def test_the_file_plays_without_a_server(
    browser: Browser, robot: Robot, run: Recording, tmp_path: Path
) -> None:
    path = write_replay(run, tmp_path / "replay.html")
    with visit(browser, path.as_uri()) as opened:
        wait_until(opened.page, "player.frames > 1")
        assert_playing(opened.page, robot, run)
        assert opened.page.title() == "arm3dof replay"
        assert opened.page.inner_text("#verdict").startswith("Settled in ")
        assert opened.page.locator("#status").is_hidden()
        assert opened.complaints == []
        assert [url for url in opened.requests if not url.startswith("data:")] == [path.as_uri()]


def test_who_asks_for_less_motion_gets_a_still(browser: Browser, run: Recording) -> None:
    with (
        serve(recording_scene(run).window) as server,
        browser.new_context(reduced_motion="reduce") as context,
    ):
        page = context.new_page()
        page.goto(server.url, wait_until="domcontentloaded")
        wait_until(page, "player.frames > 1")
        assert not page.evaluate("player.playing")
        assert page.locator("#transport").is_visible()
