"""The arm, its controllers and what it was told: everything of the live world but its clock.

``LiveArm`` advances by frames, a few to each control step, and does the same whether a clock
drives it in real time or a test in none at all.
"""

from __future__ import annotations

import numpy as np

from arm3dof.control.mpc import MpcController
from arm3dof.control.settings import MpcSettings
from arm3dof.control.step import Controller, TorqueSource
from arm3dof.errors import InputError
from arm3dof.model.robot import Robot
from arm3dof.runtime.live import commands as cmd
from arm3dof.runtime.live.brake import Brake, unplanned
from arm3dof.runtime.live.controllers import build_controller
from arm3dof.runtime.live.frames import PLAN_ROWS, Frames, Mode, frame_type
from arm3dof.runtime.live.mind import Mind, OwnMind
from arm3dof.runtime.live.motion import Motion
from arm3dof.runtime.live.plants import LivePlant
from arm3dof.runtime.live.work import PHASES, Work, errand
from arm3dof.runtime.tasks.signals import Sight
from arm3dof.sim.world import World
from arm3dof.state import Array, finite_vector

FRAME_RATE = 60.0
"""Frames that are aimed at [1/s]; a faster controller gives one a control step."""


class LiveArm:
    """A plant under control that does what it is told, frame by frame.

    Attributes:
        plant: the body that moves.
        mode: what the arm is doing.
        paused: whether time stands still.
        kind: type of the frames.
        sight: the latest that the eye knows; what a task sees.
        said: what has happened since it was looked at, in words; whoever reads it clears it.
    """

    def __init__(
        self,
        plant: LivePlant,
        start: Array,
        control: cmd.Control | None = None,
        world: World | None = None,
        mind: Mind | None = None,
    ) -> None:
        """Create an arm that holds its start.

        Args:
            plant: the body.
            start: joint positions to begin at, shape (nv,) [rad].
            control: the controller to begin with.
            world: what is known of the surroundings; without one there are no tasks.
            mind: what decides in a task; a mind of its own, for which time waits, without.
        """
        robot = plant.robot
        self.plant, self.kind = plant, frame_type(robot.nv, len(plant.bodies))
        self._start = finite_vector(start, robot.nv, "start")
        self._true, self._model, self._world = robot, robot, world
        self._mind = OwnMind() if mind is None else mind
        self._motion = Motion(plant)
        self._work: Work | None = None
        self.sight: Sight | None = None
        self.said: list[str] = []
        self._load, self._version, self._run = 0.0, 0, 0
        self.paused = False
        self._steps_left, self._decided_at = 0, 0.0
        self._q_target = self._start
        self._frame = 0
        plant.restart(self._start)
        self._choose(control or cmd.Control())
        self._hold(self._start)

    # ---- commands --------------------------------------------------------------------------

    def obey(self, command: cmd.Command) -> None:
        """Do what a command says.

        Raises:
            ArmError: it cannot be done; everything is as before.
        """
        match command:
            case cmd.Run():
                self._begin_run()
            case cmd.Stop():
                self.stop()
            case cmd.Pause(paused):
                self.paused = paused
            case cmd.StepOnce():
                self.paused = True
                self._steps_left = len(self._schedule)
            case cmd.Aim(q_target):
                self._q_target = finite_vector(q_target, self._true.nv, "the target")
            case cmd.Push():
                self._motion.push(command)
            case cmd.Load(mass):
                self._load = mass
                self.plant.change_robot(self._loaded())
            case cmd.Grip(opening):
                self.plant.grip(opening)
            case cmd.Control():
                self._choose(command)
            case cmd.Rebuild():
                self._rebuild(command)
            case cmd.Restart():
                self.plant.restart(self._start)
                self._hold(self._start)
            case cmd.Do():
                self._begin_work(command)
            case cmd.Alive():
                pass

    def stop(self) -> None:
        """Brake to rest, then hold there."""
        self.paused = False
        self._end_work()
        self.mode = Mode.BRAKING
        self._brake.reset()

    def _begin_work(self, do: cmd.Do) -> None:
        if self._world is None or not np.isfinite(self.plant.opening):
            raise InputError(f"this world has nothing to {do.task}; start one with physics")
        sent = errand(do, self._model, self._start, self._world)
        work = Work(sent, self._model, self._mind)
        self._end_work()
        self._begin_run()
        self._work, self.mode = work, Mode.WORKING
        self._set_schedule(work.dt)

    def _end_work(self) -> None:
        if self._work is not None:
            self._work = None
            self._set_schedule(self._controller.dt)

    def _begin_run(self) -> None:
        self._end_work()
        self.paused = False
        self._controller.reset()
        self._run += 1
        self._motion.energy = 0.0
        self.mode = Mode.RUNNING
        self._frame = 0

    def _choose(self, control: cmd.Control) -> None:
        """Build the chosen controller, the one that holds, and the brake; then use them."""
        settings = control.settings()
        steps = round(settings.dt / self.plant.dt)
        if steps < 1 or abs(steps * self.plant.dt - settings.dt) > 1e-9:
            raise InputError(
                f"dt is {settings.dt} s; give a whole number of steps of {self.plant.dt} s"
            )
        controller = build_controller(self._model, control)
        holder = MpcController(self._model, MpcSettings(dt=settings.dt))
        was_working = self._work is not None
        self._end_work()
        self._controller, self._holder, self._control = controller, holder, control
        self._asked: Controller | None = None
        self._set_schedule(settings.dt)
        held = self.plant.robot.gravity(self.plant.state.q)
        tau = np.clip(held, -self._tau_max, self._tau_max)
        self._answer = unplanned(tau, np.zeros(self._true.nv), TorqueSource.OPTIMUM)
        self._motion.delay(control.delay, tau)
        if was_working:
            self.said.append("the arm or its controller has changed, so the task was given up")
            self.stop()

    def _set_schedule(self, dt: float) -> None:
        """Divide a control step into frames of whole plant steps."""
        count = max(1, round(dt * FRAME_RATE))
        steps = np.round(np.linspace(0, round(dt / self.plant.dt), count + 1)).astype(int)
        self._schedule = np.diff(steps)
        self._brake = Brake(self._model, dt / count)
        self._frame = 0

    def _rebuild(self, change: cmd.Rebuild) -> None:
        robot = change.robot.unpack()
        if robot.nv != self._true.nv:
            raise InputError(
                f"{robot.name} has {robot.nv} joints; this world goes on with {self._true.nv}"
            )
        self._true = robot
        self.plant.change_robot(self._loaded())
        self._version = change.version
        if change.told:
            self._model = robot
            self._choose(self._control)

    def _loaded(self) -> Robot:
        return self._true.with_payload(self._load) if self._load else self._true

    def _hold(self, q: Array) -> None:
        self.mode, self._rest = Mode.HOLDING, np.array(q)
        self._holder.reset()
        self._end_work()
        self._frame = 0

    @property
    def _tau_max(self) -> Array:
        return self._true.limits.tau_max

    # ---- time ------------------------------------------------------------------------------

    @property
    def frame_time(self) -> float:
        """How long the next frame lasts [s]."""
        return float(self._schedule[self._frame]) * self.plant.dt

    def advance(self) -> Frames:
        """Let the next frame pass, unless time stands still, and return what there is to see."""
        controlled = False
        frozen = self.paused and self._steps_left == 0
        if not frozen:
            if self.mode is Mode.BRAKING:
                self._braking()
            controlled = self._frame == 0 and self.mode is not Mode.BRAKING
            if controlled:
                self._decide()
            is_last = self._frame == len(self._schedule) - 1
            steps = int(self._schedule[self._frame])
            self._motion.move(self._answer.tau, steps, self._asked, is_last=is_last)
            self._steps_left = max(self._steps_left - 1, 0)
        self._frame = (self._frame + 1) % len(self._schedule)
        return self._seen(controlled)

    def _decide(self) -> None:
        state = self.plant.measure()
        if self._work is not None:
            self._answer = self._work.step(state, self.plant, self.sight)
            self._asked, self._q_target = self._work.controller, self._work.target
            if self._work.phase.is_final:
                self.said.append(self._work.verdict)
                self._q_target = state.q
                self._hold(state.q)
            return
        self._asked, target = self._holder, self._rest
        if self.mode is Mode.RUNNING:
            self._asked, target = self._controller, self._q_target
        self._answer, self._decided_at = self._asked.step(state, target), state.t

    def _braking(self) -> None:
        state = self.plant.measure()
        if self._brake.is_done(state):
            self._hold(state.q)
            return
        self._asked = None
        self._answer = self._brake.step(state, self._tau_max)

    # ---- what there is to see ---------------------------------------------------------------

    def _seen(self, controlled: bool) -> Frames:
        state, answer, robot = self.plant.state, self._answer, self.plant.robot
        frame = np.zeros((), self.kind)
        frame["t"], frame["q"], frame["v"] = state.t, state.q, state.v
        frame["tau"] = self._motion.given
        frame["u"], frame["q_target"] = answer.u, self._q_target
        frame["gravity"] = robot.gravity(state.q)
        frame["tool"] = robot.placement(state.q).translation
        frame["energy"], frame["load"] = self._motion.energy, self._load
        frame["opening"], frame["bodies"] = self.plant.opening, self.plant.bodies
        frame["fingers"] = self.plant.fingers
        frame["step_time"], frame["control"] = answer.solve_time, controlled
        frame["mode"], frame["status"], frame["source"] = self.mode, answer.status, answer.source
        frame["paused"], frame["run"], frame["version"] = self.paused, self._run, self._version
        if isinstance(self._controller, MpcController):
            frame["disturbance"] = self._controller.observer.disturbance
        if self._work is not None:
            frame["phase"] = PHASES.index(self._work.phase)
        self._show_plan(frame)
        return frame

    def _show_plan(self, frame: Frames) -> None:
        plan = self._answer.plan
        if self.mode is not Mode.RUNNING or len(plan) < 2 or self._asked is not self._controller:
            return
        rows = np.linspace(0, len(plan) - 1, min(PLAN_ROWS, len(plan))).astype(int)
        frame["plan_rows"] = rows.size
        frame["plan_q"][: rows.size] = self._q_target - plan[rows, : self._true.nv]
        frame["plan_v"][: rows.size] = plan[rows, self._true.nv :]
        frame["plan_t"][: rows.size] = self._decided_at + rows * self._controller.dt
