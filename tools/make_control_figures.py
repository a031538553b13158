"""Draw the figures of docs/mpc.md: each is a few simulated runs and what they show."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

import arm3dof
from arm3dof.control.reference import Target, cartesian_path
from arm3dof.files import write_atomically
from arm3dof.model.uncertainty import perturbed
from arm3dof.runtime.experiment import PAPER_TARGET_DEG
from arm3dof.runtime.metrics import SETTLED_ERROR, SETTLED_SPEED
from arm3dof.runtime.sweep import Vary, default_points, sweep
from arm3dof.runtime.sweep import points as sweep_points
from arm3dof.sim.disturbance import DisturbedPlant, PayloadChange
from arm3dof.state import Array
from arm3dof.ui.plots import png
from arm3dof.ui.style import COLORS, INK, LIMIT, SETTLED, SETTLED_BAND, SOFT, STYLE

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
BLUE, ORANGE, GREEN, PINK = COLORS[:4]
SHADES = mpl.colormaps["viridis"]
PALE = "#B9C3CD"
TARGET = np.deg2rad(PAPER_TARGET_DEG)
ARM = arm3dof.load_robot()


Show = Callable[[arm3dof.JointState, Target], tuple[arm3dof.JointState, Target]]


class Thought(NamedTuple):
    """A control step: when, what the controller answered, and the load that it believed in [kg]."""

    t: float
    step: arm3dof.ControlStep
    load: float


class Between:
    """A controller that is shown something else than what is there."""

    def __init__(self, controller: arm3dof.MpcController, show: Show) -> None:
        self.controller, self.dt, self._show = controller, controller.dt, show

    def step(self, state: arm3dof.JointState, target: Target) -> arm3dof.ControlStep:
        """Answer to what is shown."""
        return self.controller.step(*self._show(state, target))

    def reset(self) -> None:
        """Forget the past."""
        self.controller.reset()


def drive(
    plant: arm3dof.Plant,
    settings: arm3dof.MpcSettings,
    target: Target = TARGET,
    *,
    start: ArrayLike = (0.0, 0.0, 0.0),
    duration: float = 2.0,
    show: Show | None = None,
    believed: arm3dof.Robot | None = None,
) -> tuple[arm3dof.Recording, list[Thought]]:
    """Drive a plant from rest; return what happened, and what its controller thought."""
    mpc = arm3dof.MpcController(believed or plant.robot, settings)
    controller = Between(mpc, show) if show else mpc
    thoughts: list[Thought] = []

    def listen(state: arm3dof.JointState, step: arm3dof.ControlStep) -> None:
        thoughts.append(Thought(state.t, step, mpc.observer.estimator.load))

    plant.reset(arm3dof.JointState(0.0, np.asarray(start, float), np.zeros(plant.robot.nv)))
    return arm3dof.run_loop(plant, controller, target, duration, [listen]), thoughts


# ---- the figures -------------------------------------------------------------------------------


def plans() -> Figure:
    """What each formulation believes will happen, and what does."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    joint = 2
    for axes, formulation, title in (
        (left, "paper", "The paper's formulation"),
        (right, "tracking", "Tracking"),
    ):
        plant = arm3dof.PinocchioPlant(ARM)
        settings = arm3dof.MpcSettings(formulation=formulation)
        recording, thoughts = drive(plant, settings, duration=1.5)
        miss = []
        for t, step, _ in thoughts[:24]:
            at = t + settings.dt * np.arange(len(step.plan))
            e = np.rad2deg(step.plan[:, joint])
            axes.plot(at, e, color=ORANGE, linewidth=0.9, alpha=0.75, zorder=3)
            axes.plot(at[0], e[0], ".", color=ORANGE, markersize=5, zorder=5)
            happened = np.rad2deg(np.interp(t + 0.3, recording.t, recording.e[:, joint]))
            miss.append(abs(float(e[6] - happened)))
        band(axes)
        axes.plot(recording.t, np.rad2deg(recording.e[:, joint]), color=BLUE, zorder=4, lw=2.4)
        axes.set(title=title, xlabel="time [s]")
        say(axes, 0.98, 0.95, f"0.3 s ahead the plans err\nby up to {max(miss):.0f}°", "right")
    left.set(xlim=(0, 1.5), ylabel="error of joint3 [deg]")
    axes = right
    axes.plot([], [], color=BLUE, label="what the arm did")
    axes.plot([], [], color=ORANGE, linewidth=0.9, marker=".", label="a plan, each 50 ms")
    axes.legend(loc="lower right")
    return figure


