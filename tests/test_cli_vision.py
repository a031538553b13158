"""The commands that see, learn and calibrate, on drawn pictures and on input that is none."""

import json
import math

import cv2
import numpy as np
import pytest
from prints import COLUMNS, MATRIX, ROWS, SQUARE, chess, held, print_of

from arm3dof.cli import app
from arm3dof.config.camera_file import load_camera, save_camera
from arm3dof.ui.demo_scene import draw_demo
from arm3dof.vision.camera import Camera, look_at
from arm3dof.vision.sources import write_image

LENS = Camera(640, 480, MATRIX, np.array([-0.22, 0.08, 0.001, -0.0008, 0.0]), np.eye(4))


@pytest.fixture
def ask(capsys):
    def call(*words):
        code = app.main([*map(str, words), "--json"])
        said = capsys.readouterr()
        return code, json.loads(said.out) if said.out else said.err

    return call


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "table.png"
    return write_image(path, draw_demo(load_camera("desk").camera, np.random.default_rng(1)))


def test_a_colour_is_learned_saved_and_used(ask, table, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    click = ["--learn", "308,275", "--width-m", "0.03", "--shape", "cylinder"]
    code, answer = ask("see", table, "--camera", "desk", *click, "--save", "lime")
    assert code == 0
    assert answer["learned"]["name"] == "lime"
    code, again = ask("see", table, "--camera", "desk.toml", "--target", "lime")
    assert code == 0
    assert again["objects"] == answer["objects"]
    assert "# A 640 x 480 camera on a tripod" in (tmp_path / "desk.toml").read_text()
    # a known target keeps its width and shape when its colour is learned anew
    code, _ = ask(
        "see", table, "--camera", "desk.toml", "--learn", "295,260,20,20", "--save", "lime"
    )
    assert code == 0
    assert load_camera("desk.toml").targets["lime"].shape == "cylinder"


def test_a_table_and_a_limit_change_the_verdict(ask, table):
    _, free = ask("see", table, "--camera", "desk", "--target", "green", "--limit-mm", "1")
    _, stood = ask("see", table, "--camera", "desk", "--target", "green", "--table-m", "-0.11")
    assert stood["objects"][0]["sigma_m"] < free["objects"][0]["sigma_m"]
    assert not free["objects"][0]["certain"]
    assert "move the camera nearer" in free["objects"][0]["verdict"]
    assert "table" in stood["objects"][0]["budget_m"]
    code, answer = ask("see", table, "--camera", "desk", "--target", "green", "--table-m", "0.1")
    assert code == 1
    assert "not on the table" in answer["refused"][0]["reason"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--learn", "308,275"], "--learn needs --width-m"),
        (["--learn", "308", "--width-m", "0.03"], "give a point u, v or a box"),
        (["--learn", "a,b", "--width-m", "0.03"], "--learn is 'a'; give a number"),
        (["--learn", "308,275", "--width-m", "0.03", "--shape", "egg"], "--shape is 'egg'"),
        (["--learn", "308,275", "--width-m", "0.03", "--target", "red"], "give one of them"),
        (["--save", "it"], "--save keeps what --learn has learned"),
        (["--shape", "ball"], "--shape belongs to --hsv"),
    ],
)
def test_options_that_do_not_fit_are_refused(ask, table, words, message):
    code, said = ask("see", table, "--camera", "desk", *words)
    assert code == 2
    assert message in said
    assert said.count("\n") == 1


