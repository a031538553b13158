"""Tasks in the physics world: pixels in, torques out, and a judge that looks at the bodies."""

from typing import get_args

import numpy as np
import pytest

from arm3dof.model.library import load_robot
from arm3dof.runtime.campaign import trial_rng
from arm3dof.runtime.tasks import sort_trial
from arm3dof.runtime.tasks.goals import Grasping
from arm3dof.runtime.tasks.grasp_trial import GraspTrial, as_seen, gripping_of, random_grasp
from arm3dof.runtime.tasks.gripping import Grip
from arm3dof.runtime.tasks.machine import Failure, Phase
from arm3dof.runtime.tasks.record import TaskRecorder
from arm3dof.runtime.tasks.scenes import three_objects
from arm3dof.runtime.tasks.sight import SimulatedEye, look_at_table
from arm3dof.runtime.tasks.simulated import Faults, SimulatedTask, task_camera, task_targets
from arm3dof.runtime.tasks.sort_trial import SortTrial, random_table
from arm3dof.sim.world import COLOURS, Body, Shape, World
from arm3dof.vision.placing import Refusal

ROBOT = load_robot("arm3dof")
BLACK = np.zeros((480, 640, 3), np.uint8)


def table(**changes):
    body = Body("red_0", "cylinder", 0.03, 0.05, 0.03, COLOURS["red"], 0.18, 0.04)
    return World(bodies=(body,), **changes)


def grasp(world, rng=None, watch=None, **options):
    """Grasp the red body of a world; return the result, its verdict and the eye."""
    rng = rng or np.random.default_rng(0)
    with SimulatedTask(ROBOT, world, task_targets(), rng, **options) as scene:
        result = scene.run(Grasping("red", (0.15, -0.1), 0.03, attempts=1), watch=watch)
        return result, scene.verdict("red_0"), scene.eye


# ---- the eye -----------------------------------------------------------------------------------


def test_the_eye_measures_what_stands_and_leaves_the_robot_out():
    rng = np.random.default_rng(3)
    task = three_objects(ROBOT, rng, "blue", ("blue", "red", "green"))
    with SimulatedTask(ROBOT, task.world, task_targets(), rng) as scene:
        seen = look_at_table(scene.picture(), scene.camera, task_targets(), -0.11)
    assert len(seen.things) == len(seen.view.located) == 3
    for body in task.world.bodies:
        (it,) = (thing for thing in seen.things if thing.target == body.name.split("_")[0])
        assert it.distance_to(body.x, body.y) < 0.004
    for located, it in zip(seen.view.located, seen.things, strict=True):
        np.testing.assert_allclose(located.p_base[:2], [it.x, it.y])


@pytest.mark.parametrize("aside", [0.0, 0.01])
def test_what_is_half_hidden_is_refused_and_kept_clear_of(aside):
    hidden = Body("red_0", "cylinder", 0.03, 0.05, 0.03, COLOURS["red"], 0.17, 0.0)
    before = Body("green_0", "cube", 0.04, 0.06, 0.03, COLOURS["green"], 0.22, aside)
    rng = np.random.default_rng(0)
    with SimulatedTask(ROBOT, World(bodies=(hidden, before)), task_targets(), rng) as scene:
        seen = look_at_table(scene.picture(), scene.camera, task_targets(), -0.11)
        result = scene.run(Grasping("red", (0.15, -0.1), 0.03, attempts=1))
    things = {it.target: it for it in seen.things}
    assert things["red"].hidden
    assert not things["green"].hidden
    assert things["green"].distance_to(before.x, before.y) < 0.001
    assert [it.target for it in seen.view.located] == ["green"]
    assert [(it.target, it.reason) for it in seen.view.refused] == [("red", Refusal.PARTIAL)]
    assert result.failure.failure is Failure.PARTLY_HIDDEN


@pytest.mark.slow
def test_of_two_of_one_colour_in_one_patch_the_nearer_is_measured():
    rng, measured = np.random.default_rng(4), 0
    for _ in range(8):
        x, y = rng.uniform(0.17, 0.22), rng.uniform(-0.03, 0.03)
        away, aside = rng.uniform(0.04, 0.06), rng.uniform(-0.5, 0.5)
        places = (x, y), (x - away * np.cos(aside), y + away * np.sin(aside))
        kinds = rng.choice(get_args(Shape), 2)
        bodies = tuple(
            Body(f"red_{i}", kind, rng.uniform(0.024, 0.03), 0.05, 0.03, COLOURS["red"], *place)
            for i, (kind, place) in enumerate(zip(kinds, places, strict=True))
        )
        with SimulatedTask(ROBOT, World(bodies=bodies), task_targets(), rng) as scene:
            seen = look_at_table(scene.picture(), scene.camera, task_targets(), -0.11)
        assert len(seen.things) == 2
        for thing in seen.things:
            off = min(thing.distance_to(*place) for place in places)
            assert off < (0.02 if thing.hidden else 0.002)
        measured += not seen.things[0].hidden
    assert measured >= 6


