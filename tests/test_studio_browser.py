"""The studio in a real browser: what a person does there, and what then happens."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import psutil
import pytest
from browser import ARGUMENTS, NAMES, chromium, expect, poses, wait_until
from mjpeg import Stream
from studio import Program, studio

from arm3dof.config.camera_file import load_camera
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui.demo_scene import draw_demo

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.studio]
EXACT = 1e-9
LOST = 3.0  # s in which a tab that is gone without a word is noticed
PATIENCE = 60_000  # ms: a busy machine draws slowly
SCREENSHOTS = Path(__file__).parent.parent / "out" / "screenshots"
LAST = "studio.live.last"
STILL = f"{LAST}.v.every((row) => row.every((v) => Math.abs(v) < 1e-4))"
PANELS = ("See", "Aim", "Move", "Tune", "Insight", "Files")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    with studio(tmp_path_factory.mktemp("studio")) as running:
        yield running


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@contextmanager
def visit(
    browser: Browser, url: str, *, width: int = 1280, height: int = 720, scheme: str = "light"
) -> Iterator[Page]:
    """A page that is open, alive, and has had nothing to complain of at its end."""
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
    page.set_default_timeout(PATIENCE)
    complaints: list[str] = []
    requests: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda it: complaints.append(it.text) if it.type == "error" else None)
    page.on("request", lambda request: requests.append(request.url))
    page.on("websocket", lambda socket: requests.append(socket.url))
    try:
        page.goto(url, wait_until="domcontentloaded")
        page.wait_for_function(f"window.studio && studio.live.pictures > 0 && {LAST}?.holder")
        yield page
    finally:
        page.close()
    assert complaints == []
    ours = (url, url.replace("http", "ws"), "data:", "blob:")
    assert all(it.startswith(ours) for it in requests), requests


@pytest.fixture(scope="module")
def opened(browser: Browser, program: Program) -> Iterator[Page]:
    with visit(browser, program.url) as page:
        yield page


@pytest.fixture
def page(opened: Page) -> Page:
    """The page, with the controls in its hands and the arm at rest."""
    take_the_controls(opened)
    rest(opened)
    return opened


def take_the_controls(page: Page) -> None:
    if not page.evaluate(f"{LAST}.holder === studioFacts.tab"):
        page.get_by_role("button", name="Take the controls").click()
        page.wait_for_function(f"window.studio && {LAST}?.holder === studioFacts.tab")


def snap(page: Page, name: str) -> None:
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.mouse.move(640, 8)
    page.screenshot(path=SCREENSHOTS / f"studio-{name}.png")


def panel(page: Page, name: str) -> None:
    page.get_by_role("tab", name=name).click()


def aim_at(page: Page, x: float, y: float, z: float) -> None:
    """Type a point [cm] and aim there."""
    panel(page, "Aim")
    for axis, value in zip("xyz", (x, y, z), strict=True):
        page.get_by_label(f"{axis} [cm]").fill(str(value))
    page.get_by_role("button", name="Aim there").click()


def slide(page: Page, key: str, steps: int) -> None:
    """Move a slider by the keyboard, ten steps at a time."""
    page.locator(f'[data-key="{key}"] [tabindex]').focus()
    for _ in range(abs(steps) // 10):
        page.keyboard.press("PageUp" if steps > 0 else "PageDown")


def rest(page: Page) -> None:
    """Let the arm come back to a quiet start."""
    page.keyboard.press("Escape")
    page.wait_for_function(f"{LAST}.mode === 0")


def now(page: Page) -> float:
    """The time of the arm's world [s]."""
    return page.evaluate(f"{LAST}.t.at(-1)")


def wait_for_motion(page: Page, since: float, joints: str = "[0, 1, 2]") -> None:
    """Wait until a joint has moved since a time, be it for a moment that the page shows late."""
    page.wait_for_function(
        f"""(since) => studio.past.t.some((t, row) => t > since
          && {joints}.some((joint) => Math.abs(studio.past.columns.v[row][joint]) > 0.05))""",
        arg=since,
    )


