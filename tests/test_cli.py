"""The command line: what each command prints, and how it ends."""

import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from importlib import metadata
from pathlib import Path

import cv2
import numpy as np
import pytest
from rich.console import Console

import arm3dof
from arm3dof.cli import app, doctor, progress, serving
from arm3dof.cli import main as program
from arm3dof.config.camera_file import load_camera, save_camera
from arm3dof.model.library import bundled_urdf
from arm3dof.ui.demo_scene import draw_demo

COMMANDS = (
    "calibrate focal",
    "check",
    "compare",
    "demo",
    "doctor",
    "ik",
    "robots",
    "see",
    "simulate",
    "sort",
    "sweep",
    "view",
)
POINT = ["0.12", "0.05", "0.08"]


# ---- the program -------------------------------------------------------------------------------


def test_without_a_command_it_shows_its_help(run):
    code, out, _ = run()
    assert code == 0
    for name in COMMANDS:
        assert re.search(rf"\b{name.split()[0]}\b", out)


def test_version(run):
    assert run("--version") == (0, f"arm3dof {arm3dof.__version__}\n", "")
    assert metadata.version("arm3dof") == arm3dof.__version__


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["nope"], "No such command 'nope'"),
        (["ik", "0.1", "0.1"], "Missing argument 'Z'"),
        (["simulate", "--horizon", "many"], "--horizon"),
        (["check"], "Missing argument 'ROBOT'"),
        (["check", "--what"], "No such option: --what"),
    ],
)
def test_usage_errors_are_one_line(refused, words, reason):
    assert reason in refused(*words)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command(run, name):
    code, out, _ = run(*name.split(), "--help")
    assert code == 0
    assert "--json" in out


def test_the_console_script_and_its_exit_code():
    script = Path(sys.executable).with_name("arm3dof")
    done = subprocess.run([script, "ik", *POINT, "--json"], capture_output=True, text=True)
    assert done.returncode == 0
    assert json.loads(done.stdout)["reachable"]
    assert done.stderr == ""


def test_an_interrupt_ends_with_130_and_no_traceback(monkeypatch, run):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("arm3dof.cli.robots.inverse_kinematics", interrupt)
    assert run("ik", *POINT) == (130, "", "stopped\n")


def test_a_full_disk_is_one_line(monkeypatch, refused):
    def full(*args, **kwargs):
        raise OSError(28, "No space left on device", "/out")

    monkeypatch.setattr("arm3dof.cli.robots.list_robots", full)
    assert refused("robots") == "/out: No space left on device"


# ---- ik ----------------------------------------------------------------------------------------


def test_ik(ask):
    code, answer = ask("ik", *POINT)
    assert code == 0
    assert set(answer) == {
        "reachable",
        "solutions_deg",
        "branches",
        "within_limits",
        "reason",
        "distance_m",
        "nearest_m",
        "joint",
    }
    assert answer["reachable"] is True
    assert answer["reason"] is None
    assert answer["distance_m"] == 0
    robot = arm3dof.load_robot()
    assert len(answer["solutions_deg"]) == len(answer["branches"]) == len(answer["within_limits"])
    for q in np.deg2rad(answer["solutions_deg"]):
        np.testing.assert_allclose(
            robot.placement(q).translation, [float(x) for x in POINT], atol=1e-9
        )


def test_ik_of_a_point_too_far(ask, run):
    code, answer = ask("ik", "0.3", "0", "0")
    assert code == 1
    assert answer["reachable"] is False
    assert answer["reason"] == "too_far"
    assert answer["distance_m"] == pytest.approx(0.045)
    assert answer["nearest_m"] == pytest.approx([0.255, 0, 0])
    code, out, _ = run("ik", "0.3", "0", "0")
    assert code == 1
    assert "farther away than the arm reaches" in out