def limits() -> Figure:
    """Plans that bend along the limits of torque and speed."""
    figure = Figure(figsize=(9.6, 3.6), layout="constrained")
    position, speed, torque = figure.subplots(1, 3)
    loaded, joint = ARM.with_payload(0.2), 1
    settings = arm3dof.MpcSettings(dt=0.02, input_weight=1e-5)
    start, target = np.deg2rad([0, -40, 0]), np.deg2rad([90, 60, 40])
    plant = arm3dof.PinocchioPlant(loaded)
    recording, thoughts = drive(plant, settings, target, start=start, duration=0.8)
    study = arm3dof.MpcController(loaded, settings)
    for t, step, _ in thoughts[:30:2]:
        color = SHADES(0.92 * t / 0.6)
        look = {"color": color, "linewidth": 1.2, "zorder": 3}
        at = t + settings.dt * np.arange(len(step.plan))
        position.plot(at, np.rad2deg(target[joint] - step.plan[:, joint]), **look)
        speed.plot(at, step.plan[:, ARM.nv + joint], **look)
        here = arm3dof.JointState(t, target - step.plan[0, : ARM.nv], step.plan[0, ARM.nv :])
        planned = study.optimise(here, target).tau[:, joint]
        torque.step(at, np.append(planned, planned[-1]), where="post", **look)
    for axes, values in (
        (position, np.rad2deg(recording.q)),
        (speed, recording.v),
        (torque, recording.tau),
    ):
        held = "steps-post" if axes is torque else "default"
        axes.plot(recording.t, values[:, joint], color=PALE, lw=6, zorder=2.5, drawstyle=held)
        axes.set(xlim=(0, 0.8), xlabel="time [s]")
    position.set(title="Position of joint2", ylabel="angle [deg]", ylim=(-48, 72))
    position.axhline(60, color=SETTLED, linewidth=1.1, linestyle=(0, (2, 2)))
    say(
        position,
        0.98,
        61,
        "target",
        "right",
        color=SETTLED,
        of=("axes fraction", "data"),
        side="bottom",
    )
    speed.set(title="Its speed", ylabel="velocity [rad/s]", ylim=(-1.2, 9.2))
    limit(speed, 7.5, "limit 7.5 rad/s")
    torque.set(title="Its torque", ylabel="torque [N m]", ylim=(-2.5, 2.5))
    for sign, name in ((1, "limit 1.96 N m"), (-1, None)):
        limit(torque, sign * 1.96, name)
    say(position, 0.98, 0.06, "grey: what the arm did\ncoloured: plans, each 40 ms", "right")
    return figure


def load() -> Figure:
    """A load that nobody announced, with and without the observer."""
    figure = Figure(figsize=(8.4, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1))
    taken, released, mass = 1.5, 3.5, 0.1
    changes = [PayloadChange(taken, mass), PayloadChange(released, None)]
    for gain, color, name in ((0.0, ORANGE, "no observer"), (0.75, BLUE, "with observer")):
        plant = DisturbedPlant(arm3dof.PinocchioPlant(ARM), payloads=changes)
        settings = arm3dof.MpcSettings(observer_gain=gain)
        recording, thoughts = drive(plant, settings, duration=5.0)
        rows = slice(None, None, 5)
        height = 1000 * np.array([ARM.placement(q).translation[2] for q in recording.q[rows]])
        above.plot(recording.t[rows], height, color=color, label=name, zorder=3)
        if gain:
            at = [thought.t for thought in thoughts]
            believed = [1000 * thought.load for thought in thoughts]
            below.step(at, believed, color=color, where="post", label="believed", zorder=3)
    wanted = 1000 * ARM.placement(TARGET).translation[2]
    above.axhline(wanted, color=SETTLED, linewidth=1.1, linestyle=(0, (2, 2)), label="target")
    truth = 1000 * mass * np.array([0, 0, 1, 1, 0, 0])
    at = [0, taken, taken, released, released, 5]
    below.plot(at, truth, color=INK, linewidth=1.2, linestyle=(0, (5, 2)), label="true")
    for axes in (above, below):
        axes.axvspan(taken, released, color=COLORS[4], alpha=0.13, linewidth=0, zorder=0.4)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2)
    above.set(title="Height of the tool", ylabel="height [mm]", xlim=(0, 5))
    middle = (taken + released) / 2
    say(above, middle, 0.55, "carrying 100 g", "center", of=("data", "axes fraction"))
    below.set(title="Mass at the tool", ylabel="mass [g]", xlabel="time [s]")
    return figure