def run(page: Page, then: str = "") -> None:
    """Press Run, and another button right after it; return when that run has begun."""
    before = page.evaluate(f"{LAST}.run")
    page.evaluate(
        """(names) => names.forEach((name) => [...document.querySelectorAll(".transport button")]
          .find((it) => it.innerText.includes(name)).click())""",
        ["Run", then] if then else ["Run"],
    )
    page.wait_for_function(f"{LAST}.run > {before} && {LAST}.mode === 1")


def arrive(page: Page) -> None:
    """Run to the target, and wait for the arm to come to rest there."""
    run(page)
    page.wait_for_function(f"{LAST}.arrived && {LAST}.mode === 1")


def canvas_click(page: Page, pixel: list[int]) -> None:
    """Click where the picture shows a pixel."""
    at = page.evaluate(
        """([u, v]) => {
          const canvas = document.getElementById("picture");
          const box = canvas.getBoundingClientRect();
          const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
          return [(box.width - scale * canvas.width) / 2 + scale * (u + 0.5),
                  (box.height - scale * canvas.height) / 2 + scale * (v + 0.5)];
        }""",
        pixel,
    )
    page.locator("#picture").click(position={"x": at[0], "y": at[1]})


# ---- see -------------------------------------------------------------------------------------


def test_a_click_learns_a_colour_which_is_saved_and_loaded(page: Page, program: Program) -> None:
    panel(page, "See")
    page.wait_for_function(f"{LAST}.seen.some((it) => it.name === 'red')")
    red = page.evaluate(f"{LAST}.seen.find((it) => it.name === 'red').pixel")
    page.get_by_label("Name", exact=True).fill("mine")
    page.get_by_role("button", name="Add").click()
    page.get_by_role("button", name="mine", exact=True).wait_for()
    canvas_click(page, red)
    page.get_by_text("Learned the colour of 'mine'").wait_for()
    page.wait_for_function(f"{LAST}.seen.some((it) => it.name === 'mine')")
    page.get_by_role("switch", name="Show the mask").click()
    page.locator("#mask").wait_for()
    snap(page, "learn")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("Wrote ").wait_for()
    saved = load_camera(program.out / "camera.toml")
    assert {"red", "green", "yellow", "mine"} <= set(saved.targets)
    learned = saved.targets["mine"].hsv
    assert learned.wraps or learned.low[0] < 15  # it is a red
    page.get_by_role("button", name="Remove").click()
    page.wait_for_function(f"!{LAST}.seen.some((it) => it.name === 'mine')")
    page.get_by_role("button", name="Load").click()
    page.wait_for_function(f"{LAST}.seen.some((it) => it.name === 'mine')")
    page.get_by_role("button", name="mine", exact=True).click()
    page.get_by_role("button", name="Remove").click()


def test_the_light_dims_the_picture(page: Page) -> None:
    panel(page, "See")
    mean = """() => { const c = document.getElementById("picture");
      const d = c.getContext("2d").getImageData(0, 0, 60, 60).data;
      return d.reduce((sum, x, k) => k % 4 < 3 ? sum + x : sum, 0) / d.length; }"""
    bright = page.evaluate(mean)
    slide(page, "light", -10)
    page.wait_for_function(f"({mean})() < {0.85 * bright}")
    slide(page, "light", 10)
    page.wait_for_function(f"({mean})() > {0.95 * bright}")


# ---- aim and move ------------------------------------------------------------------------------


def test_an_object_that_is_clicked_is_aimed_at(page: Page) -> None:
    panel(page, "Aim")
    green = page.evaluate(f"{LAST}.seen.find((it) => it.name === 'green').pixel")
    canvas_click(page, green)
    expect(page.locator(".answer")).to_contain_text("The target is reached in")
    expect(page.locator(".branches button").first).to_contain_text("front")
    assert page.locator(".branches button").count() == 4
    page.get_by_role("switch", name="Show the reachable region").click()
    frame = page.frame(url="**/3d/**")
    wait_until(frame, "viewer.scene_tree.children.region")
    snap(page, "aim")
    page.get_by_role("switch", name="Show the reachable region").click()
    aim_at(page, 60, 0, 0)
    expect(page.locator(".answer")).to_contain_text("farther away than the arm reaches")


