"""The sweep: what is varied, the table that goes on, the Pareto front and the figure."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from arm3dof.cli import app
from arm3dof.control.settings import MpcSettings
from arm3dof.errors import InputError
from arm3dof.model.library import load_robot
from arm3dof.runtime import sweep as module
from arm3dof.runtime.sweep import (
    KNOBS,
    Outcome,
    Point,
    Sweep,
    Vary,
    default_points,
    pareto_front,
    points,
    sweep,
    with_value,
)
from arm3dof.runtime.sweep_table import FIGURES, SweepTable
from arm3dof.ui.plots import png
from arm3dof.ui.sweep_plot import plot_sweep

SHORT = 0.5  # [s]


@pytest.fixture(scope="module")
def robot():
    return load_robot("arm3dof")


@pytest.fixture
def runs(monkeypatch):
    """Count the runs that are really made."""
    made = []
    run = module._run

    def counted(task):
        made.append(task)
        return run(task)

    monkeypatch.setattr(module, "_run", counted)
    return made


# ---- what is varied ----------------------------------------------------------------------------


def test_ranges_are_even_on_a_log_scale():
    vary = Vary.parse("input_weight=1e-4:1e-2:9")
    assert vary.name == "input_weight"
    np.testing.assert_allclose(vary.values, np.geomspace(1e-4, 1e-2, 9), rtol=1e-3)
    assert Vary.parse("horizon=1:4:9").values == (1, 2, 3, 4)
    assert Vary.parse(" delay = 0, 0.05 ").values == (0.0, 0.05)
    assert Vary.parse("horizon=5,10,20").values == (5, 10, 20)
    assert Vary.parse("formulation=tracking,paper").values == ("tracking", "paper")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("input_weight", "write NAME=LOW:HIGH:COUNT or NAME=A,B,C"),
        ("input_weight=", "write NAME=LOW:HIGH:COUNT or NAME=A,B,C"),
        ("magic=1,2", "no setting 'magic' to vary; give one of: position_weight"),
        ("input_weight=1:2", "write NAME=LOW:HIGH:COUNT"),
        ("formulation=1:2:3", "write NAME=LOW:HIGH:COUNT"),
        ("input_weight=0:1:5", "above 0 and COUNT 2 or more"),
        ("input_weight=1:2:1", "above 0 and COUNT 2 or more"),
        ("input_weight=1:2:x", "above 0 and COUNT 2 or more"),
        ("input_weight=1,x", "'x' is no number"),
        ("input_weight=1,nan", "nan is not finite"),
        ("horizon=1.5", "horizon takes whole numbers"),
    ],
)
def test_what_cannot_be_varied_is_refused_by_name(text, why):
    with pytest.raises(InputError, match=why):
        Vary.parse(text)


def test_every_knob_changes_what_it_is_named_after():
    base = MpcSettings(state_weight=(2.0, 0.5), blocks=(10, 10))
    for name in KNOBS:
        value = {
            "horizon": 7,
            "max_iterations": 7,
            "formulation": "torque",
            "discretisation": "euler",
        }.get(name, 0.25)
        changed = with_value(base, name, value)
        expected = {
            "position_weight": {"state_weight": (0.25, 0.5)},
            "velocity_weight": {"state_weight": (2.0, 0.25)},
            "terminal_weight": {"terminal_weight": (0.25, 0.0)},
            "horizon": {"horizon": 7, "blocks": None},
        }.get(name, {name: value})
        assert changed == replace(base, **expected)
        assert changed != base
    with pytest.raises(InputError, match="velocity_weight cannot be varied"):
        with_value(MpcSettings(state_weight=np.eye(6)), "velocity_weight", 0.1)
    with pytest.raises(InputError, match="horizon has no value"):
        Vary("horizon", ())


def test_one_setting_makes_a_line_and_two_make_a_grid():
    weight, horizon = Vary.parse("input_weight=1e-3,1e-2"), Vary.parse("horizon=5,10,20")
    line = points([weight])
    assert [(it.family, it.label) for it in line] == [
        ("input_weight", "0.001"),
        ("input_weight", "0.01"),
    ]
    grid = points([weight, horizon], MpcSettings(formulation="paper"))
    assert len(grid) == 6
    assert {it.family for it in grid} == {"horizon = 5", "horizon = 10", "horizon = 20"}
    pairs = {(it.settings.horizon, it.settings.input_weight) for it in grid}
    assert pairs == {(n, w) for n in (5, 10, 20) for w in (1e-3, 1e-2)}
    assert {it.settings.formulation for it in grid} == {"paper"}
    for wrong in ([], [weight, weight], [weight, horizon, Vary.parse("delay=0")]):
        with pytest.raises(InputError, match="vary one setting, or two different ones"):
            points(wrong)


def test_the_default_sweep_varies_each_of_the_papers_weights():
    families = {point.family[0] for point in default_points()}
    assert families == {"Q", "R", "P"}


# ---- the Pareto front --------------------------------------------------------------------------

NUMBERS = st.floats(-5, 5) | st.sampled_from([0.0, 1.0, np.nan])


@given(st.lists(st.tuples(NUMBERS, NUMBERS), max_size=12))
def test_the_front_is_what_no_pair_beats(pairs):
    first, second = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    front = pareto_front(first, second)
    for index, (x, y) in enumerate(pairs):
        beaten = any(
            a <= x and b <= y and (a < x or b < y)
            for a, b in pairs
            if np.isfinite(a) and np.isfinite(b)
        )
        assert front[index] == (np.isfinite(x) and np.isfinite(y) and not beaten)


# ---- running and going on ----------------------------------------------------------------------


def test_a_sweep_that_was_stopped_goes_on(robot, runs, tmp_path):
    table = tmp_path / "new" / "sweep.csv"
    chosen = points([Vary.parse("input_weight=1e-4,1e-3,1e-2")])

    def stop(done, total):
        assert total == 3
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(robot, chosen, duration=SHORT, table=table, progress=stop)
    assert len(SweepTable(table)) == len(runs) == 2
    result = sweep(robot, chosen, duration=SHORT, table=table)
    assert (len(runs), result.reused) == (3, 2)
    again = sweep(robot, chosen, duration=SHORT, table=table)
    assert (len(runs), again.reused) == (3, 3)
    for one, other in zip(result.outcomes, again.outcomes, strict=True):
        assert one.values == other.values
    more = points([Vary.parse("input_weight=1e-2,1e-1")])
    assert sweep(robot, more, duration=SHORT, table=table).reused == 1
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["input_weight"]) for row in rows] == [1e-4, 1e-3, 1e-2, 1e-1]
    assert [entry.name for entry in table.parent.iterdir()] == ["sweep.csv"]


def test_another_robot_motion_or_setting_is_another_run(robot, runs, tmp_path):
    table = tmp_path / "sweep.csv"
    (point,) = points([Vary.parse("horizon=5")])
    target = [0.2, 0.3, 0.1]
    sweep(robot, [point], target=target, duration=SHORT, table=table)
    heavy = load_robot("arm3dof", overrides={"link2.mass": 0.2})
    for arm, aim, length, settings in (
        (heavy, target, SHORT, point.settings),
        (robot, [0.2, 0.3, 0.2], SHORT, point.settings),
        (robot, target, 2 * SHORT, point.settings),
        (robot, target, SHORT, replace(point.settings, plan_validity=0.1)),
    ):
        other = replace(point, settings=settings)
        result = sweep(arm, [other], target=aim, duration=length, table=table)
        assert result.reused == 0
    assert len(SweepTable(table)) == len(runs) == 5


def test_equal_points_are_run_once_and_without_a_table_in_memory(robot, runs):
    twice = points([Vary.parse("horizon=5,5")])
    result = sweep(robot, twice, duration=SHORT)
    assert len(runs) == 1
    assert result.outcomes[0].values == result.outcomes[1].values
    assert set(result.outcomes[0].values) == set(FIGURES)


def test_processes_change_no_figure_but_step_times(robot):
    chosen = points([Vary.parse("input_weight=1e-4,1e-2")])
    alone, shared = (sweep(robot, chosen, duration=SHORT, workers=n) for n in (1, 2))
    for name in set(FIGURES) - {"step_time_p50_s"}:
        np.testing.assert_array_equal(alone.column(name), shared.column(name))


def test_a_larger_input_weight_saves_energy_and_costs_time(robot):
    result = sweep(robot, points([Vary.parse("input_weight=1e-4,1e-3,1e-2")]), duration=4.0)
    assert (np.diff(result.column("energy_j")) < 0).all()
    assert (np.diff(result.column("rms_error_rad")) > 0).all()
    assert (np.diff(result.column("settling_time_s")) > 0).all()
    assert result.front().all()


@pytest.mark.parametrize(
    "text",
    ["", "a,b\n1,2\n", ",".join(("key", *FIGURES)) + "\nx,1\n", "\0", "\xff"],
)
def test_a_file_that_is_no_table_is_left_alone(tmp_path, text):
    path = tmp_path / "sweep.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="not the table of a sweep; move it away"):
        SweepTable(path)
    assert path.read_bytes() == text.encode("latin-1")


def test_a_figure_that_is_no_number_is_refused(tmp_path):
    path = tmp_path / "sweep.csv"
    values = {name: "fast" if name == "energy_j" else 1.0 for name in FIGURES}
    SweepTable(path).add("x", values)
    with pytest.raises(InputError, match="not the table of a sweep"):
        SweepTable(path)


# ---- the figure and the command ----------------------------------------------------------------


def outcome(family, label, energy, error, settling):
    values = dict.fromkeys(FIGURES, 0.0)
    values |= {"energy_j": energy, "rms_error_rad": error, "settling_time_s": settling}
    return Outcome(Point(family, label, MpcSettings()), values)


def test_the_figure_rings_the_front_and_counts_what_did_not_settle():
    result = Sweep(
        (
            outcome("a", "1", 1.0, 0.3, 1.0),
            outcome("a", "2", 2.0, 0.2, None),
            outcome("b", "1", 3.0, 0.25, 0.5),
        ),
        reused=0,
    )
    assert result.front().tolist() == [True, True, False]
    assert result.front(error="settling_time_s").tolist() == [True, False, True]
    figure = plot_sweep(result)
    left, right = figure.axes
    rings = next(line for line in left.lines if line.get_label() == "Pareto front")
    np.testing.assert_array_equal(rings.get_xdata(), [1.0, 2.0])
    assert "1 of 3 runs did not settle" in [text.get_text() for text in right.texts]
    assert png(figure).startswith(b"\x89PNG")


def test_the_command_sweeps_draws_and_goes_on(capsys, tmp_path):
    words = ["sweep", "--vary", "horizon=5,10", "--workers", "1", "--out", str(tmp_path)]
    assert app.main(words) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for text in ("horizon", "energy [J]", "sweep.csv", "sweep.png", "0 of 2 runs"):
        assert text in out
    assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert app.main([*words, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["reused"] == 2
    assert [point["value"] for point in report["points"]] == ["5", "10"]
    assert set(FIGURES) < set(report["points"][0])


def test_the_command_says_no_more_than_one_line_about_bad_input(capsys, tmp_path):
    for words in (
        ["--vary", "magic=1"],
        ["--formulation", "magic"],
        ["--vary", "input_weight=-1", "--workers", "1"],
        ["--vary", "horizon=5", "--vary", "horizon=6"],
    ):
        assert app.main(["sweep", "--out", str(tmp_path), *words]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