def test_ik_takes_negative_numbers(ask):
    code, answer = ask("ik", "-0.10", "-.05", "1e-2")
    assert answer["nearest_m"][1] == pytest.approx(-0.05) or code == 1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["x", "0", "0"], "X is 'x'; give a number"),
        (["0", "nan", "0"], "Y is nan; give a finite number"),
        (["0", "0", "-inf"], "Z is -inf; give a finite number"),
        ([*POINT, "--robt", "ur5"], "--robt"),
        ([*POINT, "--robot", "armdof"], "did you mean 'arm3dof'?"),
        ([*POINT, "--robot", "no/such.urdf"], "no/such.urdf: no such file"),
        ([*POINT, "--set", "link2.mass"], "write KEY=VALUE"),
        ([*POINT, "--set", "link2.mass=heavy"], "--set link2.mass is 'heavy'; give a number"),
        ([*POINT, "--set", "link2.mas=1"], "did you mean 'link2.mass'?"),
        ([*POINT, "--set", "link2.mass=-1"], "link2"),
    ],
)
def test_ik_refuses(refused, words, reason):
    assert reason in refused("ik", *words)


def test_set_changes_the_robot(ask):
    _, answer = ask("ik", "0.265", "0", "0", "--set", "link2.length=0.12")
    assert answer["reachable"]


# ---- check, robots -----------------------------------------------------------------------------


def test_check_of_the_reference_arm(ask, run):
    code, answer = ask("check", "arm3dof")
    assert code == 0
    assert set(answer) == {"ok", "problems", "warnings", "closed_form"}
    assert answer["ok"] is True
    assert answer["problems"] == []
    assert answer["closed_form"]["applies"] is True
    errors = answer["closed_form"]["max_error"]
    assert set(errors) == {"M", "C", "g"}
    assert max(errors.values()) < 1e-13
    assert "sound" in run("check", "arm3dof")[1]


def test_check_of_a_broken_robot(ask, run, tmp_path):
    path = tmp_path / "broken.urdf"
    text = bundled_urdf("arm3dof").read_text()
    path.write_text(text.replace("<mass value=", '<mass was="0" value="-', 1).replace('"-"', '"-'))
    code, answer = ask("check", path)
    assert code == 1
    assert answer["ok"] is False
    assert all(set(problem) == {"where", "what", "cure"} for problem in answer["problems"])
    assert answer["closed_form"] == {"applies": False, "max_error": None}
    code, out, _ = run("check", path)
    assert code == 1
    assert "->" in out


def test_check_of_an_override_that_breaks_the_robot(refused, ask):
    code, answer = ask("check", "arm3dof", "--set", "link2.inertia.ixx=1")
    assert code == 1
    assert answer["problems"]


def test_check_of_a_robot_that_is_not_the_papers(ask, run):
    code, answer = ask("check", "ur5")
    assert code == 0
    assert answer["closed_form"] == {"applies": False, "max_error": None}
    assert "does not apply" in run("check", "ur5")[1]


def test_robots(ask, run):
    code, answer = ask("robots")
    assert code == 0
    assert answer["robots"][0]["name"] == "arm3dof"
    names = {entry["name"] for entry in answer["robots"]}
    assert {"ur5", "panda", "z1", "so100", "so101", "xarm7"} <= names
    assert "panda_hand_tcp" in run("robots")[1]


# ---- simulate ----------------------------------------------------------------------------------

FIGURES = {
    "settled",
    "settling_time_s",
    "final_error_deg",
    "peak_torque_nm",
    "torque_limit_nm",
    "torque_violations",
    "energy_j",
    "step_time_us",
    "status_counts",
    "files",
}


@pytest.mark.slow
def test_simulate_is_the_papers_experiment(ask, tmp_path):
    code, answer = ask("simulate", "--out", tmp_path / "run")
    assert code == 0
    assert set(answer) == FIGURES
    assert answer["settled"] is True
    assert answer["settling_time_s"] < 3
    assert answer["torque_limit_nm"] == 1.96
    assert answer["torque_violations"] == 0
    assert answer["peak_torque_nm"] <= 1.96
    assert set(answer["step_time_us"]) == {"p50", "p99", "max"}
    assert sum(answer["status_counts"].values()) == 120
    written = {Path(file).name for file in answer["files"]}
    assert {"run.npz", "error.png", "velocity.png", "controller.png", "torque.png"} <= written
    assert all(Path(file).is_file() for file in answer["files"])
    assert json.loads((tmp_path / "run" / "summary.json").read_text()) == answer
    recording = arm3dof.Recording.load(tmp_path / "run" / "run.npz")
    np.testing.assert_allclose(np.rad2deg(recording.q_target), [28.1, 67.8, 53.8])
    np.testing.assert_array_equal(recording.q[0], 0)


