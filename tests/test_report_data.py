"""What the report shows is what was recorded: curves, statuses, tables and the picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import msgpack
import numpy as np
import pytest
from runs import smooth_run

from arm3dof.control.step import ControlStatus, TorqueSource
from arm3dof.errors import InputError, MissingFile
from arm3dof.model.library import load_robot
from arm3dof.runtime.metrics import summarise
from arm3dof.runtime.recording import Recording
from arm3dof.ui.pictures import MAX_PICTURE, read_picture
from arm3dof.ui.quantities import extreme_rows
from arm3dof.ui.report import report_html
from arm3dof.ui.report_data import MAX_ROWS, report_command, status_segments

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)


@pytest.fixture(scope="module")
def run() -> Recording:
    made = smooth_run(load_robot(), duration=2.0)
    status, source = np.array(made.status), np.array(made.source)
    status[200:300], source[200:300] = ControlStatus.NOT_SOLVED, TorqueSource.PREVIOUS_PLAN
    status[300:350], source[300:350] = ControlStatus.BAD_MEASUREMENT, TorqueSource.BRAKING
    status[600:700] = ControlStatus.SOFTENED
    notes = {"payload_kg": "0.1", "mpc.horizon": "20", "mpc.dt": "0.05"}
    return replace(made, status=status, source=source, notes=notes)


def command(run: Recording, picture: bytes | None = None) -> dict[str, object]:
    return report_command(run, run.load_robot(), summarise(run), picture)


def numbers(packed: msgpack.ExtType) -> np.ndarray:
    return np.frombuffer(packed.data, np.float32)


def test_curves_hold_the_columns_in_their_units(run: Recording) -> None:
    charts = command(run)["charts"]
    columns = (np.rad2deg(run.e), run.v, run.u, run.tau)
    units = ("deg", "rad/s", "rad/s²", "N m")
    for chart, column, unit in zip(charts, columns, units, strict=True):
        assert chart["unit"] == unit
        for series, values in zip(chart["series"], column.T, strict=True):
            np.testing.assert_allclose(numbers(series["t"]), run.t, atol=1e-6)
            np.testing.assert_array_equal(numbers(series["v"]), values.astype(np.float32))
    assert charts[3]["limits"] == run.limits.tau_max.tolist()


def test_a_long_run_keeps_its_peaks_and_ends(run: Recording) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        values = rng.normal(size=rng.integers(1, 40_000))
        rows = extreme_rows(values, MAX_ROWS)
        assert rows.size <= MAX_ROWS + 2
        assert (np.diff(rows) > 0).all()
        assert rows[0] == 0
        assert rows[-1] == values.size - 1
        assert values[rows].min() == values.min()
        assert values[rows].max() == values.max()


def test_statuses_become_stretches_of_time(run: Recording) -> None:
    segments = status_segments(run)
    assert [each.level for each in segments] == [0, 2, 3, 0, 1, 0]
    assert [each.start for each in segments] == pytest.approx([0.0, 0.4, 0.6, 0.7, 1.2, 1.4])
    assert [each.end for each in segments] == pytest.approx([0.4, 0.6, 0.7, 1.2, 1.4, run.t[-1]])
    assert segments[2].name == "bad measurement: braking"
    kinds = {each["name"]: each["count"] for each in command(run)["kinds"]}
    assert sum(kinds.values()) == run.control_rows.sum()
    assert kinds["limit softened"] == 4


def test_the_phases_of_a_task_are_read_from_its_notes(run: Recording) -> None:
    assert command(run)["phases"] == []
    notes = {
        "verdict": "done",
        "task.01 look": "until 0.25 s: the pictures agree",
        "task.02 lift": "until 1.50 s: the arm is there: at last",
    }
    look, lift = command(replace(run, notes=notes))["phases"]
    assert (look["start"], look["end"], look["name"]) == (0.0, 0.25, "look")
    assert (lift["start"], lift["end"], lift["name"]) == (0.25, 1.5, "lift")
    assert lift["sentence"] == "the arm is there: at last"


def test_tables_tell_robot_joints_and_settings(run: Recording) -> None:
    tables = {table["title"]: table["rows"] for table in command(run)["tables"]}
    assert list(tables) == ["Run", "Joints", "Notes", "Controller"]
    assert dict(tables["Controller"]) == {"horizon": "20 stages", "dt": "0.05 s"}
    assert dict(tables["Notes"]) == {"payload kg": "0.1 kg"}
    assert tables["Joints"][1][:4] == ("joint2", "0.0 °", "67.8 °", "-45 … 225 °")


def test_only_pictures_of_a_bounded_size_are_taken(run: Recording, tmp_path: Path) -> None:
    assert command(run, PNG)["picture"].startswith("data:image/png;base64,iVBOR")
    with pytest.raises(InputError, match="no PNG, JPEG or WebP"):
        report_html(run, b"<svg onload=alert(1)>")
    with pytest.raises(InputError, match=r"the picture has 2\.0 MB"):
        report_html(run, PNG + bytes(2_000_000))
    broken = tmp_path / "broken.png"
    broken.write_bytes(PNG + bytes(2_000_000))
    with pytest.raises(InputError, match=r"broken\.png is damaged"):
        read_picture(broken)
    with pytest.raises(MissingFile, match="no such picture"):
        read_picture(tmp_path / "none.png")


def test_a_large_photograph_is_made_smaller(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (1500, 2400, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), cv2.GaussianBlur(noise, (7, 7), 0))
    assert (tmp_path / "photo.png").stat().st_size > 2_000_000
    data = read_picture(tmp_path / "photo.png")
    assert len(data) <= MAX_PICTURE
    shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape[0] / shown.shape[1] == pytest.approx(1500 / 2400, abs=0.01)
    assert 800 < shown.shape[1] <= 1600


@pytest.mark.slow
def test_a_long_run_of_a_heavy_robot_with_a_large_picture_stays_below_5_mb() -> None:
    robot = load_robot("panda")
    start = robot.limits.q_min / 2 + robot.limits.q_max / 2
    run = smooth_run(robot, start=start, target=start + 0.3, duration=60, dt=0.002)
    noise = np.random.default_rng(0).bytes(MAX_PICTURE - len(PNG))
    assert len(report_html(run, PNG + noise).encode()) < 5_000_000


def test_the_page_is_small_and_asks_nothing_of_the_network(run: Recording) -> None:
    html = report_html(run, PNG)
    assert len(html.encode()) < 2_000_000
    assert "default-src 'none'" in html
    assert "connect-src" not in html
    assert report_html(run, PNG) == html
