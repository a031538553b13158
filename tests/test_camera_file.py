import numpy as np
import pytest

from arm3dof.config.camera_file import (
    load_camera,
    parse_camera,
    presets,
    save_camera,
    update_camera,
)
from arm3dof.config.camera_text import render_camera
from arm3dof.config.toml_edit import set_keys
from arm3dof.errors import InputError, MissingFile
from arm3dof.vision.camera import Camera, Doubt, intrinsics, look_at
from arm3dof.vision.colour import ColourTarget, HsvRange

HEAD = """
[intrinsics]
width = 640
height = 480
fx = 600
fy = 610.5
cx = 319
cy = 240.5
distortion = [-0.1, 0.01, 0, 0, 0]
"""
POSE = """
[pose]
position_m = [0.1, 0.125, 0.08]
look_at_m = [0.17, -0.05, -0.09]
"""
TARGET = """
[targets.red]
hsv_low = [170, 120, 40]
hsv_high = [6, 255, 255]
width_m = 0.03
"""


def test_a_whole_file_is_read():
    camera, targets = parse_camera(HEAD + POSE + TARGET, "it")
    assert (camera.width, camera.height, camera.focal_px) == (640, 480, (600.0, 610.5))
    assert camera.camera_matrix[:2, 2].tolist() == [319, 240.5]
    assert camera.distortion.tolist() == [-0.1, 0.01, 0, 0, 0]
    assert camera.position.tolist() == [0.1, 0.125, 0.08]
    np.testing.assert_allclose(camera.project([0.17, -0.05, -0.09]), [319, 240.5], atol=1e-6)
    red = HsvRange((170, 120, 40), (6, 255, 255))
    assert targets == {"red": ColourTarget("red", red, 0.03)}


def test_what_may_be_left_out_is_sensible():
    text = "[intrinsics]\nwidth = 640\nheight = 480\nfx = 600\n" + POSE
    camera, targets = parse_camera(text, "it")
    assert camera.focal_px == (600.0, 600.0)
    assert camera.camera_matrix[:2, 2].tolist() == [319.5, 239.5]
    assert camera.distortion.size == 0
    assert targets == {}


def test_a_rotation_may_be_given_instead_and_rounded():
    pose = look_at([0.1, 0.125, 0.08], [0.17, -0.05, -0.09])
    rows = pose[:3, :3].round(4).tolist()
    text = HEAD + f"[pose]\nposition_m = [0.1, 0.125, 0.08]\nrotation = {rows}\n"
    np.testing.assert_allclose(
        parse_camera(text, "it").camera.transform_base_camera, pose, atol=2e-4
    )


def test_saving_and_loading_is_exact(tmp_path):
    rng = np.random.default_rng(0)
    for trial in range(30):
        pose = look_at(rng.normal(size=3), rng.normal(size=3))
        matrix = intrinsics(*rng.uniform(100, 900, 4))
        distortion = rng.normal(size=int(rng.choice([0, 4, 5, 8])))
        camera = Camera(*rng.integers(1, 4000, 2).tolist(), matrix, distortion, pose)
        targets = [
            ColourTarget("red", HsvRange((170, 1, 2), (3, 4, 5)), rng.uniform(0.01, 1), "ball"),
            ColourTarget("a-b_3", HsvRange((0, 0, 0), (179, 255, 255)), 1e-9, "cylinder", 0.1),
        ][: trial % 3]
        path = save_camera(tmp_path / "deep" / "camera.toml", camera, targets)
        read, found = load_camera(path)
        for name in ("camera_matrix", "distortion"):
            assert np.array_equal(getattr(read, name), getattr(camera, name))
        np.testing.assert_allclose(
            read.transform_base_camera, camera.transform_base_camera, atol=1e-15
        )
        assert (read.width, read.height) == (camera.width, camera.height)
        assert found == {target.name: target for target in targets}
        assert save_camera(path, read, found).read_text() == render_camera(read, targets)
    assert [it.name for it in (tmp_path / "deep").iterdir()] == ["camera.toml"]


