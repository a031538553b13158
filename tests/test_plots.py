"""The figures: the right columns in the right units, with limits and settling marked."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from runs import smooth_run

from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Limits, Robot
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.ui import plots
from arm3dof.ui.style import STYLE

PNG = b"\x89PNG\r\n"


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def run(robot: Robot) -> Recording:
    return smooth_run(robot)


def many_joints(nv: int, rng: np.random.Generator, rows: int = 40) -> Recording:
    """A recording of nothing in particular, with any number of joints."""
    columns = {name: rng.normal(size=(rows, nv)) for name in ("q", "v", "tau", "u", "e")}
    limits = np.full(nv, 50.0)
    return Recording(
        t=np.arange(rows) * 0.01,
        **columns,
        status=np.zeros(rows),
        source=np.zeros(rows),
        step_time=np.full(rows, 1e-4),
        control_dt=0.01,
        q_target=np.zeros(nv),
        joint_names=tuple(f"joint{k}" for k in range(nv)),
        tool_frame="tool",
        limits=Limits(-limits, limits, limits, limits),
        robot=load_robot().description,
        notes={},
    )


def with_limits(run: Recording, **limits: np.ndarray) -> Recording:
    return replace(run, limits=replace(run.limits, **limits))


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def curves(axes: Axes, run: Recording) -> dict[str, np.ndarray]:
    return {
        line.get_label(): line.get_ydata()
        for line in axes.lines
        if line.get_label() in run.joint_names
    }


@pytest.mark.parametrize(
    ("plot", "column", "factor", "unit"),
    [
        (plots.plot_error, "e", 180 / np.pi, "[deg]"),
        (plots.plot_velocity, "v", 1, "[rad/s]"),
        (plots.plot_controller, "u", 1, "[rad/s²]"),
        (plots.plot_torque, "tau", 1, "[N m]"),
    ],
)
def test_each_figure_draws_its_column_in_its_unit(
    run: Recording, plot: Callable[[Recording], Figure], column: str, factor: float, unit: str
) -> None:
    (axes,) = plot(run).axes
    assert unit in axes.get_ylabel()
    assert axes.get_xlabel() == "time [s]"
    drawn = curves(axes, run)
    assert tuple(drawn) == run.joint_names
    for joint, name in enumerate(run.joint_names):
        np.testing.assert_allclose(drawn[name], factor * getattr(run, column)[:, joint])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == list(run.joint_names)
    assert axes.get_xlim() == (0, pytest.approx(3.0))


def test_the_torque_limit_is_always_in_the_picture(run: Recording) -> None:
    (axes,) = plots.plot_torque(run).axes
    levels = {float(line.get_ydata()[0]) for line in axes.lines if len(line.get_ydata()) == 2}
    assert levels == {-1.96, 0, 1.96}
    assert "limit ±1.96 N m" in texts(axes)
    low, high = axes.get_ylim()
    assert low < -1.96 < 1.96 < high


def test_a_far_velocity_limit_is_told_and_a_near_one_drawn(run: Recording) -> None:
    far = with_limits(run, v_max=np.full(3, 100.0))
    (axes,) = plots.plot_velocity(far).axes
    assert "limit ±100 rad/s, outside the picture" in texts(axes)
    assert axes.get_ylim()[1] < 50
    (axes,) = plots.plot_velocity(with_limits(run, v_max=np.full(3, 4.0))).axes
    assert "limit ±4 rad/s" in texts(axes)
    assert axes.get_ylim()[1] > 4


def test_different_limits_say_whose_they_are(run: Recording) -> None:
    mixed = with_limits(run, tau_max=np.array([1.0, 2.0, 2.0]))
    (axes,) = plots.plot_torque(mixed).axes
    assert "limit ±1 N m (joint1)" in texts(axes)
    assert "limit ±2 N m (joint2, joint3)" in texts(axes)
    some = with_limits(run, tau_max=np.array([1.0, np.inf, np.inf]))
    (axes,) = plots.plot_torque(some).axes
    assert "limit ±1 N m (joint1)" in texts(axes)
    many = many_joints(4, np.random.default_rng(0))
    many = with_limits(many, tau_max=np.array([9.0, 5.0, 5.0, 5.0]))
    assert "limit ±5 N m (3 joints)" in texts(plots.plot_torque(many).axes[0])


def test_without_limits_none_is_drawn(run: Recording) -> None:
    free = with_limits(run, v_max=np.full(3, np.inf), tau_max=np.full(3, np.inf))
    for plot in (plots.plot_velocity, plots.plot_torque):
        assert not any("limit" in text for text in texts(plot(free).axes[0]))


def test_settling_is_marked_where_it_happens(robot: Robot, run: Recording) -> None:
    time = summarise(run).settling_time
    for plot in (plots.plot_error, plots.plot_velocity, plots.plot_controller, plots.plot_torque):
        (axes,) = plot(run).axes
        assert f"settled {time:.2f} s" in texts(axes)
        assert any(list(line.get_xdata()) == [time, time] for line in axes.lines)
    (axes,) = plots.plot_error(run).axes
    assert [zoom.get_title(loc="left") for zoom in axes.child_axes] == ["settled band, enlarged"]
    late = smooth_run(robot, stiffness=4.0, duration=1.8)
    assert summarise(late).settled
    (axes,) = plots.plot_error(late).axes
    assert [text.get_ha() for text in axes.texts] == ["right"]  # it would leave the picture
    assert not axes.child_axes  # and there is no room to enlarge
    never = smooth_run(robot, stiffness=2.0)
    assert not summarise(never).settled
    (axes,) = plots.plot_error(never).axes
    assert not texts(axes)


def test_the_overview_holds_all_four_and_one_legend(run: Recording) -> None:
    figure = plots.plot_overview(run)
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "Joint error",
        "Joint velocity",
        "Controller",
        "Joint torque",
    ]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(run.joint_names)
    assert all(axes.get_legend() is None for axes in figure.axes)


@pytest.mark.parametrize("nv", [1, 2, 7, 16])
def test_any_number_of_joints_can_be_told_apart(nv: int) -> None:
    run = many_joints(nv, np.random.default_rng(nv))
    (axes,) = plots.plot_velocity(run).axes
    looks = {
        (line.get_color(), str(line.get_linestyle()), str(line._unscaled_dash_pattern))
        for line in axes.lines
        if line.get_label() in run.joint_names
    }
    assert len(looks) == nv
    assert len(plots.plot_overview(run).legends[0].get_texts()) == nv


def test_one_row_is_enough(run: Recording) -> None:
    columns = ("t", "q", "v", "tau", "u", "e", "status", "source", "step_time")
    first = replace(run, **{name: getattr(run, name)[:1] for name in columns})
    for plot in plots.FIGURES.values():
        assert plot(first).axes
    assert plots.png(plots.plot_overview(first)).startswith(PNG)


def test_a_long_run_is_thinned_and_keeps_its_peaks() -> None:
    run = many_joints(2, np.random.default_rng(5), rows=50_000)
    (axes,) = plots.plot_torque(run).axes
    for joint, values in enumerate(curves(axes, run).values()):
        assert len(values) <= plots.MAX_POINTS + 2
        assert values.min() == run.tau[:, joint].min()
        assert values.max() == run.tau[:, joint].max()


@pytest.mark.slow
def test_figures_are_saved_whole(run: Recording, tmp_path: Path) -> None:
    before = dict(mpl.rcParams)
    paths = plots.save_figures(run, tmp_path / "new" / "folder")
    assert [path.name for path in paths] == [
        "error.png",
        "velocity.png",
        "controller.png",
        "torque.png",
        "overview.png",
    ]
    assert sorted(path.parent.iterdir() for path in paths[:1])
    assert {path for path in paths[0].parent.iterdir()} == set(paths)
    for path in paths:
        assert path.read_bytes().startswith(PNG)
        assert 20_000 < path.stat().st_size < 500_000
    assert dict(mpl.rcParams) == before


def test_a_folder_that_cannot_be_written_is_named(run: Recording, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"error\.png: cannot be written .*name a folder"):
        plots.save_figures(run, tmp_path / "file")


def test_a_png_is_the_figure_as_matplotlib_saves_it(run: Recording) -> None:
    figure, twin = plots.plot_overview(run), plots.plot_overview(run)
    dpi, wanted = figure.dpi, io.BytesIO()
    with mpl.rc_context(dict(STYLE)):
        twin.savefig(wanted, format="png", dpi=150)
    assert plots.png(figure) == wanted.getvalue()
    assert figure.dpi == dpi


def test_no_global_plotting_state_is_touched() -> None:
    code = "import sys, arm3dof.ui.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