def test_the_arm_arrives_and_the_page_shows_every_link_where_pinocchio_says(
    page: Page, robot: Robot
) -> None:
    aim_at(page, 16, -4, 4)
    expect(page.locator(".answer")).to_contain_text("The target is reached")
    arrive(page)
    expect(page.locator("#status")).to_contain_text("Arrived")
    np.testing.assert_allclose(page.evaluate(f"{LAST}.tool"), [0.16, -0.04, 0.04], atol=2e-3)
    rest(page)
    page.wait_for_function(STILL)
    frame = page.frame(url="**/3d/**")
    links = ["base_link", "link1", "link2", "link3"]
    shown = page.evaluate(f"{LAST}.q")
    # the page's numbers and its 3-D view come by different ways: wait until they are of one moment
    for _ in range(200):
        shown = page.evaluate(f"{LAST}.q")
        found = poses(frame, [f"/robot/{link}" for link in links])
        expected = [robot.placement(shown, link).homogeneous for link in links]
        if np.allclose([np.reshape(it, (4, 4)).T for it in found], expected, atol=EXACT, rtol=0):
            break
        page.wait_for_timeout(50)
    for link, it in zip(links, found, strict=True):
        expected = robot.placement(shown, link).homogeneous
        np.testing.assert_allclose(np.reshape(it, (4, 4)).T, expected, atol=EXACT, err_msg=link)
    snap(page, "arrived")


def test_escape_stops_the_arm_in_the_middle_of_a_run(page: Page) -> None:
    panel(page, "Tune")
    aim_at(page, 14, 12, 6)
    expect(page.locator(".answer")).to_contain_text("The target is reached")
    run(page, then="Step")  # time stands still in the middle of the run, however slow the page is
    page.wait_for_function(f"{LAST}.paused && {LAST}.v.at(-1).some((v) => Math.abs(v) > 0.1)")
    page.keyboard.press("Escape")
    page.wait_for_function(f"{LAST}.mode === 0")
    off = page.evaluate(f"Math.max(...{LAST}.e.at(-1).map(Math.abs))")
    assert off > 0.05  # it went no further
    expect(page.locator("#status")).to_contain_text("Holding still")
    snap(page, "stopped")


def test_the_plan_is_drawn_ahead_of_the_arm(page: Page, robot: Robot) -> None:
    aim_at(page, 14, -12, 6)
    expect(page.locator(".answer")).to_contain_text("The target is reached")
    run(page, then="Step")  # and time stands still, a control step later
    page.wait_for_function(f"{LAST}.paused && {LAST}.plan_t.length > 10")
    for chart in ("e", "v"):
        page.wait_for_function(
            """(name) => studio.charts.get(name).curves
              .filter((it) => it.kind === "plan").every((it) => it.length > 10)""",
            arg=chart,
        )
    frame = page.frame(url="**/3d/**")
    wait_until(frame, "viewer.scene_tree.children.plan.children[1].object.visible")
    assert not frame.evaluate("viewer.scene_tree.children.ghost.object.visible")
    last = page.evaluate(LAST)
    expected = np.array(last["q_target"]) - last["plan_e"][-1]
    shown = np.reshape(poses(frame, ["/plan/1/link3"])[0], (4, 4)).T
    np.testing.assert_allclose(shown, robot.placement(expected, "link3").homogeneous, atol=2e-3)
    snap(page, "plan")
    page.get_by_role("button", name="Pause").click()
    page.wait_for_function(f"{LAST}.arrived && {LAST}.mode === 1")
    wait_until(frame, "!viewer.scene_tree.children.plan.children[1].object.visible")


def test_time_pauses_and_goes_on_step_by_step(page: Page) -> None:
    page.get_by_role("button", name="Pause").click()
    page.wait_for_function(f"{LAST}.paused")
    before = page.evaluate(f"{LAST}.t.at(-1)")
    page.get_by_role("button", name="Step").click()
    page.wait_for_function(f"Math.abs({LAST}.t.at(-1) - {before + 0.05}) < 1e-3")
    page.get_by_role("button", name="Pause").click()
    page.wait_for_function(f"!{LAST}.paused")