def test_the_presets_see_the_table_in_front_of_the_arm():
    assert presets() == ("desk", "front", "paper")
    assert load_camera("paper").camera.position.tolist() == [0.10, 0.125, 0.08]  # the paper's
    bearings, radii = np.meshgrid(np.radians(np.arange(-45, 46, 5)), np.linspace(0.12, 0.23, 12))
    points = np.stack([radii * np.cos(bearings), radii * np.sin(bearings), 0 * radii - 0.09], -1)
    for name, share in (("desk", 0.98), ("paper", 0.7)):
        camera, targets = load_camera(name)
        assert {"red", "green", "blue", "yellow"} <= set(targets)
        pixels = camera.project(points)
        seen = ((pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])).all(axis=-1)
        assert seen.mean() > share
        depths = camera.to_camera(points)[seen][:, 2]
        assert 0.1 < depths.min() < depths.max() < 0.6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ]", "is not TOML: .*line 1"),
        ("", "intrinsics is missing; add it | pose is missing"),
        (HEAD, "pose is missing; add it"),
        ("intrinsics = 3" + POSE, "intrinsics is 3; give a table"),
        (
            HEAD.replace("fx = 600", "fx = -5") + POSE,
            r"it: intrinsics\.fx is -5; give a number above 0",
        ),
        (HEAD.replace("fx = 600", "fx = nan") + POSE, "intrinsics.fx is nan; give a finite number"),
        (HEAD.replace("fx = 600", "") + POSE, "intrinsics.fx is missing; add it"),
        (HEAD.replace("fx = 600", "fx = 'a'") + POSE, "intrinsics.fx is 'a'; give a number"),
        (HEAD.replace("= 640", "= 640.5") + POSE, "width is 640.5; give a whole number"),
        (HEAD.replace("= 640", "= 0") + POSE, "width is 0; give 1 or more"),
        (HEAD.replace("0, 0, 0]", "0]") + POSE, "it: distortion has 3 coefficients"),
        (
            HEAD.replace("[-0.1, 0.01, 0, 0, 0]", "3") + POSE,
            "distortion is 3; give a list in brackets",
        ),
        (HEAD + "skew = 1" + POSE, "intrinsics.skew is not a known key; .* width, height, fx, fy"),
        (
            HEAD + POSE + "[target.red]\na = 1",
            "target is not a known key; .* intrinsics, pose, targets",
        ),
        (HEAD + POSE.replace(", 0.08", ""), r"pose\.position_m has too few entries"),
        (HEAD + POSE.replace("0.08", "0.08, 1"), r"pose\.position_m has 4 entries; give 3"),
        (HEAD + POSE.replace("0.08", "'a'"), r"pose\.position_m\[2\] is 'a'; give a number"),
        (HEAD + "[pose]\nposition_m = [0, 0, 0]", "neither of rotation and look_at_m"),
        (HEAD + POSE + "rotation = [[1,0,0],[0,1,0],[0,0,1]]", "both of rotation and look_at_m"),
        (
            HEAD + "[pose]\nposition_m = [0, 0, 1]\nlook_at_m = [0, 0, 1]",
            "two distinct finite points",
        ),
        (
            HEAD + "[pose]\nposition_m = [0, 0, 1]\nrotation = [[1,0,0],[0,1,0],[0,0,2]]",
            "it: rotation is .*orthonormal",
        ),
        (
            HEAD + "[pose]\nposition_m = [0, 0, 1]\nrotation = [[1,0,0],[0,1,0],[0,0,-1]]",
            "it: rotation is .*determinant",
        ),
        (
            HEAD + POSE + TARGET.replace("170", "300"),
            "it: targets.red: hsv_low has hue 300; .* 179",
        ),
        (HEAD + POSE + TARGET.replace("120", "256"), "targets.red: hsv_low has saturation 256"),
        (
            HEAD + POSE + TARGET.replace("0.03", "0"),
            "targets.red.width_m is 0; give a number above 0",
        ),
        (
            HEAD + POSE + TARGET + "shape = 'cone'",
            "shape is 'cone'; give 'flat', 'ball', 'cylinder', 'cube' or 'bottle'",
        ),
        (HEAD + POSE + TARGET + "width_sigma_m = -1", "width_sigma_m is -1; give 0 or more"),
        (
            HEAD + POSE + TARGET + "colour = 1",
            "targets.red.colour is not a known key; .*hsv_low, hsv_high",
        ),
        (HEAD + POSE + TARGET.replace(".red", ".'a b'"), "targets has the name 'a b'; use letters"),
    ],
)
def test_each_fault_is_one_line_with_key_value_and_cure(text, message):
    with pytest.raises(InputError, match=message) as caught:
        parse_camera(text, "it")
    assert "\n" not in str(caught.value)
    assert "pydantic" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(MissingFile, match=r"no\.toml: No such file.*presets: desk, front, paper"):
        load_camera(tmp_path / "no.toml")
    with pytest.raises(MissingFile, match="Is a directory"):
        load_camera(tmp_path)
    (tmp_path / "it.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not a text file"):
        load_camera(tmp_path / "it.toml")