def test_simulate_with_the_papers_controller(ask, refused):
    code, answer = ask("simulate", "--formulation", "paper", "--duration", "3")
    assert code == 0
    assert answer["settling_time_s"] < 3
    assert "torque" in refused("simulate", "--formulation", "mine")


@pytest.mark.slow
def test_simulate_by_the_other_engine(ask, tmp_path):
    words = ("--duration", "2", "--payload-kg", "0.05", "--push", "0.5,joint1,5")
    settling = []
    for plant in ("pinocchio", "mujoco"):
        folder = tmp_path / plant
        code, answer = ask("simulate", "--plant", plant, *words, "--out", folder)
        assert (code, answer["settled"], answer["torque_violations"]) == (0, True, 0)
        settling.append(answer["settling_time_s"])
        notes = arm3dof.Recording.load(folder / "run.npz").notes
        assert notes.get("plant") == {"mujoco": "mujoco"}.get(plant)
    assert settling[0] == pytest.approx(settling[1], abs=0.1)


def test_simulate_to_a_point(ask):
    code, answer = ask("simulate", "--target-m", "0.1,0.1,0.1", "--duration", "3")
    assert code == 0
    assert answer["settled"]
    assert answer["files"] == []


def test_simulate_from_and_to_angles(ask):
    words = ["--start-deg", "-10,20,30", "--target-deg", "10,30,-20", "--duration", "3"]
    code, answer = ask("simulate", *words, "--dt", "0.04", "--horizon", "15")
    assert code == 0
    assert sum(answer["status_counts"].values()) == 75


def test_simulate_says_no_when_the_arm_does_not_get_there(ask, run):
    code, answer = ask("simulate", "--duration", "0.2")
    assert code == 1
    assert answer["settled"] is False
    assert answer["settling_time_s"] is None
    code, out, _ = run("simulate", "--duration", "0.2")
    assert code == 1
    assert "not settled" in out


def test_simulate_says_no_to_a_point_out_of_reach(ask, run):
    code, answer = ask("simulate", "--target-m", "1,0,0")
    assert code == 1
    assert set(answer) > FIGURES
    assert answer["settled"] is False
    assert answer["peak_torque_nm"] is None
    assert answer["reason"] == "too_far"
    assert "reaches" in run("simulate", "--target-m", "1,0,0")[1]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--target-deg", "1,2"], "give 3 numbers"),
        (["--target-deg", "1,2,x"], "'x'"),
        (["--target-deg", "200,0,0"], "--target-deg puts joint1 at 200"),
        (["--start-deg", "0,0,-190"], "--start-deg puts joint3 at -190"),
        (["--target-deg", "1,2,3", "--target-m", "0,0,0"], "both given"),
        (["--target-m", "1,2"], "--target-m"),
        (["--horizon", "0"], "horizon is 0"),
        (["--dt", "-1"], "dt is -1.0"),
        (["--duration", "nan"], "duration"),
        (["--duration", "0"], "duration"),
        (["--out", os.devnull], os.devnull),
    ],
)
def test_simulate_refuses(refused, words, reason):
    assert reason in refused("simulate", *words)


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["pinocchio", "mujoco"])
@pytest.mark.parametrize("robot", ["ur5", "panda", "z1", "so100", "so101", "xarm7"])
def test_other_robots_settle_from_the_same_command(ask, robot, plant):
    code, answer = ask("simulate", "--robot", robot, "--plant", plant)
    assert code == 0, answer
    assert answer["torque_violations"] == 0


# ---- see, calibrate ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Return a drawn picture of the paper's camera as a file."""
    path = tmp_path_factory.mktemp("table") / "table.png"
    picture = draw_demo(load_camera("paper").camera, np.random.default_rng(0))
    cv2.imwrite(str(path), picture)
    return path


def test_see_finds_what_is_named(ask, table):
    code, answer = ask("see", table, "--camera", "paper", "--target", "green")
    assert code == 0
    assert set(answer) == {"found", "objects", "refused"}
    (found,) = answer["objects"]
    assert set(found) == {
        "target",
        "box_px",
        "depth_m",
        "depth_sigma_m",
        "p_camera_m",
        "p_base_m",
        "sigma_m",
        "budget_m",
        "certain",
        "verdict",
    }
    assert found["target"] == "green"
    assert found["p_base_m"][2] == pytest.approx(-0.0875, abs=3e-3)
    assert found["depth_m"] == found["p_camera_m"][2]