def noise() -> Figure:
    """How still an arm stands that is measured with 0.1 deg of noise."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.35, 1))
    truth = perturbed(ARM, 30, rng=np.random.default_rng(1))
    sigma, joint, since = np.deg2rad(0.1), 2, 1.5
    for place, (declared, between, color, name) in enumerate(
        (
            (0.0, False, ORANGE, "measurements believed"),
            (None, False, PINK, "filtered, one reading a sample"),
            (None, True, BLUE, "filtered, all readings"),
        )
    ):
        inner = arm3dof.PinocchioPlant(truth)
        plant = DisturbedPlant(inner, noise=sigma, rng=np.random.default_rng(2))
        settings = arm3dof.MpcSettings(measurement_noise=declared)
        show = None if between else (lambda state, target: (state, target))
        recording, _ = drive(plant, settings, duration=6.0, show=show, believed=ARM)
        late = recording.t >= since
        speed = recording.v[late, joint]
        left.plot(recording.t[late], speed - 0.3 * place, color=color, lw=1.2, zorder=3)
        left.axhspan(
            -SETTLED_SPEED - 0.3 * place, SETTLED_SPEED - 0.3 * place, color=SETTLED_BAND, lw=0
        )
        say(left, since + 0.05, 0.12 - 0.3 * place, name, "left", of="data", color=color)
        fastest = np.sort(np.abs(recording.v[late]).max(axis=1))
        right.plot(fastest, np.linspace(0, 100, fastest.size), color=color, label=name, zorder=3)
    left.set(xlim=(since, 6), ylim=(-0.75, 0.2), xlabel="time [s]", yticks=[])
    left.set_title("True speed of joint3 on its target; bands: ±0.05 rad/s")
    right.axvspan(0, SETTLED_SPEED, color=SETTLED_BAND, lw=0, zorder=0.5)
    right.set(
        xlim=(0, 0.15),
        ylim=(0, 101),
        xticks=(0, 0.05, 0.1, 0.15),
        xlabel="speed of the fastest joint [rad/s]",
    )
    right.set(ylabel="share of the time below it [%]", title="How still the arm stands")
    return figure


def delay() -> Figure:
    """A delay of one sample that the controller knows of, or does not."""
    figure = Figure(figsize=(8.4, 3.9), layout="constrained")
    axes = figure.subplots()
    for late, told, color, dashes, name in (
        (0.0, 0.0, SOFT, (0, (4, 2)), "no delay"),
        (0.05, 0.05, BLUE, "-", "delay declared"),
        (0.05, 0.0, ORANGE, "-", "delay not declared"),
    ):
        plant = DisturbedPlant(arm3dof.PinocchioPlant(ARM), delay=late)
        settings = arm3dof.MpcSettings(input_weight=1e-3, delay=told)
        recording, _ = drive(plant, settings, duration=3.0)
        settled = arm3dof.summarise(recording).settling_time
        name += f": {settled:.2f} s" if settled else ": never"
        error = np.rad2deg(recording.e[:, 1])
        axes.plot(recording.t, error, color=color, linestyle=dashes, label=name, zorder=3)
    band(axes)
    axes.set(xlim=(0, 3), ylim=(-75, 75), xlabel="time [s]", ylabel="error of joint2 [deg]")
    axes.set_title("Time to settle when torques act 50 ms late")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def weights() -> Figure:
    """What the weights do to the motion, and what speed costs."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    chosen = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
    for place, weight in enumerate(chosen):
        settings = arm3dof.MpcSettings(input_weight=weight)
        recording, _ = drive(arm3dof.PinocchioPlant(ARM), settings, duration=2.5)
        name = f"R = {weight:.0e}".replace("e-0", "e-") + f",  w = {weight**-0.25:.1f} rad/s"
        color = SHADES(0.84 * place / (len(chosen) - 1))
        left.plot(recording.t, np.rad2deg(recording.e[:, 1]), color=color, label=name, zorder=3)
    band(left)
    left.set(xlim=(0, 2.5), xlabel="time [s]", ylabel="error of joint2 [deg]")
    left.set_title("The input weight sets the pace")
    left.legend(loc="upper right")
    families = (
        (default_points()[:9], BLUE, "o", "input weight R"),
        (sweep_points([Vary.parse("velocity_weight=1e-3:0.1:6")]), PINK, "s", "velocity weight"),
    )
    for family, color, mark, name in families:
        result = sweep(ARM, family)
        energy, settling = result.column("energy_j"), result.column("settling_time_s")
        right.plot(energy, settling, mark + "-", color=color, lw=1.3, ms=5, label=name, zorder=3)
        for row in (0, len(family) - 1):
            text, at = family[row].label, (energy[row], settling[row])
            right.annotate(text, at, (7, 5), textcoords="offset points", color=color, fontsize=8.5)
    right.margins(0.1)
    right.set(xlabel="energy, integral of |τ · v| [J]", ylabel="settling time [s]", ylim=(0, None))
    right.set_title("Speed against energy")
    right.legend(loc="upper right")
    return figure