def test_what_cannot_be_saved_is_refused_and_leaves_nothing(tmp_path):
    camera = Camera.pinhole(640, 480, 600)
    strange = ColourTarget("a b", HsvRange((0, 0, 0), (9, 9, 9)), 0.1)
    with pytest.raises(InputError, match="has the name 'a b'; use letters"):
        save_camera(tmp_path / "it.toml", camera, [strange])
    matrix = intrinsics(600, 600, 320, 240)
    matrix[0, 1] = 2
    with pytest.raises(InputError, match="skewed"):
        save_camera(tmp_path / "it.toml", Camera(640, 480, matrix, np.zeros(0), np.eye(4)))
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        save_camera(tmp_path / "file" / "it.toml", camera)


# ---- changing a file in place -------------------------------------------------------------------

NOTED = """# our camera
[intrinsics]        # from the data sheet
width = 640
height = 480
fx = 600  # a guess
# cy is left out

[pose]
position_m = [0.1, 0.125, 0.08]
look_at_m = [0.17, -0.05, -0.09]  # the table

[targets.red]
hsv_low = [170, 120, 40] # wraps
hsv_high = [
    6, 255,  # [sic]
    255,
]
width_m = 0.03
# the end
"""


def test_a_target_is_added_or_replaced_and_comments_stay(tmp_path):
    path = tmp_path / "it.toml"
    path.write_text(NOTED)
    green = ColourTarget("green", HsvRange((45, 90, 30), (85, 255, 255)), 0.02, "cube")
    red = ColourTarget("red", HsvRange((172, 100, 30), (4, 255, 255)), 0.05, "ball", 0.001)
    update_camera(path, target=green)
    update_camera(path, target=red)
    text = path.read_text()
    camera, targets = load_camera(path)
    assert targets == {"red": red, "green": green}
    assert camera.focal_px == (600, 600)
    for note in ("# our camera", "# from the data sheet", "# a guess", "# wraps", "# the end"):
        assert note in text
    assert "look_at_m = [0.17, -0.05, -0.09]  # the table" in text
    update_camera(path, target=red)
    assert path.read_text() == text


def test_a_camera_is_changed_and_comments_stay(tmp_path):
    path = tmp_path / "it.toml"
    path.write_text(NOTED)
    pose = look_at([0.2, 0.3, 0.4], [0, 0, 0])
    doubt = Doubt(2.0, 1.5, 0.003, 0.01)
    camera = Camera(640, 480, intrinsics(611, 612, 318, 241), np.full(5, 0.1), pose, 2.2, doubt)
    update_camera(path, camera=camera)
    read, targets = load_camera(path)
    np.testing.assert_allclose(read.transform_base_camera, pose, atol=1e-12)
    assert np.array_equal(read.camera_matrix, camera.camera_matrix)
    assert read.doubt.focal_px == 2.0
    assert read.doubt.rotation_rad == pytest.approx(0.01)
    assert read.gamma == 2.2
    assert set(targets) == {"red"}
    text = path.read_text()
    assert "# a guess" in text
    assert "look_at_m" not in text
    again = Camera.pinhole(640, 480, 500, pose)
    update_camera(path, camera=again)
    assert load_camera(path).camera.focal_px == (500, 500)


def test_what_cannot_be_changed_in_place_is_left_alone(tmp_path, monkeypatch):
    path = tmp_path / "it.toml"
    text = "pose = {position_m = [0, 0, 1], look_at_m = [0, 1, 0]}\n" + NOTED.split("[pose]")[0]
    path.write_text(text)
    with pytest.raises(InputError, match=r"TOML|changed in place"):
        update_camera(path, camera=Camera.pinhole(640, 480, 500))
    assert path.read_text() == text
    with pytest.raises(MissingFile):
        update_camera(tmp_path / "no.toml", camera=Camera.pinhole(640, 480, 500))
    monkeypatch.chdir(tmp_path)
    green = ColourTarget("lime", HsvRange((45, 90, 30), (85, 255, 255)), 0.02)
    assert str(update_camera("desk", target=green)) == "desk.toml"
    assert {"lime", "red"} <= set(load_camera("desk.toml").targets)
    with pytest.raises(InputError, match=r"desk.toml exists already; .*--camera desk.toml"):
        update_camera("desk", target=green)


def test_keys_of_any_layout_are_found():
    text = "a = 1\n[b]\nx = [ # [\n 1,\n '#]',\n]\ny = 2\n\n# c\n[ d ]\nz=3"
    assert set_keys(text, "b", {"x": "5"}).count("\n") == text.count("\n") - 2
    assert "[ d ]\nz=3\nw = 1\n" in set_keys(text, "d", {"w": "1"})
    assert "y = 2\nv = 0\n\n# c\n[ d ]" in set_keys(text, "b", {"v": "0"})
    assert set_keys("", "e", {"k": "1"}) == "[e]\nk = 1\n"
    assert set_keys(text, "b", {}, drop=["x"]).startswith("a = 1\n[b]\ny = 2\n")