def test_see_looks_for_all_targets_of_the_file(ask, run, table):
    code, answer = ask("see", table, "--camera", "paper")
    assert code == 0
    assert {"green", "red", "blue"} <= {it["target"] for it in answer["objects"]}
    out = run("see", table, "--camera", "paper")[1]
    assert "green" in out
    assert "depth [cm]" in out


def test_see_by_colour_and_width(ask, table, tmp_path):
    save_camera(tmp_path / "mine.toml", load_camera("paper").camera)
    words = ["--camera", tmp_path / "mine.toml", "--hsv", "45,90,30,85,255,255"]
    code, answer = ask("see", table, *words, "--width-m", "0.03")
    assert code == 0
    assert answer["objects"][0]["target"] == "object"
    _, doubled = ask("see", table, *words, "--width-m", "0.06")
    ratio = doubled["objects"][0]["depth_m"] / answer["objects"][0]["depth_m"]
    assert ratio == pytest.approx(2)


def test_see_writes_the_annotated_picture(run, table, tmp_path):
    path = tmp_path / "new" / "seen.png"
    code, out, _ = run("see", table, "--camera", "paper", "--target", "green", "--out", path)
    assert code == 0
    assert str(path) in out
    assert np.any(cv2.imread(str(path)) != cv2.imread(str(table)))


def test_see_says_no_and_why(ask, run, tmp_path):
    picture = np.full((480, 640, 3), 128, np.uint8)
    picture[:, :100] = (30, 160, 30)
    cv2.imwrite(str(tmp_path / "cut.png"), picture)
    words = ["see", tmp_path / "cut.png", "--camera", "paper", "--target", "green"]
    code, answer = ask(*words)
    assert code == 1
    assert answer["found"] is False
    assert answer["objects"] == []
    assert "edge of the picture" in answer["refused"][0]["reason"]
    code, out, _ = run(*words)
    assert code == 1
    assert "nothing found" in out
    assert "not measured" in out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--target", "green"], "no camera"),
        (["--camera", "none.toml"], "none.toml"),
        (["--camera", "paper", "--target", "pink"], "paper has the targets: green"),
        (["--camera", "paper", "--target", "red", "--hsv", "0,0,0,1,1,1"], "both given"),
        (["--camera", "paper", "--hsv", "0,0,0,1,1,1"], "needs --width-m"),
        (["--camera", "paper", "--width-m", "0.03"], "belongs to --hsv"),
        (["--camera", "paper", "--hsv", "0,0,0", "--width-m", "1"], "give 6 numbers"),
        (["--camera", "paper", "--hsv", "0,0,0,1,1,1.5", "--width-m", "1"], "whole numbers"),
        (["--camera", "paper", "--hsv", "0,0,0,1,1,999", "--width-m", "1"], "999"),
        (["--camera", "paper", "--hsv", "0,0,0,1,1,1", "--width-m", "-1"], "width_m"),
    ],
)
def test_see_refuses(refused, table, words, reason):
    assert reason in refused("see", table, *words)


def test_see_refuses_what_is_no_picture(refused, tmp_path):
    (tmp_path / "text.png").write_text("hello")
    assert "text.png" in refused("see", tmp_path / "text.png", "--camera", "paper")
    assert "none.png" in refused("see", "none.png", "--camera", "paper")


def test_see_refuses_a_camera_without_targets(refused, table, tmp_path):
    save_camera(tmp_path / "mine.toml", load_camera("paper").camera)
    assert "has no targets" in refused("see", table, "--camera", tmp_path / "mine.toml")


def test_calibrate_focal(ask, run, tmp_path):
    picture = np.full((480, 640, 3), 128, np.uint8)
    picture[200:280, 260:380] = (30, 160, 30)  # 120 px wide
    cv2.imwrite(str(tmp_path / "card.png"), picture)
    words = ["calibrate", "focal", tmp_path / "card.png", "--distance-m", "0.5", "--width-m", "0.1"]
    code, answer = ask(*words)
    assert code == 0
    assert answer["focal_px"] == pytest.approx(600, rel=0.01)
    by_colour = ask(*words, "--hsv", "45,90,30,85,255,255")[1]
    assert by_colour["focal_px"] == pytest.approx(600, rel=0.01)
    assert "focal length" in run(*words)[1]
    code, answer = ask(*words, "--hsv", "100,90,30,120,255,255")
    assert (code, answer) == (1, {"focal_px": None})
    code, out, _ = run(*words, "--hsv", "100,90,30,120,255,255")
    assert code == 1
    assert "no whole object" in out