def test_a_newcomer_grasps_with_one_click(page: Page) -> None:
    page.wait_for_function(f"{LAST}.seen.length > 0")
    page.locator(".transport").get_by_role("button", name="Grasp").click()
    expect(page.locator("#status")).to_contain_text("By itself")
    page.get_by_text("The task is done").wait_for(timeout=PATIENCE)
    snap(page, "grasped")
    panel(page, "Move")
    page.get_by_role("button", name="Restart").click()


def test_sorting_begins_and_can_be_stopped(page: Page) -> None:
    panel(page, "Move")
    start = now(page)
    page.get_by_role("button", name="Sort").click()
    page.wait_for_function(f"{LAST}.mode === 3")
    expect(page.locator("#status")).to_contain_text("By itself")
    wait_for_motion(page, start)
    page.keyboard.press("Escape")
    page.wait_for_function(f"{LAST}.mode === 0")
    page.get_by_role("button", name="Restart").click()


# ---- tune and understand -----------------------------------------------------------------------


def test_a_heavier_link_takes_more_torque(page: Page) -> None:
    aim_at(page, 20, 0, 2)
    expect(page.locator(".answer")).to_contain_text("The target is reached")
    arrive(page)
    page.wait_for_function(STILL)  # what braking takes is not what holding takes
    torque = f"Math.max(...{LAST}.tau.at(-1).map(Math.abs))"
    light = page.evaluate(torque)
    panel(page, "Tune")
    page.locator(".q-select", has_text="Part").click()
    page.get_by_role("option", name="link3 (link)").click()
    slide(page, "link3.mass", 30)
    page.get_by_text("link3.mass = ").wait_for()
    page.wait_for_function(f"{torque} > {light + 0.02}")
    snap(page, "tune")
    page.get_by_role("button", name="Defaults").click()
    page.get_by_text("Nothing: all is as it comes.").wait_for()
    page.wait_for_function(f"Math.abs({torque} - {light}) < 0.03")


def test_a_push_and_a_payload_show_in_the_charts(page: Page) -> None:
    panel(page, "Move")
    start = now(page)
    page.get_by_role("button", name="joint1").click()
    wait_for_motion(page, start, "[0]")
    panel(page, "Insight")
    page.wait_for_function("document.getElementById('fact-step')?.textContent.includes('µs')")
    page.get_by_role("button", name="Keep run").click()
    snap(page, "insight")
    with page.expect_download() as csv:
        page.get_by_role("button", name="CSV").click()
    assert csv.value.path().read_text().startswith("t_s,e_joint1,e_joint2,e_joint3,v_joint1")
    with page.expect_download() as png:
        page.get_by_role("button", name="PNG").click()
    assert png.value.path().read_bytes().startswith(b"\x89PNG")


def test_what_is_kept_is_written_into_the_folder(page: Page, program: Program) -> None:
    aim_at(page, 15, 5, 5)
    arrive(page)
    panel(page, "Files")
    for name, file in (("Recording", "run-1.npz"), ("TOML", "studio.toml"), ("URDF", "arm.urdf")):
        page.get_by_role("button", name=name).click()
        page.get_by_role("listitem").filter(has_text=file).wait_for()
    recording = Recording.load(program.out / "run-1.npz")
    np.testing.assert_allclose(recording.q[-1], recording.q_target, atol=0.01)
    assert load_robot(program.out / "arm.urdf").nv == 3
    snap(page, "files")