def path() -> Figure:
    """A circle in space, seen coming or chased."""
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.35))
    share = np.linspace(0, 1, 61)
    angle = 2 * np.pi * (share - np.sin(2 * np.pi * share) / (2 * np.pi))  # at rest at both ends
    circle = np.stack([0 * angle + 0.17, 0.06 * np.cos(angle), 0.06 + 0.06 * np.sin(angle)], axis=1)
    ahead = cartesian_path(ARM, circle, 2.5 * share)

    def present(state: arm3dof.JointState, target: Target) -> tuple[arm3dof.JointState, Target]:
        return state, ahead.sample([state.t]).q[0]

    left.plot(1000 * circle[:, 1], 1000 * circle[:, 2], color=INK, lw=1, ls=(0, (4, 2)))
    for looks, color, name in (
        (False, ORANGE, "chasing its present point"),
        (True, BLUE, "seeing it coming"),
    ):
        settings = arm3dof.MpcSettings(input_weight=1e-5)
        plant = arm3dof.PinocchioPlant(ARM)
        show = None if looks else present
        recording, _ = drive(plant, settings, ahead, start=ahead.q[0], duration=2.5, show=show)
        tool, wanted = tools(recording.q), tools(recording.q + recording.e)
        left.plot(*tool[50::50, 1:].T, "o", color=color, zorder=4)
        miss = np.linalg.norm(tool - wanted, axis=1)
        name += f": up to {miss.max():.1f} mm"
        right.plot(recording.t[::5], miss, color=color, label=name, zorder=3)
    left.plot(*wanted[50::50, 1:].T, "o", ms=11, mfc="none", color=INK, zorder=3)
    say(
        left,
        0.5,
        0.52,
        "rings: where the tool should be,\neach 0.25 s; dots: where it is",
        "center",
    )
    left.set(xlabel="y [mm]", ylabel="z [mm]", title="A circle in 2.5 s", aspect="equal")
    left.margins(0.06)
    right.set(xlim=(0, 2.5), ylim=(0, 42), xlabel="time [s]", ylabel="distance [mm]")
    right.set_title("Distance from where it should be")
    right.legend(loc="upper left")
    return figure


