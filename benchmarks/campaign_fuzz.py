"""Hostile control steps: every torque finite and inside its limits, every status right."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from arm3dof import JointState, MpcController, MpcSettings, load_robot
from arm3dof.control.step import ControlStatus, ControlStep, TorqueSource
from arm3dof.errors import InputError
from arm3dof.model.robot import Limits, Robot
from arm3dof.model.uncertainty import perturbed
from arm3dof.state import Array
from benchmarks.tables import Table

_TORQUE_TOLERANCE = 1e-9  # [N m]
_SAME_TORQUE = 1e-6  # [N m]
_STEPS = 100  # hostile steps that one controller lives through

FORMULATIONS = ("tracking", "torque", "paper")
VARIANTS = {
    "default": {},
    "torque rate": {"torque_rate": 5.0},
    "blocks": {"blocks": (1, 1, 2, 4, 12)},
    "delay": {"delay": 0.08},
    "one stage": {"horizon": 1},
    "iteration cap 1": {"max_iterations": 1},
    "no weights": {"state_weight": (0, 0), "input_weight": 0, "terminal_weight": (0, 0)},
    "deadline": {"max_step_time": 2e-4},
}
ARMS = ("as described", "weak", "two joints without torque", "no torque", "no speed", "no range")
STATES = (
    "good",
    "follows the last",
    "outside the range",
    "too fast",
    "absurd",
    "position NaN or infinite",
    "velocity NaN or infinite",
    "wrong shape",
)
TARGETS = ("inside the range", "far outside", "NaN or infinite", "absurd", "wrong shape")


@dataclass
class Tally:
    """What a campaign counted.

    Attributes:
        steps: hostile steps.
        violations: how often each thing happened that must not, by its name.
        examples: the first few of them, in words that find them again.
        statuses: how often each status and source was given.
        good: how often good states got each status, by arm.
        compared: good steps that were compared with a fresh controller's.
        apart: largest difference of torque to the fresh controller [N m].
        times: wall time of every step [s].
    """

    steps: int = 0
    violations: Counter[str] = field(default_factory=Counter)
    examples: list[str] = field(default_factory=list)
    statuses: Counter[str] = field(default_factory=Counter)
    good: Counter[str] = field(default_factory=Counter)
    compared: int = 0
    apart: float = 0.0
    times: list[float] = field(default_factory=list)

    def blame(self, what: str, where: str) -> None:
        """Note a violation."""
        self.violations[what] += 1
        if len(self.examples) < 20:
            self.examples.append(f"{what}: {where}")

    def add(self, other: Tally) -> None:
        """Add another part of the campaign."""
        self.steps += other.steps
        self.violations += other.violations
        self.examples = (self.examples + other.examples)[:20]
        self.statuses += other.statuses
        self.good += other.good
        self.compared += other.compared
        self.apart = max(self.apart, other.apart)
        self.times += other.times


def run_fuzz(task: tuple[int, range]) -> Tally:
    """Let some controllers live through hostile steps: seed, and which controllers."""
    seed, indices = task
    tally = Tally()
    with np.errstate(all="ignore"):  # absurd states overflow where this module makes them
        for index in indices:
            _torment(seed, index, tally)
    return tally


def controllers(steps: int) -> int:
    """Return how many controllers live through so many steps in all."""
    return -(-steps // _STEPS)


def summary(tally: Tally) -> dict[str, object]:
    """Return what a campaign found."""
    shares = (50, 90, 99, 99.9, 100)
    times = np.percentile(tally.times, shares)
    return {
        "steps": tally.steps,
        "violations": dict(tally.violations),
        "examples": tally.examples,
        "statuses": dict(tally.statuses),
        "good_states": dict(sorted(tally.good.items())),
        "compared_with_fresh": tally.compared,
        "largest_difference_nm": tally.apart,
        "step_time_us": {
            f"p{share}": round(1e6 * time, 1) for share, time in zip(shares, times, strict=True)
        },
    }


def table(found: dict[str, object]) -> Table:
    """Return the table of a campaign."""
    violations = found["violations"]
    time = found["step_time_us"]
    rows = [
        (name, f"{violations.get(name, 0):,}")
        for name in (
            "torque not finite",
            "torque beyond its limit",
            "wrong status",
            "exception",
            "wrong shape accepted",
            "differs from a fresh controller",
        )
    ]
    rows.append(
        ("good steps compared with a fresh controller's", f"{found['compared_with_fresh']:,}")
    )
    rows.append(("largest difference of torque [N m]", f"{found['largest_difference_nm']:.1e}"))
    rows += [(f"step time {name} [us]", f"{value:,.0f}") for name, value in time.items()]
    rows += [(f"answered: {name}", f"{count:,}") for name, count in found["statuses"].items()]
    rows += [(f"good state, {name}", f"{count:,}") for name, count in found["good_states"].items()]
    return Table(
        f"{found['steps']:,} hostile control steps",
        ("what", "count"),
        rows,
        "States outside every limit, NaN, infinity and 1e200, targets that jump, arms without "
        "torque, speed or range, changing payloads and masses, one iteration, no weights, a "
        "missed deadline; all formulations, with and without torque rate, blocks and delay. "
        "Good steps are compared where they follow from nothing before, nothing has been learned "
        "about the load, and no earlier command counts (no delay, no torque rate), "
        "and a fresh controller finds an optimum; without one the last plan bridges the gap.",
    )


@lru_cache(maxsize=64)
def _arm(name: str, load: int) -> Robot:
    """Return one of the arms; ``load`` chooses its payload and the errors of its masses."""
    robot = load_robot("arm3dof")
    if load:
        robot = perturbed(robot, 30, rng=np.random.default_rng(load)).with_payload(0.05 * load)
    limits = robot.limits
    none = np.zeros(robot.nv)
    changed = {
        "as described": {},
        "weak": {"tau_max": 0.4 * limits.tau_max},
        "two joints without torque": {"tau_max": np.array([0.0, 1.96, 0.0])},
        "no torque": {"tau_max": none},
        "no speed": {"v_max": none},
        "no range": {"q_min": none + 0.3, "q_max": none + 0.3},
    }[name]
    known = {key: getattr(limits, key) for key in ("q_min", "q_max", "v_max", "tau_max")}
    return Robot(
        robot.model,
        limits=Limits(**{**known, **changed}),
        tool_frame=robot.tool_frame,
        damping=robot.damping,
        friction=robot.friction,
        description=robot.description,
    )


def _torment(seed: int, index: int, tally: Tally) -> None:
    """Let one controller live through hostile steps, and compare good ones with fresh ones."""
    rng = np.random.default_rng([seed, index])
    combinations = list(itertools.product(FORMULATIONS, VARIANTS, ARMS))
    formulation, variant, arm = combinations[index % len(combinations)]
    where = f"controller {index} ({formulation}, {variant}, arm {arm})"
    settings = MpcSettings(formulation=formulation, **VARIANTS[variant])
    load = int(rng.integers(4))
    robot = _arm(arm, load)
    controller = MpcController(robot, settings)
    state = JointState(0.0, robot.random_configuration(rng), np.zeros(robot.nv))
    for step in range(_STEPS):
        if rng.random() < 0.1:  # another payload: another plant, and a controller that is told
            load = int(rng.integers(4))
            robot = _arm(arm, load)
            controller = MpcController(robot, settings)
        kind, aim = rng.choice(STATES), rng.choice(TARGETS, p=(0.6, 0.1, 0.1, 0.1, 0.1))
        state = _state(kind, state, robot, rng)
        at = f"{where}, step {step}, state {kind}, target {aim}"
        _hostile_step(controller, state, _target(aim, robot, rng), kind, aim, at, tally)
        if rng.random() < 0.2 and variant not in ("iteration cap 1", "deadline"):
            state = _good_step(controller, robot, settings, arm, rng, at, tally)


def _hostile_step(
    controller: MpcController,
    state: JointState,
    target: Array,
    kind: str,
    aim: str,
    at: str,
    tally: Tally,
) -> None:
    tally.steps += 1
    malformed = "wrong shape" in (kind, aim)
    try:
        step = controller.step(state, target)
    except InputError:
        if not malformed:
            tally.blame("exception", f"InputError, {at}")
        return
    except Exception as error:  # noqa: BLE001 - whatever is raised is a violation, to be counted
        tally.blame("exception", f"{error!r}, {at}")
        return
    if malformed:
        tally.blame("wrong shape accepted", at)
        return
    tally.times.append(step.solve_time)
    tally.statuses[f"{step.status.name}, {step.source.name}"] += 1
    _judge_torque(step, controller.robot, at, tally)
    if step.status not in _expected(state, target, controller.robot):
        tally.blame("wrong status", f"{step.status.name}, {at}")


def _judge_torque(step: ControlStep, robot: Robot, at: str, tally: Tally) -> None:
    if not (np.isfinite(step.tau).all() and np.isfinite(step.u).all()):
        tally.blame("torque not finite", at)
    elif (np.abs(step.tau) > robot.limits.tau_max + _TORQUE_TOLERANCE).any():
        tally.blame("torque beyond its limit", at)


def _expected(state: JointState, target: Array, robot: Robot) -> set[ControlStatus]:
    """Return the statuses that are right, by the words of the manual rather than by the code."""
    limits, status = robot.limits, ControlStatus
    turn = 2 * np.pi
    inside = (state.q >= limits.q_min - turn) & (state.q <= limits.q_max + turn)
    if not (state.is_finite and (inside & (np.abs(state.v) <= 10 * limits.v_max)).all()):
        return {status.BAD_MEASUREMENT}
    if not np.isfinite(target).all():
        return {status.BAD_TARGET}
    return {status.SOLVED, status.SOFTENED, status.NOT_SOLVED, status.DEADLINE_MISSED}


def _good_step(
    controller: MpcController,
    robot: Robot,
    settings: MpcSettings,
    arm: str,
    rng: np.random.Generator,
    at: str,
    tally: Tally,
) -> JointState:
    """Compare the torque in a good state that does not follow from the last with a fresh one's."""
    q = 0.3 * rng.normal(size=robot.nv) + robot.random_configuration(rng)
    q = np.clip(q, robot.limits.q_min, robot.limits.q_max)
    speed = np.minimum(0.5, robot.limits.v_max)
    state = JointState(0.0, q, speed * rng.uniform(-1, 1, robot.nv))
    target = robot.random_configuration(rng)
    learned = controller.observer.disturbance.any() or controller.observer.estimator.mass_error != 0
    sent = controller.settings.delay > 0 or controller.settings.torque_rate is not None
    after, fresh = (
        controller.step(state, target),
        MpcController(robot, settings).step(state, target),
    )
    _judge_torque(after, robot, at, tally)
    tally.good[f"arm {arm}: {after.status.name}"] += 1
    if not controller.observer.jumped or learned or sent:
        return state  # what acted before, and what was learned, rightly matters
    if after.status is not fresh.status:
        names = f"{after.status.name} for {fresh.status.name}"
        tally.blame("differs from a fresh controller", f"{names}, {at}")
    if fresh.source is not TorqueSource.OPTIMUM:
        return state  # no plan was rebuilt; the earlier one rightly bridges the gap
    tally.compared += 1
    apart = float(np.abs(after.tau - fresh.tau).max())
    tally.apart = max(tally.apart, apart)
    if apart > _SAME_TORQUE:
        tally.blame("differs from a fresh controller", f"{apart:.2e} N m, {at}")
    return state