def test_a_report_opens_from_its_file_and_is_scrubbed(
    browser: Browser, page: Page, program: Program
) -> None:
    aim_at(page, 15, -5, 5)
    arrive(page)
    panel(page, "Files")
    page.get_by_role("button", name="Report").click()
    page.get_by_role("listitem").filter(has_text="report-1.html").wait_for()
    file = program.out / "report-1.html"
    report = browser.new_page(viewport={"width": 1280, "height": 900})
    try:
        report.goto(file.as_uri(), wait_until="domcontentloaded")
        wait_until(report, "player.frames > 1")
        report.evaluate("player.setPlaying(false)")
        shown = []
        for share in (0.0, 0.5):
            value = report.evaluate(f"Math.round({share} * player.frames)")
            report.locator("#time").fill(str(value))
            wait_until(report, f"player.frame === {value}")
            shown.append(poses(report, ["/robot/link3"])[0])
        assert np.abs(np.subtract(*shown)).max() > 0.01  # the arm has moved with the slider
        snap(report, "report")
    finally:
        report.close()


# ---- many tabs ---------------------------------------------------------------------------------


def test_one_tab_holds_the_controls_and_a_lost_one_leaves_the_arm_safe(
    browser: Browser, program: Program, page: Page
) -> None:
    with visit(browser, program.url) as other:
        take_the_controls(other)
        page.wait_for_function(f"{LAST}.holder !== studioFacts.tab")
        page.locator(".transport").get_by_role("button", name="Run").click()
        page.get_by_text("Another tab holds the controls").wait_for()
        aim_at(other, 14, -10, 4)
        run(other)
        page.wait_for_function(f"{LAST}.mode === 1")  # it sees the same
    page.wait_for_function(f"{LAST}.mode === 0")  # and that the arm has been stopped
    page.wait_for_function(f"{LAST}.holder === null")
    take_the_controls(page)


def test_a_busy_page_keeps_the_controls_and_a_silent_browser_loses_them(
    browser: Browser, program: Program, page: Page
) -> None:
    mine = processes()
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    other = browser.browser_type.launch(executable_path=path, args=list(ARGUMENTS))
    its: set[psutil.Process] = set()
    try:
        with visit(other, program.url) as far:
            take_the_controls(far)
            run(far)
            far.evaluate("for (const end = performance.now() + 4000; performance.now() < end;);")
            assert far.evaluate(f"{LAST}.holder === studioFacts.tab")
            assert page.evaluate(f"{LAST}.holder !== null && {LAST}.mode === 1")
            its = processes() - mine  # the one that answers pings comes with the first page
            begin = time.monotonic()
            for process in its:
                process.suspend()  # as quiet as behind a cut cable: no connection is closed
            page.wait_for_function(f"{LAST}.mode === 0 && {LAST}.holder === null")
            assert time.monotonic() - begin < LOST + 1.0  # the page tells of it a little later
            for process in its:
                process.resume()
            far.wait_for_function(f"{LAST}.holder")  # it comes back, and without an error
    finally:
        for process in its:
            with suppress(psutil.Error):
                process.resume()
        other.close()
    take_the_controls(page)


def processes() -> set[psutil.Process]:
    """The processes that this one has started, and theirs."""
    return set(psutil.Process().children(recursive=True))


def test_a_page_comes_back_by_itself_after_a_restart_of_the_server(
    browser: Browser, tmp_path: Path
) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(PATIENCE)
    try:
        with studio(tmp_path) as first:
            page.goto(first.url, wait_until="domcontentloaded")
            page.wait_for_function(f"window.studio && {LAST}?.holder === studioFacts.tab")
            before = page.evaluate("studioFacts.tab")
        page.get_by_text("Connection lost").first.wait_for()
        with studio(tmp_path, "--port", str(first.port)):
            page.wait_for_function(
                f"window.studio && {LAST}?.holder === studioFacts.tab"
                f" && studioFacts.tab !== '{before}' && studio.live.pictures > 0"
            )
            run(page)
    finally:
        page.close()


def test_a_stream_that_ends_is_said_on_the_page_and_comes_back(
    browser: Browser, tmp_path: Path
) -> None:
    stream = Stream(draw_demo(load_camera("desk").camera, np.random.default_rng(0)))
    status, nothing = "#status", "#nothing"
    try:
        with (
            studio(tmp_path, "--camera", stream.url) as program,
            visit(browser, program.url) as page,
        ):
            page.wait_for_function(f"{LAST}.seen.some((it) => it.name === 'green')")
            run(page)
            stream.off.set()
            page.wait_for_function(f"{LAST}.blind && {LAST}.mode === 0")
            expect(page.locator(status)).to_contain_text("Holding still. No picture: http://127")
            expect(page.locator(nothing)).to_contain_text("has ended; check the camera")
            expect(page.get_by_role("alert").first).to_contain_text("the arm was stopped")
            snap(page, "blind")
            stream.off.clear()
            page.wait_for_function(f"!{LAST}.blind && {LAST}.seen.length > 0")
            expect(page.locator(status)).not_to_contain_text("No picture")
    finally:
        stream.close()