def test_pictures_are_known_late_and_taken_only_when_wanted():
    taken = []
    eye = SimulatedEye(
        lambda: taken.append(0) or BLACK,
        task_camera(),
        task_targets(),
        -0.11,
        period=0.1,
        delay=0.03,
    )
    assert eye.sight(0.0, False) is None
    assert not taken
    known = [eye.sight(0.02 * k, True) for k in range(30)]
    assert len(taken) == eye.pictures == 6
    assert known[0] is known[1] is None
    assert known[2].taken_at == 0.0
    assert max(eye.ages) <= 0.1 + 0.03 + 1e-9
    assert min(eye.ages) >= 0.03
    assert eye.sight(5.0, False).taken_at == pytest.approx(0.5)  # nothing newer was asked for


def test_a_camera_that_sees_nothing_does_not_shake_the_arm(monkeypatch):
    monkeypatch.setattr(SimulatedTask, "picture", lambda self: BLACK)
    speeds = []
    result, verdict, _ = grasp(table(), watch=lambda s, a, p: speeds.append(np.abs(s.v).max()))
    assert result.failure.failure is Failure.NOT_SEEN
    assert max(speeds) < 0.01
    assert verdict.lifted < 1e-3


# ---- tasks ---------------------------------------------------------------------------------------


def test_an_object_is_lifted_and_placed_and_recorded():
    rng = np.random.default_rng(0)
    with SimulatedTask(ROBOT, table(), task_targets(), rng) as scene:
        recorder = TaskRecorder(scene)
        result = scene.run(Grasping("red", (0.15, -0.1), 0.03), watch=recorder)
        verdict = scene.verdict("red_0")
    assert result.done
    assert verdict.lifted > 0.05
    assert verdict.misses(0.15, -0.1) < 0.005
    assert verdict.rests
    recording = recorder.recording(result)
    assert recording.t[-1] >= result.duration
    assert recording.bodies["red_0"][:, 2].max() - recording.bodies["red_0"][0, 2] == pytest.approx(
        verdict.lifted, abs=1e-3
    )
    assert np.abs(recording.tau).max() <= recording.limits.tau_max.max()
    assert recording.gripper.min() == pytest.approx(0.03, abs=2e-3)
    assert recording.notes["task.01 look"].startswith("until ")
    assert np.abs(np.rad2deg(recording.e)).max() < 5


@pytest.mark.slow
def test_slippery_fingers_lose_the_object_and_say_so():
    result, verdict, _ = grasp(table(grip_friction=0.005, friction=0.005))
    assert result.phase is Phase.FAILED
    assert result.failure.failure in (Failure.SLIPPED, Failure.DROPPED)
    assert verdict.misses(0.15, -0.1) > 0.01


@pytest.mark.slow
def test_an_object_that_is_nailed_down_blocks_the_arm():
    body = Body("red_0", "cylinder", 0.03, 0.05, 60.0, COLOURS["red"], 0.18, 0.04)
    result, verdict, _ = grasp(World(bodies=(body,)))
    assert result.phase is Phase.FAILED
    assert result.failure.failure in (Failure.BLOCKED, Failure.SLIPPED)
    assert verdict.lifted < 0.01


def test_what_is_drawn_can_be_grasped():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        task = random_grasp(ROBOT, rng)
        assert isinstance(gripping_of(ROBOT).grip(as_seen(task.body)), Grip)
        assert 0.02 <= task.body.width_m <= 0.04
        assert 0.01 <= task.body.mass <= 0.06


@pytest.mark.slow
@pytest.mark.parametrize("faults", [None, Faults()], ids=["nominal", "faults"])
def test_grasping_succeeds_in_a_small_campaign(faults):
    outcomes = [GraspTrial(faults)(trial_rng(11, number)) for number in range(5)]
    assert [outcome.reason for outcome in outcomes] == [""] * 5
    again = GraspTrial(faults)(trial_rng(11, 0))
    assert again.figures == outcomes[0].figures


@pytest.mark.slow
def test_a_trial_of_sorting_counts_what_is_in_its_bin(monkeypatch):
    """The example sorts nine."""
    assert len(random_table(np.random.default_rng(0)).bodies) == 9
    monkeypatch.setattr(sort_trial, "random_table", lambda rng: random_table(rng, 4))
    outcome = SortTrial()(trial_rng(12, 0))
    assert outcome.reason == ""
    assert outcome.figures["objects_in_all"] == outcome.figures["objects_sorted"] == 4
    assert outcome.figures["objects_fallen"] == 0