def fallback() -> Figure:
    """Encoders that fall silent in the middle of a move."""
    figure = Figure(figsize=(8.4, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    silent, back = 0.2, 0.6

    def show(state: arm3dof.JointState, target: Target) -> tuple[arm3dof.JointState, Target]:
        if not silent <= state.t < back:
            return state, target
        nothing = np.full(state.q.size, np.nan)
        return arm3dof.JointState(state.t, nothing, nothing), target

    settings = arm3dof.MpcSettings()
    recording, thoughts = drive(arm3dof.PinocchioPlant(ARM), settings, duration=1.6, show=show)
    for joint, name in enumerate(ARM.joint_names):
        look = {"color": COLORS[joint], "label": name, "zorder": 3}
        above.plot(recording.t, np.rad2deg(recording.q[:, joint]), **look)
        below.plot(recording.t, recording.tau[:, joint], drawstyle="steps-post", **look)
        above.axhline(np.rad2deg(TARGET[joint]), color=COLORS[joint], lw=0.9, ls=(0, (2, 2)))
    sources = arm3dof.TorqueSource
    shades = {sources.PREVIOUS_PLAN: COLORS[4], sources.BRAKING: COLORS[3]}
    for source, color in shades.items():
        at = [thought.t for thought in thoughts if thought.step.source is source]
        for axes in (above, below):
            axes.axvspan(at[0], at[-1] + settings.dt, color=color, alpha=0.16, lw=0, zorder=0.4)
        words = {sources.PREVIOUS_PLAN: "last plan", sources.BRAKING: "braking"}[source]
        middle = (at[0] + at[-1] + settings.dt) / 2
        say(above, middle, 0.96, words, "center", of=("data", "axes fraction"))
    for sign, name in ((1, "limit ±1.96 N m"), (-1, None)):
        limit(below, sign * 1.96, name)
    above.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3, borderaxespad=0.2)
    above.set(title="No measurement from 0.2 s to 0.6 s", ylabel="angle [deg]", xlim=(0, 1.6))
    below.set(ylabel="torque [N m]", xlabel="time [s]", ylim=(-2.5, 2.6))
    return figure


# ---- their parts -------------------------------------------------------------------------------


def tools(q: Array) -> Array:
    """Return the tool's place for each fifth configuration, shape (k, 3) [mm]."""
    return 1000 * np.array([ARM.placement(row).translation for row in q[::5]])


def band(axes: Axes) -> None:
    """Draw where an error counts as none."""
    settled = float(np.rad2deg(SETTLED_ERROR))
    axes.axhspan(-settled, settled, color=SETTLED_BAND, linewidth=0, zorder=0.5)
    axes.axhline(0, color=SOFT, linewidth=0.8, zorder=1)


def limit(axes: Axes, value: float, name: str | None) -> None:
    """Draw a limit and its name."""
    axes.axhline(value, color=LIMIT, linewidth=1.1, linestyle=(0, (6, 3)), zorder=2)
    if name:
        of = ("axes fraction", "data")
        say(axes, 0.985, value, name, "right", of=of, color=LIMIT, side="bottom")


def say(
    axes: Axes,
    x: float,
    y: float,
    text: str,
    align: Literal["left", "center", "right"],
    *,
    of: str | tuple[str, str] = "axes fraction",
    color: str = SOFT,
    side: Literal["bottom", "top", "center"] = "center",
) -> None:
    """Write a remark into a figure."""
    lift = {"bottom": 3, "top": -3, "center": 0}[side]
    axes.annotate(
        text,
        (x, y),
        (0, lift),
        xycoords=of,
        textcoords="offset points",
        color=color,
        fontsize=8.5,
        ha=align,
        va=side,
        zorder=6,
    )


FIGURES: dict[str, Callable[[], Figure]] = {
    "plans": plans,
    "limits": limits,
    "load": load,
    "noise": noise,
    "delay": delay,
    "fallback": fallback,
    "weights": weights,
    "path": path,
}


def main() -> None:
    """Write docs/images/mpc_*.png."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        with mpl.rc_context(dict(STYLE)):
            data = png(draw())
        file = IMAGES / f"mpc_{name}.png"
        write_atomically(file, data)
        print(f"wrote {file}, {len(data) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