def _state(kind: str, last: JointState, robot: Robot, rng: np.random.Generator) -> JointState:
    nv = robot.nv
    q, v = robot.random_configuration(rng), rng.normal(size=nv)
    broken = rng.choice([np.nan, np.inf, -np.inf])
    if kind == "follows the last" and last.is_finite and last.q.size == nv:
        v = last.v + 0.05 * rng.normal(size=nv)
        q = last.q + 0.025 * (last.v + v) + 0.005 * rng.normal(size=nv)
    elif kind == "outside the range":
        q = q + 3 * rng.normal(size=nv)
    elif kind == "too fast":
        v = 20 * v
    elif kind == "absurd":
        q, v = q * 10 ** rng.uniform(0, 200), v * 10 ** rng.uniform(0, 200)
    elif kind == "position NaN or infinite":
        q[rng.integers(nv)] = broken
    elif kind == "velocity NaN or infinite":
        v[rng.integers(nv)] = broken
    elif kind == "wrong shape":
        q, v = q[:-1], v[:-1]
    return JointState(last.t + 0.05, q, v)


def _target(aim: str, robot: Robot, rng: np.random.Generator) -> Array:
    target = robot.random_configuration(rng)
    if aim == "far outside":
        return target + 10 * rng.normal(size=robot.nv)
    if aim == "NaN or infinite":
        target[rng.integers(robot.nv)] = rng.choice([np.nan, np.inf, -np.inf])
    elif aim == "absurd":
        return target * 10 ** rng.uniform(0, 200)
    elif aim == "wrong shape":
        return np.append(target, 0.0)
    return target