# ---- how it looks ------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_it_fits_the_window(browser: Browser, program: Program, width: int, height: int) -> None:
    with visit(browser, program.url, width=width, height=height, scheme="dark") as page:
        page.wait_for_function("document.getElementById('seen').children.length > 0")
        wait_until(page.frame(url="**/3d/**"), "window.viewer?.scene_tree.children.robot")
        for scheme in ("dark", "light"):
            page.emulate_media(color_scheme=scheme)
            page.wait_for_function(
                "(dark) => document.body.classList.contains('body--dark') === dark",
                arg=scheme == "dark",
            )
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            if width > 900:
                assert page.evaluate("document.documentElement.scrollHeight") <= height
            snap(page, f"{width}-{scheme}")
        for name in PANELS:
            panel(page, name)
            assert page.evaluate("document.documentElement.scrollWidth") <= width, name


NAMELESS = """() => [...document.querySelectorAll(
    "button, input, canvas, iframe," +
    "[role=slider], [role=switch], [role=combobox]")]
  .filter((it) => it.offsetParent !== null)
  .filter((it) => !(it.textContent.trim() || it.ariaLabel || it.title || it.labels?.length
    || it.closest("label")))
  .map((it) => it.outerHTML.slice(0, 120))"""
CONTROLS = ".q-btn, .q-slider, .q-toggle, .q-field, .q-tab, #seen button"
# every control that is seen, with what its title says; those without show a tooltip of their own
TITLES = f"""() => [...document.querySelectorAll("{CONTROLS}")].map((it, index) => ({{
    index, seen: it.offsetParent !== null && !it.closest(".q-notification"),
    name: it.ariaLabel || it.textContent.trim() || it.outerHTML.slice(0, 120),
    title: it.closest("[title]")?.title ?? "",
    value: it.closest(".field")?.querySelector(".value")?.textContent ?? "",
  }})).filter((it) => it.seen)"""


def test_everything_has_a_name_and_the_keyboard_reaches_it(page: Page) -> None:
    for name in PANELS:
        panel(page, name)
        assert page.evaluate(NAMELESS) == [], name
    page.locator("body").click(position={"x": 300, "y": 30})
    reached = []
    for _ in range(5):
        page.keyboard.press("Tab")
        reached.append(page.evaluate("document.activeElement.textContent.trim()"))
    assert any("Run" in text for text in reached), reached
    assert any("Stop" in text for text in reached), reached


def test_every_control_says_its_effect_and_unit(page: Page) -> None:
    seen = set()
    for name in PANELS:
        panel(page, name)
        page.locator(".pages").hover(position={"x": 4, "y": 4})
        for control in page.evaluate(TITLES):
            tip = control["title"] or tooltip(page, control["index"], name)
            assert len(tip) > 8, (name, control)
            unit = control["value"].lstrip("-–0123456789. ")
            assert not unit or f"[{unit}]" in tip, (name, control, tip)
            seen.add(control["name"])
    assert len(seen) > 50, seen


def tooltip(page: Page, index: int, panel: str) -> str:
    """What appears when the pointer rests on a control."""
    from playwright.sync_api import TimeoutError

    control = page.locator(CONTROLS).nth(index)
    control.hover(force=True)
    shown = page.locator(".q-tooltip").last
    try:
        shown.wait_for(timeout=5000)
    except TimeoutError:
        raise AssertionError(f"no tooltip: {panel}: {control.inner_text()}") from None
    text = shown.inner_text()
    page.mouse.move(640, 8)
    expect(page.locator(".q-tooltip")).to_have_count(0)
    return text