def hostile(folder):
    """Pictures and files of every unpleasant kind: name and the exit code that they deserve."""
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (480, 640)).astype(np.uint8)
    kinds = {
        "black.png": (np.zeros((480, 640, 3), np.uint8), 1),
        "white.png": (np.full((480, 640, 3), 255, np.uint8), 1),
        "noise.png": (rng.integers(0, 256, (480, 640, 3)).astype(np.uint8), 1),
        "grey.png": (grey, 1),
        "deep.png": (grey.astype(np.uint16) * 257, 1),
        "alpha.png": (np.dstack([grey] * 4), 1),
        "one.png": (np.zeros((1, 1, 3), np.uint8), 2),
        "huge.png": (np.zeros((6000, 8000), np.uint8), 2),
    }
    for name, (image, code) in kinds.items():
        cv2.imwrite(str(folder / name), image)
        yield name, code
    whole = (folder / "noise.png").read_bytes()
    files = {"empty.png": b"", "text.png": b"hello", "cut.png": whole[:5000], "cut.mp4": b"hello"}
    for name, data in files.items():
        (folder / name).write_bytes(data)
        yield name, 2
    writer = cv2.VideoWriter(
        str(folder / "still.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 20, (640, 480)
    )
    writer.write(np.zeros((480, 640, 3), np.uint8))
    writer.release()
    yield "still.avi", 1
    (folder / "none").mkdir()
    yield "none", 2
    yield "missing.png", 2


def test_hostile_input_gives_one_clear_line_each(tmp_path, capfd):
    for name, expected in hostile(tmp_path):
        for more in ([], ["--learn", "0,0", "--width-m", "0.03"]):
            words = ["see", str(tmp_path / name), "--camera", "desk", *more]
            code = app.main(words)
            said = capfd.readouterr()
            assert "Traceback" not in said.err
            if code == 2:
                assert said.out == ""
                assert said.err.startswith("error: "), name
                assert said.err.count("\n") == 1, name
            else:
                assert said.err == "", name
            if not more:
                assert code == expected, name


# ---- calibrate ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_chessboard_yields_a_camera_file(ask, tmp_path):
    rng = np.random.default_rng(0)
    folder = tmp_path / "boards"
    for k in range(7):
        write_image(folder / f"{k}.png", print_of(*chess(), LENS, held(rng)))
    path = tmp_path / "camera.toml"
    words = ["calibrate", "chessboard", folder, "--square-m", SQUARE, "--save", path]
    code, answer = ask(*words)
    assert code == 0, answer
    assert answer["boards"] == answer["pictures"] == 7
    assert answer["rms_px"] < 0.2
    assert answer["files"] == [str(path)]
    camera = load_camera(path).camera
    assert camera.camera_matrix.tolist() == answer["camera_matrix"]
    assert camera.doubt.focal_px == answer["focal_sigma_px"] > 0
    code, answer = ask(*words, "--board", "12x9")
    assert code == 1
    assert "take 10 to 20" in answer["troubles"][0]
    assert answer["camera_matrix"] is None


def test_a_marker_yields_the_pose(ask, tmp_path):
    path = save_camera(tmp_path / "camera.toml", LENS)
    pose = look_at([0.06, 0.30, 0.17], [0.175, -0.035, -0.09])
    cells = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 3, 240
    )
    pattern = cv2.copyMakeBorder(cells, 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    frame = np.eye(4)
    frame[:3, 3] = [0.17, -0.02, -0.09]
    image = print_of(pattern, (0.16,) * 2, LENS, np.linalg.inv(pose) @ frame)
    picture = write_image(tmp_path / "marker.png", image)
    words = ["calibrate", "pose", picture, "--camera", path, "--aruco", 3, "--size-m", 0.12]
    code, answer = ask(*words, "--at", "0.17,-0.02,-0.09", "--save", path)
    assert code == 0, answer["troubles"]
    np.testing.assert_allclose(answer["position_m"], pose[:3, 3], atol=0.006)
    camera = load_camera(path).camera
    np.testing.assert_allclose(camera.position, answer["position_m"], atol=1e-12)
    assert camera.doubt.position_m == answer["position_sigma_m"] > 0
    code, said = ask(*words)
    assert code == 2
    assert "--at X,Y,Z" in said


def test_points_yield_the_pose(ask, tmp_path):
    rng = np.random.default_rng(1)
    pose = look_at([0.06, 0.30, 0.17], [0.175, -0.035, -0.09])
    standing = Camera(640, 480, MATRIX, LENS.distortion, pose)
    path = save_camera(tmp_path / "camera.toml", LENS)
    points = rng.uniform([0.1, -0.1, -0.1], [0.25, 0.1, 0.1], (9, 3))
    rows = np.column_stack([points, standing.project(points)])
    lines = [",".join(map(str, row)) for row in rows.tolist()]
    table = tmp_path / "points.csv"
    table.write_text("\n".join(["x, y, z, u, v", *lines]))
    words = ["calibrate", "pose", "--camera", path, "--points", table]
    code, answer = ask(*words)
    assert code == 0
    np.testing.assert_allclose(answer["position_m"], pose[:3, 3], atol=1e-4)
    assert math.isfinite(answer["rotation_sigma_deg"])
    for text, message in {
        "x,y\n1,2": "lacks columns",
        "x,y,z,u,v\n1,2,3,4,five": "line 2: v is 'five'; give a number",
        "x,y,z,u,v\n1,2,3,4": "line 2: v is ''; give a number",
    }.items():
        table.write_text(text)
        code, said = ask(*words)
        assert code == 2
        assert message in said
    assert ROWS * COLUMNS == 54


def test_points_that_cannot_be_read_are_refused(refused, tmp_path):
    why = refused("calibrate", "pose", "--camera", "desk", "--points", tmp_path / "no.csv")
    assert why.endswith("no.csv: No such file or directory; give a CSV file")
