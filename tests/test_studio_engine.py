"""The studio's arm: does what it is told, in no time at all and in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.testing import assert_allclose

from arm3dof.control.tuning import Gains
from arm3dof.errors import ArmError, InputError
from arm3dof.model.library import load_robot
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.arm import LiveArm
from arm3dof.runtime.live.frames import Mode, Ring, frame_type
from arm3dof.runtime.live.pace import Pacer, SimulatedClock, lateness_percentiles
from arm3dof.runtime.live.physics import PhysicsPlant
from arm3dof.runtime.live.plants import RigidPlant
from arm3dof.runtime.live.process import SILENCE, ArmLoop, ArmProcess, ArmSpec, News
from arm3dof.runtime.parallel import PackedRobot
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World
from arm3dof.ui.studio.keep import LONGEST, Runs
from arm3dof.ui.studio.start import home, table
from arm3dof.vision.standing import Standing

TARGET = (0.4, 1.0, -0.8)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture
def arm(robot: Robot) -> LiveArm:
    return LiveArm(RigidPlant(robot), np.zeros(3))


def pass_time(arm: LiveArm, seconds: float) -> np.ndarray:
    """The frames of a while."""
    end = float(arm.plant.state.t) + seconds
    frames = []
    while arm.plant.state.t < end - 1e-9:
        frames.append(arm.advance())
    return np.array(frames)


def run_to(arm: LiveArm, target: tuple[float, ...]) -> None:
    arm.obey(cmd.Aim(target))
    arm.obey(cmd.Run())


# ---- the arm -----------------------------------------------------------------------------------


def test_it_holds_still_until_it_is_told(arm: LiveArm) -> None:
    frames = pass_time(arm, 1.0)
    assert (frames["mode"] == Mode.HOLDING).all()
    assert np.abs(frames["q"]).max() < 1e-3
    arm.obey(cmd.Aim(TARGET))  # aiming alone moves nothing
    assert np.abs(pass_time(arm, 1.0)["q"]).max() < 1e-3


def test_it_runs_to_a_target_inside_every_limit(arm: LiveArm, robot: Robot) -> None:
    run_to(arm, TARGET)
    frames = pass_time(arm, 3.0)
    assert_allclose(frames["q"][-1], TARGET, atol=2e-3)
    assert (np.abs(frames["tau"]) <= robot.limits.tau_max + 1e-9).all()
    assert frames["energy"][-1] > 0
    assert (np.diff(frames["energy"]) >= 0).all()
    assert frames["control"].sum() == 60
    rate = len(frames) / 3.0
    assert 55 <= rate <= 65
    assert_allclose(np.diff(frames["t"]).sum() + frames["t"][0], frames["t"][-1])


def test_the_plan_says_where_it_will_be(arm: LiveArm) -> None:
    run_to(arm, TARGET)
    frames = pass_time(arm, 1.5)
    first = frames[np.flatnonzero(frames["control"])[5]]
    rows = int(first["plan_rows"])
    assert rows > 10
    for t, q in zip(first["plan_t"][1:6], first["plan_q"][1:6], strict=True):
        near = int(np.argmin(np.abs(frames["t"] - t)))
        assert_allclose(frames["q"][near], q, atol=0.05)


def test_a_stop_brakes_and_holds_where_the_arm_comes_to_rest(arm: LiveArm, robot: Robot) -> None:
    run_to(arm, TARGET)
    moving = pass_time(arm, 0.15)
    assert np.abs(moving["v"][-1]).max() > 0.5
    arm.obey(cmd.Stop())
    braking = pass_time(arm, 0.6)
    assert braking["mode"][0] == Mode.BRAKING
    assert braking["mode"][-1] == Mode.HOLDING
    held = pass_time(arm, 2.0)
    assert np.abs(np.ptp(held["q"], axis=0)).max() < 5e-3
    assert np.abs(held["q"][-1] - np.array(TARGET)).max() > 0.05  # it went no further
    assert (np.abs(braking["tau"]) <= robot.limits.tau_max + 1e-9).all()


def test_a_pause_freezes_time_and_a_step_lets_one_control_step_pass(arm: LiveArm) -> None:
    run_to(arm, TARGET)
    pass_time(arm, 0.3)
    arm.obey(cmd.Pause(True))
    still = np.array([arm.advance() for _ in range(10)])
    assert len(set(still["t"].tolist())) == 1
    assert still["paused"].all()
    arm.obey(cmd.StepOnce())
    stepped = np.array([arm.advance() for _ in range(10)])
    assert_allclose(stepped["t"][-1] - still["t"][-1], 0.05)
    arm.obey(cmd.Pause(False))
    assert_allclose(pass_time(arm, 3.0)["q"][-1], TARGET, atol=2e-3)


def test_a_push_moves_the_joint_that_is_pushed_and_the_controller_brings_it_back(
    arm: LiveArm,
) -> None:
    pass_time(arm, 0.5)
    arm.obey(cmd.Push(0, 1.0, 0.2))
    frames = pass_time(arm, 4.0)
    assert np.abs(frames["q"][:, 0]).max() > 0.02
    assert np.abs(frames["q"][-1]).max() < 5e-3
    with pytest.raises(InputError, match="joint is 7; give 0 to 2"):
        arm.obey(cmd.Push(7, 1.0))


def test_a_payload_is_carried_and_taken_off_to_the_last_bit(arm: LiveArm, robot: Robot) -> None:
    bare = pass_time(arm, 0.2)["gravity"][-1]
    arm.obey(cmd.Load(0.1))
    loaded = pass_time(arm, 3.0)
    assert loaded["load"][-1] == 0.1
    assert np.abs(loaded["gravity"][-1] - bare).max() > 0.1
    assert np.abs(loaded["q"][-1]).max() < 0.02  # the controller has learned it
    arm.obey(cmd.Load(0.0))
    arm.obey(cmd.Restart())
    assert_allclose(pass_time(arm, 0.05)["gravity"][-1], robot.gravity(np.zeros(3)), atol=1e-6)


def test_other_parameters_act_at_once(arm: LiveArm, robot: Robot) -> None:
    before = pass_time(arm, 0.2)["tau"][-1]
    heavy = load_robot(overrides={"link3.mass": 0.3})
    arm.obey(cmd.Rebuild(PackedRobot.of(heavy), 7))
    after = pass_time(arm, 1.0)
    assert after["version"][-1] == 7
    assert_allclose(after["tau"][-1], heavy.gravity(after["q"][-1]), atol=0.02)
    assert np.abs(after["tau"][-1] - before).max() > 0.05


@pytest.mark.parametrize("name", cmd.CONTROLLERS)
def test_every_controller_can_be_chosen(arm: LiveArm, name: cmd.ControllerName) -> None:
    gains = Gains(np.full(3, 4.0), np.full(3, 0.3), np.full(3, 2.0))
    arm.obey(cmd.Control(name, {"dt": 0.02}, gains=gains))
    assert_allclose(arm.frame_time, 0.02)
    run_to(arm, (0.2, 0.3, -0.2))
    assert np.abs(pass_time(arm, 0.5)["q"][-1]).max() > 0.05


def test_a_delay_acts_and_can_be_declared(arm: LiveArm) -> None:
    arm.obey(cmd.Control("mpc", {"delay": 0.05}, delay=0.05))
    run_to(arm, TARGET)
    assert_allclose(pass_time(arm, 3.0)["q"][-1], TARGET, atol=5e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cmd.Aim((np.nan, 0.0, 0.0)), "give finite numbers"),
        (lambda: cmd.Push(0, np.inf), "give finite numbers"),
        (lambda: cmd.Load(-1.0), "give 0 or more"),
        (lambda: cmd.Control("mpcc"), "give one of: mpc, computed-torque"),
        (lambda: cmd.Control(mpc={"horizon": 0}), "horizon is 0"),
        (lambda: cmd.Control(delay=2.0), "give 0 to 0.5 s"),
        (lambda: cmd.Control("pid"), "pid has no gains"),
    ],
)
def test_a_bad_command_is_refused_where_it_is_made(make, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_what_cannot_be_done_changes_nothing(arm: LiveArm) -> None:
    frame = pass_time(arm, 0.1)[-1]
    for command in (
        cmd.Aim((0.0, 0.0)),
        cmd.Control(mpc={"dt": 0.0123456}),
        cmd.Do("grasp"),
    ):
        with pytest.raises(ArmError):
            arm.obey(command)
    assert_allclose(pass_time(arm, 0.5)["q"][-1], frame["q"], atol=1e-3)


# ---- the world with physics ----------------------------------------------------------------------


def standing(world: World) -> tuple[Standing, ...]:
    """What a perfect eye would see of a world that nobody has touched."""
    sure = 1e-8 * np.eye(2)
    return tuple(
        Standing(it.name, it.x, it.y, it.width_m, it.height_m, sure) for it in world.bodies
    )


@pytest.fixture(scope="module")
def world() -> World:
    made = table()
    assert isinstance(made, World)
    return made


@pytest.fixture
def worker(robot: Robot, world: World) -> LiveArm:
    return LiveArm(PhysicsPlant(robot, world), home(robot), None, world)


@pytest.mark.slow
def test_it_grasps_an_object_and_puts_it_aside(worker: LiveArm, world: World) -> None:
    first = pass_time(worker, 0.2)[-1]
    worker.obey(cmd.Do("grasp", "red", (0.16, 0.08)))
    highest = 0.0
    while worker.mode is Mode.WORKING and worker.plant.state.t < 40:
        worker.sight = Sight(standing(world), float(worker.plant.state.t))
        frame = worker.advance()
        highest = max(highest, float(frame["bodies"][1, 2] - first["bodies"][1, 2]))
    assert worker.said == ["the task is done"]
    assert highest > 0.02
    np.testing.assert_allclose(frame["bodies"][1, :2], (0.16, 0.08), atol=0.01)
    assert pass_time(worker, 0.5)["control"].sum() == 10  # the person's controller is back


def test_a_stop_ends_a_task(worker: LiveArm, world: World) -> None:
    worker.sight = Sight(standing(world), 0.0)
    worker.obey(cmd.Do("grasp", "red", (0.16, 0.08)))
    assert pass_time(worker, 0.1)["mode"][-1] == Mode.WORKING
    worker.obey(cmd.Stop())
    assert pass_time(worker, 0.6)["mode"][-1] == Mode.HOLDING


def test_fingers_and_a_longer_link_move_in_the_physics_world(worker: LiveArm) -> None:
    opened = pass_time(worker, 0.3)[-1]["opening"]
    worker.obey(cmd.Grip(0.02))
    assert pass_time(worker, 0.8)[-1]["opening"] == pytest.approx(0.02, abs=2e-3)
    assert opened > 0.04
    longer = load_robot(overrides={"link3.length": 0.17})
    before = worker.plant.state.q
    worker.obey(cmd.Rebuild(PackedRobot.of(longer), 1))
    frame = pass_time(worker, 0.2)[-1]
    np.testing.assert_allclose(frame["q"], before, atol=0.02)
    np.testing.assert_allclose(frame["tool"], longer.placement(frame["q"]).translation, atol=1e-9)


# ---- frames and time ---------------------------------------------------------------------------


def test_a_ring_keeps_the_last_frames() -> None:
    kind = frame_type(2)
    ring = Ring(kind, lambda code, size: bytearray(size), size=8)
    assert ring.latest() is None
    count, frames = ring.since(0)
    assert (count, len(frames)) == (0, 0)
    for number in range(20):
        frame = np.zeros((), kind)
        frame["t"] = number
        ring.write(frame)
    assert ring.latest()["t"] == 19
    count, frames = ring.since(0)
    assert count == 20
    assert frames["t"].tolist() == list(range(13, 20))
    assert len(ring.since(20)[1]) == 0
    assert ring.since(18)[1]["t"].tolist() == [18, 19]


def test_what_is_kept_of_a_run_stays_small(robot: Robot) -> None:
    frames = np.zeros(12, frame_type(robot.nv, bodies=3))
    frames["run"] = 1
    runs = Runs()
    for start in np.arange(0.0, 2 * LONGEST, 0.2):
        frames["t"] = start + np.arange(12) / 60
        runs.add(frames)
    recording = runs.recording(robot, cmd.Control())
    assert recording.t[-1] == pytest.approx(LONGEST, abs=0.5)
    assert runs.nbytes < 2 << 20


def test_a_pacer_adds_up_no_error_and_counts_what_it_missed() -> None:
    clock = SimulatedClock()
    pacer = Pacer(clock)
    for _ in range(1000):
        assert pacer.wait(0.05) == 0.0
    assert_allclose(clock.now(), 50.0)
    clock.wait_until(50.2)  # work that took too long
    assert_allclose(pacer.wait(0.05), 0.15)
    assert pacer.missed == 1
    assert pacer.wait(0.05) == 0.0
    assert lateness_percentiles(np.array([])) == {"p50": 0.0, "p99": 0.0, "max": 0.0}


# ---- the loop ----------------------------------------------------------------------------------


class Page:
    """Stands in for the page: sends what it is given, and keeps what it is told."""

    def __init__(self, arm: LiveArm) -> None:
        self.mail: list[cmd.Command] | None = []
        self.news: list[News] = []
        self.arm = arm
        self.ring = Ring(arm.kind, lambda code, size: bytearray(size))
        self.loop = ArmLoop(arm, self.ring, self.take, self.news.append, SimulatedClock())

    def take(self) -> list[cmd.Command] | None:
        if self.mail is None:
            return None
        mail, self.mail = self.mail, []
        return mail

    def ticks(self, seconds: float, *, alive: bool = True) -> None:
        for _ in range(round(seconds * 60)):
            if alive and self.mail is not None:
                self.mail.append(cmd.Alive())
            self.loop.tick()


@pytest.fixture
def page(arm: LiveArm) -> Page:
    return Page(arm)


def test_a_page_that_falls_silent_stops_the_arm(page: Page) -> None:
    page.mail = [cmd.Aim(TARGET), cmd.Run()]
    page.ticks(0.2)
    assert page.arm.mode is Mode.RUNNING
    page.ticks(SILENCE + 1.0, alive=False)
    assert page.arm.mode is Mode.HOLDING
    assert [news.text for news in page.news] == ["the page fell silent, so the arm was stopped"]


def test_without_a_page_the_arm_comes_to_rest_and_the_loop_ends(page: Page) -> None:
    page.mail = [cmd.Aim(TARGET), cmd.Run()]
    page.ticks(0.3)
    assert np.abs(page.ring.latest()["v"]).max() > 0.5
    page.mail = None
    page.loop.run()
    assert page.arm.mode is Mode.HOLDING
    assert np.abs(page.arm.plant.state.v).max() < 0.1


def test_a_refusal_is_told_and_the_loop_goes_on(page: Page) -> None:
    page.mail = [cmd.Push(9, 1.0), cmd.Stop("because")]
    page.ticks(0.5)
    assert [news.bad for news in page.news] == [True, True]
    assert page.news[1].text == "because"
    assert page.ring.count == 30


# ---- the process -------------------------------------------------------------------------------


@pytest.fixture
def process(robot: Robot) -> Iterator[ArmProcess]:
    running = ArmProcess(ArmSpec(PackedRobot.of(robot), (0.0, 0.0, 0.0)), lambda news: None)
    yield running
    running.close()


def eventually(condition, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_arm_lives_in_a_process_of_its_own(process: ArmProcess) -> None:
    eventually(lambda: process.ring.count > 0)
    process.send(cmd.Aim((0.1, 0.2, -0.1)))
    process.send(cmd.Run())

    def runs() -> bool:
        process.send(cmd.Alive())
        return process.ring.latest()["mode"] == Mode.RUNNING

    eventually(runs)
    process.close()
    assert not process.is_alive
    assert process.ring.latest()["mode"] == Mode.HOLDING  # it braked before it ended
    process.close()
    with pytest.raises(ArmError, match="arm3dof-arm has ended"):
        process.send(cmd.Run())
