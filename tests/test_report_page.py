"""The report in a real browser, opened from a file: charts and arm show the same instant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from browser import Visit, chromium, poses, visit, wait_until
from runs import smooth_run

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui.replay import frame_times
from arm3dof.ui.report import write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytestmark = [pytest.mark.browser, pytest.mark.slow]
EXACT = 1e-9
CHARTS = 5  # four quantities and the strip of statuses


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def run(robot: Robot) -> Recording:
    made = smooth_run(robot, duration=1.5)
    status, source = np.array(made.status), np.array(made.source)
    status[100:200], source[100:200] = ControlStatus.NOT_SOLVED, TorqueSource.PREVIOUS_PLAN
    return replace(made, status=status, source=source)


@pytest.fixture(scope="module")
def report(run: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(run, tmp_path_factory.mktemp("report") / "report.html")


def opened_still(opened: Visit) -> Page:
    wait_until(opened.page, "player.frames > 1 && report.charts.every((each) => each.cursorLine)")
    opened.page.evaluate("player.setPlaying(false)")
    return opened.page


def assert_at(page: Page, robot: Robot, run: Recording, frame: int) -> None:
    """Check that slider, clock, every chart's cursor and every link's pose are at one frame."""
    times, _ = frame_times(run)
    t = times[frame]
    assert page.input_value("#time") == str(frame)
    assert page.inner_text("#clock").startswith(f"{t:.2f} / ")
    cursors = page.evaluate(
        """() => report.charts.map((chart) => {
          const share = (chart.cursorLine.getAttribute("x1") - MARGIN.left)
            / (chart.width - MARGIN.left - MARGIN.right);
          return chart.axis.from + share * (chart.axis.to - chart.axis.from);
        })"""
    )
    assert len(cursors) == CHARTS
    np.testing.assert_allclose(cursors, t, atol=1e-9)
    q = np.array([np.interp(t, run.t, column) for column in run.q.T])
    links = [frame.name for frame in robot.model.frames if str(frame.type) == "BODY"]
    found = poses(page, [f"/robot/{link}" for link in links])
    for link, matrix in zip(links, found, strict=True):
        expected = robot.placement(q, link).homogeneous
        np.testing.assert_allclose(np.reshape(matrix, (4, 4)).T, expected, atol=EXACT)


def test_slider_charts_and_arm_move_together(
    browser: Browser, robot: Robot, run: Recording, report: Path
) -> None:
    with visit(browser, report.as_uri()) as opened:
        page = opened_still(opened)
        page.focus("#time")
        page.keyboard.press("Home")
        assert_at(page, robot, run, 0)
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        assert_at(page, robot, run, 3)
        page.keyboard.press("End")
        assert_at(page, robot, run, len(frame_times(run)[0]) - 1)
        page.locator("#time").fill("40")  # as a finger on the slider does
        assert_at(page, robot, run, 40)
        tau = np.interp(40 / 60, run.t, run.tau[:, 1])
        shown = page.locator(".chart").nth(3).locator(".values span").nth(1).inner_text()
        assert float(shown.replace("−", "-")) == pytest.approx(tau, abs=5e-3)
        assert opened.complaints == []
        assert [url for url in opened.requests if not url.startswith("data:")] == [report.as_uri()]


def test_dragging_in_a_chart_scrubs_and_zooming_keeps_time(
    browser: Browser, robot: Robot, run: Recording, report: Path
) -> None:
    with visit(browser, report.as_uri()) as opened:
        page = opened_still(opened)
        box = page.locator(".chart svg").first.bounding_box()
        middle = box["y"] + box["height"] / 2

        def x_of(t: float) -> float:
            return box["x"] + page.evaluate(f"report.charts[0].x({t})")

        page.mouse.move(x_of(0.2), middle)
        page.mouse.down()
        page.mouse.move(x_of(0.5), middle)
        page.mouse.up()
        assert_at(page, robot, run, 30)
        page.keyboard.down("Shift")  # select a window of time
        page.mouse.move(x_of(0.3), middle)
        page.mouse.down()
        page.mouse.move(x_of(0.9), middle)
        page.mouse.up()
        page.keyboard.up("Shift")
        window = page.evaluate("[report.axis.from, report.axis.to]")
        np.testing.assert_allclose(window, [0.3, 0.9], atol=0.01)
        assert_at(page, robot, run, 30)
        page.evaluate("player.seek(5)")  # before the window, which follows
        assert_at(page, robot, run, 5)
        page.keyboard.press("0")
        assert page.evaluate("report.axis.isWhole")
        page.mouse.move(x_of(0.6), middle)
        tip = page.inner_text("#tip").split("\n")
        assert float(tip[0].split()[2]) == pytest.approx(0.6, abs=0.01)
        assert tip[1] == "joint1"
        assert tip[2].endswith(" deg")
        page.click("[data-zoom=in]")
        assert not page.evaluate("report.axis.isWhole")
        page.click("[data-zoom=all]")
        page.click("#legend button >> nth=0")
        assert page.locator(".chart").first.locator("path.curve").count() == 2
        assert opened.complaints == []


def test_fallbacks_settling_and_limits_are_marked(browser: Browser, report: Path) -> None:
    with visit(browser, report.as_uri()) as opened:
        page = opened_still(opened)
        (mark,) = page.locator("#marks i").all()
        assert mark.get_attribute("title") == "no optimum: last plan"
        assert page.locator(".chart rect.veto").count() == 4
        assert page.locator(".chart text.settled").text_content().startswith("settled ")
        torque = page.locator(".chart").nth(3)
        assert torque.locator("line.limit-line").count() == 2
        assert torque.locator("text.limit").text_content() == "limit ±1.96 N m"
        assert page.locator(".said").inner_text() == "optimal"
        page.locator("#time").fill("15")
        assert page.locator(".said").inner_text() == "no optimum: last plan"
        assert "the plan of the last good step" in page.inner_text("#details")


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_the_window_in_light_and_dark(
    browser: Browser, report: Path, width: int, height: int, scheme: str
) -> None:
    with visit(browser, report.as_uri(), width=width, height=height) as opened:
        opened.page.emulate_media(color_scheme=scheme)
        page = opened_still(opened)
        is_dark = "true" if scheme == "dark" else "false"
        wait_until(page, f"document.body.classList.contains('dark') === {is_dark}")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for part in ("#caption", ".motion", ".plots", "#details", "#transport"):
            box = page.locator(part).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width
        unlabelled = page.evaluate(
            """() => [...document.querySelectorAll("button, input, select, [role=img]")]
              .filter((each) => each.checkVisibility() && !each.closest(".dg"))
              .filter((each) => !(each.textContent.trim() || each.ariaLabel)).length"""
        )
        assert unlabelled == 0


def test_on_paper_there_is_a_still_of_the_arm(browser: Browser, report: Path) -> None:
    with visit(browser, report.as_uri()) as opened:
        page = opened_still(opened)
        wait_until(page, "viewer.renderer.info.render.triangles > 1000")
        page.evaluate("""window.addEventListener("afterprint",
            () => { window.printed = document.querySelector("#still").src.length; })""")
        assert page.pdf(format="A4", print_background=True).startswith(b"%PDF")
        assert page.evaluate("window.printed") > 10_000
        assert page.locator("#still").is_hidden()
