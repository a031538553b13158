"""From a picture to a settled arm, and everything that is written on the way."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from photos import COFFEE, FLOWER

import arm3dof
from arm3dof.cli import app
from arm3dof.cli import demo as demo_command
from arm3dof.cli.tasks import why_no_physics
from arm3dof.config.camera_file import load_camera
from arm3dof.errors import InputError
from arm3dof.runtime.recording import Recording
from arm3dof.sim.mujoco_plant import MujocoPlant
from arm3dof.sim.world import COLOURS, Body, World
from arm3dof.sim.world_camera import WorldCamera
from arm3dof.ui import task_story
from arm3dof.ui.demo import Outcome, tell
from arm3dof.ui.demo_scene import RADIUS, draw_demo
from arm3dof.vision.camera import Camera
from arm3dof.vision.locate import look

FIGURES = {"error.png", "velocity.png", "controller.png", "torque.png", "overview.png"}


@pytest.fixture(scope="module")
def paper():
    return load_camera("paper")


def test_the_story(paper, tmp_path):
    robot = arm3dof.load_robot()
    picture = draw_demo(paper.camera, np.random.default_rng(1))
    green = [paper.targets["green"]]
    steps = []
    story = tell(
        robot,
        picture,
        paper.camera,
        green,
        tmp_path / "new",
        duration=3.0,
        observers=[lambda state, answer: steps.append(answer)],
    )
    assert story.outcome is Outcome.SETTLED
    assert story.succeeded
    assert story.metrics.torque_violations == 0
    assert len(steps) == 60
    names = {file.name for file in story.files}
    assert names == {*FIGURES, "seen.png", "report.html", "run.npz", "summary.json"}
    assert {file.name for file in (tmp_path / "new").iterdir()} == names
    # the hand ends where the object was seen
    hand = robot.placement(story.recording.q[-1]).translation
    np.testing.assert_allclose(hand, story.view.located[0].p_base, atol=2e-3)
    assert (tmp_path / "new" / "report.html").stat().st_size < 5e6
    assert cv2.imread(str(tmp_path / "new" / "seen.png")).shape == picture.shape
    summary = json.loads((tmp_path / "new" / "summary.json").read_text())
    assert summary["outcome"] == "settled"
    assert summary["objects"][0]["target"] == "green"
    assert summary["target_m"] == summary["objects"][0]["p_base_m"]
    np.testing.assert_allclose(summary["target_deg"], np.rad2deg(story.reach.best))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", ["paper", "desk"])
def test_the_drawn_cylinder_is_seen_and_within_reach_wherever_it_stands(name, seed):
    setup = load_camera(name)
    picture = draw_demo(setup.camera, np.random.default_rng(seed))
    located = look(picture, setup.camera, [setup.targets["green"]]).located
    assert len(located) == 1
    # it stands on the table
    assert located[0].p_base[2] == pytest.approx(-0.11 + 0.0225, abs=3e-3)
    assert arm3dof.inverse_kinematics(arm3dof.load_robot(), located[0].p_base).reachable
    assert setup.targets["green"].width_m == 2 * RADIUS


def test_a_story_in_which_nothing_is_seen(paper, tmp_path):
    grey = np.full((480, 640, 3), 128, np.uint8)
    story = tell(arm3dof.load_robot(), grey, paper.camera, paper.targets, tmp_path)
    assert story.outcome is Outcome.NOTHING_SEEN
    assert not story.succeeded
    assert story.reach is None
    assert {file.name for file in story.files} == {"seen.png", "summary.json"}
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["found"] is False
    assert summary["target_m"] is None


def test_a_story_in_which_the_object_is_too_far(paper, tmp_path):
    near = paper.camera
    pose = near.transform_base_camera.copy()
    pose[:3, 3] += [0.5, 0.0, 0.0]
    camera = Camera(near.width, near.height, near.camera_matrix, near.distortion, pose)
    picture = draw_demo(near, np.random.default_rng(1))
    story = tell(arm3dof.load_robot(), picture, camera, [paper.targets["green"]], tmp_path)
    assert story.outcome is Outcome.OUT_OF_REACH
    assert story.recording is None
    assert json.loads((tmp_path / "summary.json").read_text())["reason"] == "too_far"


@pytest.mark.slow
def test_a_story_that_ends_too_soon(paper, tmp_path):
    picture = draw_demo(paper.camera, np.random.default_rng(1))
    green = [paper.targets["green"]]
    story = tell(arm3dof.load_robot(), picture, paper.camera, green, tmp_path, duration=0.2)
    assert story.outcome is Outcome.NOT_SETTLED
    assert (tmp_path / "report.html").is_file()


def test_every_outcome_has_its_sentence():
    assert len({outcome.sentence for outcome in Outcome}) == len(Outcome)


# ---- the command -------------------------------------------------------------------------------


@pytest.fixture
def demo(capsys, tmp_path):
    """Return a function that runs the demo with --json, without a page, into a folder."""

    def call(*words):
        folder = tmp_path / "out"
        given = ["demo", "--no-serve", "--json", "--out", str(folder), *map(str, words)]
        code = app.main(given)
        captured = capsys.readouterr()
        assert captured.err == ""
        return code, json.loads(captured.out), folder

    return call


@pytest.mark.slow
def test_demo(demo):
    code, answer, folder = demo()
    assert code == 0
    assert (answer["outcome"], answer["lifted"], answer["placed"]) == ("placed", True, True)
    assert answer["lift_m"] > 0.05
    assert answer["place_error_m"] < 0.01
    assert answer["torque_violations"] == 0
    assert answer["url"] is None
    assert {it["target"] for it in answer["objects"]} == {"green", "red", "blue"}
    written = {file.name for file in folder.iterdir()}
    assert {Path(file).name for file in answer["files"]} == written
    assert {"seen.png", "report.html", "torque.png", "run.npz"} <= written
    summary = json.loads((folder / "summary.json").read_text())
    assert summary == {key: answer[key] for key in summary}
    recording = Recording.load(folder / "run.npz")
    assert set(recording.bodies) == {"green_0", "red_1", "blue_2"}
    assert recording.bodies["green_0"][:, 2].max() > recording.bodies["green_0"][0, 2] + 0.05
    assert np.ptp(recording.gripper) > 0.01


@pytest.mark.slow
def test_the_camera_is_filmed(demo, monkeypatch):
    monkeypatch.setattr(task_story, "_EVERY", 16)  # the eye looks at each picture
    code, _, folder = demo("--seed", "1", "--target", "red", "--mp4")
    assert code == 0
    steps = len(Recording.load(folder / "run.npz").tau)
    film = cv2.VideoCapture(str(folder / "camera.mp4"))
    frames = [film.read()[1] for _ in range(int(film.get(cv2.CAP_PROP_FRAME_COUNT)))]
    film.release()
    assert len(frames) == steps // 16 > 20
    assert all(frame.shape == (480, 640, 3) for frame in frames)
    before, after = frames[0].astype(float), frames[-1].astype(float)
    assert np.abs(before - after).mean() > 1


@pytest.mark.slow
def test_without_physics_a_picture_is_drawn(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(demo_command, "why_no_physics", lambda robot: "MuJoCo is not installed")
    assert app.main(["demo", "--no-serve", "--json", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert captured.err == "drawn, not simulated: MuJoCo is not installed\n"
    assert json.loads(captured.out)["outcome"] == "settled"


def test_an_arm_without_a_gripper_does_not_grasp():
    assert "ur5" in (why_no_physics(arm3dof.load_robot("ur5")) or "")
    assert why_no_physics(arm3dof.load_robot("arm3dof")) is None


@pytest.mark.slow
def test_demo_on_a_photograph_runs_through_to_a_settled_arm(demo):
    code, answer, _ = demo("--image", COFFEE)
    assert code == 0
    assert answer["settled"] is True
    assert answer["torque_violations"] == 0
    assert set(answer["assumed"]) == {"focal_px", "hsv", "width_m"}
    assert answer["objects"][0]["depth_m"] == pytest.approx(0.2, rel=0.03)


@pytest.mark.slow
def test_demo_on_a_photograph_for_people(capsys, tmp_path):
    words = ["demo", "--no-serve", "--image", str(FLOWER), "--out", str(tmp_path)]
    assert app.main(words) == 0
    out = capsys.readouterr().out
    assert "assumed the most conspicuous colour" in out
    assert "the arm settled at the object" in out
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["settled"] is True
    assert summary["torque_violations"] == 0


def test_demo_assumes_only_what_is_not_given(demo):
    words = ["--image", FLOWER, "--hsv", "2,90,60,22,255,255", "--width-m", "1.0"]
    code, answer, _ = demo(*words)
    assert (code, answer["outcome"]) == (1, "out_of_reach")
    assert set(answer["assumed"]) == {"focal_px"}


@pytest.mark.slow
def test_demo_with_a_camera_and_its_target(demo, tmp_path, paper):
    image = tmp_path / "table.png"
    cv2.imwrite(str(image), draw_demo(paper.camera, np.random.default_rng(3)))
    code, answer, _ = demo("--image", image, "--camera", "paper", "--target", "green")
    assert code == 0
    assert answer["assumed"] == {}
    code, answer, _ = demo(
        "--image", image, "--camera", "paper", "--hsv", "0,0,0,1,1,1", "--width-m", "0.03"
    )
    assert code == 1
    assert answer["outcome"] == "nothing_seen"


def test_demo_on_a_picture_without_colour(demo, tmp_path):
    image = tmp_path / "grey.png"
    cv2.imwrite(str(image), np.full((100, 120, 3), 128, np.uint8))
    code, answer, folder = demo("--image", image)
    assert code == 1
    assert answer["outcome"] == "nothing_seen"
    assert (folder / "seen.png").is_file()


def test_demo_of_what_is_not_seen_whole(demo, tmp_path):
    image = tmp_path / "cut.png"
    picture = np.full((100, 120, 3), 128, np.uint8)
    picture[:, :60] = (30, 180, 40)
    cv2.imwrite(str(image), picture)
    code, answer, _ = demo("--image", image, "--hsv", "40,80,40,90,255,255")
    assert code == 1
    assert answer["outcome"] == "nothing_seen"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--image", "no.png"], "no.png"),
        (["--image", COFFEE, "--camera", "paper"], "640 x 480"),
        (["--image", COFFEE, "--target", "red"], "--camera"),
        (["--camera", "none.toml"], "none.toml"),
        (["--target", "pink"], "pink"),
        (["--target", "red", "--hsv", "0,0,0,1,1,1"], "both given"),
        (["--hsv", "0,0,0,1,1,1"], "--width-m"),
        (["--width-m", "0.03"], "--hsv"),
        (["--robot", "none"], "no robot 'none'"),
    ],
)
def test_demo_refuses(capsys, tmp_path, words, reason):
    code = app.main(["demo", "--no-serve", "--out", str(tmp_path), *map(str, words)])
    captured = capsys.readouterr()
    assert (code, captured.out) == (2, "")
    assert captured.err.count("\n") == 1
    assert reason in captured.err


def test_tell_refuses_a_folder_that_is_a_file(paper, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        tell(
            arm3dof.load_robot(),
            np.zeros((480, 640, 3), np.uint8),
            paper.camera,
            paper.targets,
            tmp_path / "file",
        )


# ---- in the physics world ----------------------------------------------------------------------


def drive(plant, controller, target, duration):
    hold = round(controller.dt / plant.dt)
    for step in range(round(duration / plant.dt)):
        if step % hold == 0:
            tau = controller.step(plant.measure(), target).tau
        plant.step(tau)


def test_what_a_camera_sees_is_gripped_and_lifted():
    robot, desk = arm3dof.load_robot(), load_camera("desk")
    bodies = tuple(
        Body(name, "cylinder", 0.03, 0.06, mass, COLOURS[name], x, y)
        for name, mass, x, y in (("red", 0.05, 0.19, 0.04), ("green", 0.02, 0.17, -0.09))
    )
    plant = MujocoPlant(robot, World(bodies=bodies))
    aside = np.array([-2.0, 1.8, -0.6])
    plant.reset(arm3dof.JointState(0.0, aside, np.zeros(3)))
    camera = WorldCamera(
        plant,
        desk.camera.camera_matrix,
        desk.camera.transform_base_camera,
        desk.camera.width,
        desk.camera.height,
        noise=2.0,
        rng=np.random.default_rng(0),
    )
    with camera:
        view = look(camera.take(), desk.camera, [desk.targets["red"]])
    assert len(view.located) == 1
    seen = view.located[0].p_base
    np.testing.assert_allclose(seen, plant.body_pose("red")[:3, 3], atol=8e-3)

    grip = arm3dof.inverse_kinematics(robot, seen).best
    along = np.array([np.cos(grip[1:].sum()), np.sin(grip[1:].sum())])
    out = np.array([np.cos(grip[0]), np.sin(grip[0]), 1.0])
    before = arm3dof.inverse_kinematics(robot, seen - 0.06 * along[[0, 0, 1]] * out, near=grip).best
    high = arm3dof.inverse_kinematics(robot, seen + np.array([0.0, 0.0, 0.07]), near=grip).best
    controller = arm3dof.MpcController(robot)
    for target, duration in ((before, 2.0), (grip, 1.0)):
        drive(plant, controller, target, duration)
    plant.command_gripper(0.0)
    drive(plant, controller, grip, 0.7)
    assert plant.gripper.opening == pytest.approx(0.03, abs=2e-3)
    loaded = arm3dof.MpcController(robot.with_payload(0.05))
    drive(plant, loaded, high, 1.5)
    assert plant.body_pose("red")[2, 3] > -0.08 + 0.06
    np.testing.assert_allclose(plant.state.q, high, atol=1e-3)  # its load is known: no droop
    np.testing.assert_allclose(plant.body_pose("green")[:2, 3], [0.17, -0.09], atol=1e-3)