def test_calibrate_focal_without_an_object(ask, tmp_path):
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((48, 64, 3), 128, np.uint8))
    words = ["--distance-m", "0.5", "--width-m", "0.1"]
    code, answer = ask("calibrate", "focal", tmp_path / "grey.png", *words)
    assert (code, answer["focal_px"]) == (1, None)


def test_calibrate_focal_refuses(refused, table):
    words = ["calibrate", "focal", table, "--width-m", "0.03"]
    assert "--distance-m" in refused(*words)
    assert "distance_m is -1" in refused(*words, "--distance-m", "-1")


# ---- view --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert app.main(["simulate", "--duration", "1", "--out", str(folder), "--json"]) in (0, 1)
    return folder / "run.npz"


@pytest.fixture
def start_program():
    """Return a function that starts the program in a process of its own until it says JSON."""
    started = []

    def start(*words):
        process = subprocess.Popen(
            [Path(sys.executable).with_name("arm3dof"), *map(str, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line == "}\n":
                return process, json.loads("".join(lines))
        pytest.fail(f"no JSON object: {process.communicate()[1]}")

    yield start
    for process in started:
        process.kill()
        process.communicate()


def stop(process):
    """Press Ctrl-C, and return the exit code and what was said on stderr."""
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    return process.returncode, err


def test_view_serves_until_ctrl_c(saved_run, start_program):
    process, answer = start_program("view", saved_run, "--port", "0", "--json")
    with urllib.request.urlopen(answer["url"]) as page:
        assert "arm3dof" in page.read().decode()
    assert stop(process) == (0, "stopped\n")


@pytest.mark.slow
def test_view_takes_another_port_when_the_usual_one_is_taken(saved_run, start_program):
    first, one = start_program("view", saved_run, "--json")
    second, two = start_program("view", saved_run, "--json")
    assert one["url"] != two["url"]
    assert [stop(process)[0] for process in (first, second)] == [0, 0]


@pytest.mark.parametrize("desktop", [True, False])
def test_view_opens_a_browser_where_there_is_a_desktop(monkeypatch, run, saved_run, desktop):
    opened = []

    def interrupted(server):
        raise KeyboardInterrupt

    monkeypatch.setattr("arm3dof.ui.server.LocalServer.wait", interrupted)
    monkeypatch.setattr(serving.webbrowser, "open", opened.append)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: desktop)
    monkeypatch.setenv("DISPLAY", ":0")
    code, out, err = run("view", saved_run, "--port", "0")
    assert (code, err) == (0, "stopped\n")
    assert "http://127.0.0.1:" in out
    assert len(opened) == int(desktop)
    opened.clear()
    run("view", saved_run, "--port", "0", "--no-browser")
    assert not opened


def test_view_refuses(refused, saved_run, tmp_path):
    assert "no such recording" in refused("view", tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("hello")
    assert "not a recording" in refused("view", tmp_path / "text.npz")
    assert "port is 99999" in refused("view", saved_run, "--port", "99999")


# ---- progress ----------------------------------------------------------------------------------


def test_a_count_is_shown_once_it_is_known(monkeypatch):
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=80, legacy_windows=False)
    monkeypatch.setattr(progress.output, "err", lambda: console)
    with progress.counted("campaign", "trials") as tell:
        before = screen.getvalue()
        tell(1, 6)
    assert "starting" in before
    assert "None" not in screen.getvalue()
    assert "1 of 6 trials" in screen.getvalue()


# ---- doctor ------------------------------------------------------------------------------------


def test_doctor_finds_this_installation_sound(ask, run, monkeypatch):
    findings = doctor.examine()
    monkeypatch.setattr(doctor, "examine", lambda: findings)  # once for both forms
    code, answer = ask("doctor")
    assert code == 0, answer
    assert answer["ok"] is True
    assert all(set(check) == {"what", "ok", "found", "cure"} for check in answer["checks"])
    looked_at = {check["what"] for check in answer["checks"]}
    assert {"import pinocchio", "import proxsuite", "import cv2", "physics world"} <= looked_at
    assert "all is well" in run("doctor")[1]


@pytest.mark.slow
def test_doctor_sees_what_is_missing(monkeypatch, ask, run):
    real = metadata.version

    def version(name):
        if name in ("opencv-python", "pinocchio"):
            return "1.0"
        if name in ("scipy", "example-robot-data"):
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(doctor.metadata, "version", version)
    findings = doctor.examine()
    monkeypatch.setattr(doctor, "examine", lambda: findings)  # once for both forms
    code, answer = ask("doctor")
    assert code == 1
    bad = {check["what"]: check["cure"] for check in answer["checks"] if not check["ok"]}
    assert bad["scipy"] == "pip install scipy"
    assert "pip uninstall -y opencv-python opencv-python-headless" in bad["one opencv"]
    assert "pip uninstall -y pinocchio" in bad["no namesake"]
    robots = next(check for check in answer["checks"] if check["what"] == "more robots")
    assert robots["ok"]
    assert "arm3dof[robots]" in robots["cure"]
    assert "->" in run("doctor")[1]


@pytest.mark.slow
def test_doctor_on_a_bare_machine(monkeypatch):
    """A taken port, no GL and no browser are said, and none of them stands in the way."""
    monkeypatch.setattr(doctor, "MODULES", ())
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    monkeypatch.setattr(doctor.ctypes.util, "find_library", lambda name: None)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        monkeypatch.setattr(doctor, "VIEWER_PORT", other.getsockname()[1])
        findings = {finding.found: finding for finding in doctor.examine()}
    for found in ("taken", "no GL library", "none found"):
        assert findings[found].ok
        assert findings[found].cure


@pytest.mark.slow
def test_doctor_tells_what_the_physics_world_is_drawn_with(monkeypatch, tmp_path):
    finding = doctor._physics()
    assert finding.ok
    assert "draws by" in finding.found
    (tmp_path / "mujoco.py").write_text("raise ImportError('no driver')")
    monkeypatch.chdir(tmp_path)  # where `python -c` looks first
    broken = doctor._physics()
    assert "the physics world needs the extra 'physics'" in broken.found
    assert "libegl1" in broken.cure
    monkeypatch.setattr(doctor, "_package", lambda name: doctor.Finding(name, False, "none"))
    absent = doctor._physics()
    assert (absent.ok, absent.found) == (True, "not installed")


def test_doctor_sees_a_shadowing_install(monkeypatch, tmp_path):
    folder = tmp_path / "ros" / "site-packages"
    (folder / "pinocchio").mkdir(parents=True)
    (folder / "pinocchio" / "__init__.py").write_text("")
    monkeypatch.setenv("PYTHONPATH", str(folder))
    finding = doctor._module("pinocchio")
    assert not finding.ok
    assert "shadowed by" in finding.found
    assert "unset it" in finding.cure
    assert "ROS" in finding.cure


def test_doctor_names_the_package_of_a_missing_library(monkeypatch, tmp_path):
    (tmp_path / "proxsuite.py").write_text(
        "raise ImportError('libgomp.so.1: cannot open shared object file: No such file')"
    )
    monkeypatch.delenv("PYTHONPATH", raising=False)  # it would be blamed first
    monkeypatch.chdir(tmp_path)  # where `python -c` looks first
    finding = doctor._module("proxsuite")
    assert not finding.ok
    assert "apt-get install libgomp1" in finding.cure


def test_a_broken_installation_is_explained_not_a_traceback(tmp_path):
    (tmp_path / "pinocchio").mkdir()
    (tmp_path / "pinocchio" / "__init__.py").write_text("raise ImportError('wrong binary')")
    done = subprocess.run(
        [Path(sys.executable).with_name("arm3dof"), "ik", *POINT],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: wrong binary\n")
    assert "PYTHONPATH" in done.stderr
    assert "Traceback" not in done.stderr


def test_main_reads_the_words_of_this_process(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["arm3dof", "--version"])
    assert program() == 0
    assert capsys.readouterr().out.startswith("arm3dof ")
