"""What every open page is told many times a second: numbers as JSON, pictures as JPEG.

Messages are bytes on one websocket; the first byte says what follows: ``N`` numbers, ``P`` the
picture, ``M`` its mask, ``F`` why nothing more will come. Pictures do not come by a request of
their own, for a browser keeps no more than six connections to a server, and three tabs with two
endless pictures would be stuck.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np

from arm3dof.model.kinematics import inverse_kinematics
from arm3dof.model.robot import Robot
from arm3dof.runtime.live.frames import Frames
from arm3dof.sim.world import COLOURS
from arm3dof.state import Array
from arm3dof.ui.studio.status import describe, has_arrived
from arm3dof.vision.locate import Located

NUMBERS, PICTURE, MASK, FAILURE = b"N", b"P", b"M", b"F"
_THINNED = 2  # of the frames, one in so many is drawn in the charts


def numbers_message(
    frames: Frames,
    robot: Robot,
    late: Mapping[str, float],
    extra: Mapping[str, object],
    blind: str = "",
) -> bytes:
    """Return what the frames since the last message say.

    Args:
        frames: new frames, shape (n,), at least one.
        robot: the arm that they are of.
        late: percentiles of how late the arm woke of late [s].
        extra: what else is to be told, by name.
        blind: why there are no pictures; empty while there are.
    """
    last = frames[-1]
    rows = frames[::-_THINNED][::-1]
    planned = int(last["plan_rows"])
    status = describe(last, robot, blind)
    controlled = frames[frames["control"] == 1]
    message = {
        "t": _round(rows["t"], 4),
        "e": _round(rows["q_target"] - rows["q"], 5),
        "v": _round(rows["v"], 4),
        "u": _round(rows["u"], 3),
        "tau": _round(rows["tau"], 4),
        "q": last["q"].tolist(),  # exact, to be compared with what the 3-D view shows
        "q_target": _round(last["q_target"], 5),
        "tool": _round(last["tool"], 5),
        "gravity": _round(last["gravity"], 4),
        "plan_t": _round(last["plan_t"][:planned], 3),
        "plan_e": _round(last["q_target"] - last["plan_q"][:planned], 5),
        "plan_v": _round(last["plan_v"][:planned], 4),
        "step_us": _round(1e6 * controlled["step_time"], 0),
        "energy": round(float(last["energy"]), 4),
        "load": round(float(last["load"]), 3),
        "mode": int(last["mode"]),
        "paused": bool(last["paused"]),
        "run": int(last["run"]),
        "arrived": has_arrived(last),
        "status": status.text,
        "tone": status.tone,
        "blind": blind,
        "missed": int(last["missed"]),
        "late_ms": {k: round(1e3 * v, 3) for k, v in late.items()},
        **extra,
    }
    return NUMBERS + json.dumps(message, separators=(",", ":")).encode()


def seen(located: Sequence[Located], robot: Robot) -> list[dict[str, object]]:
    """Return what was located, and whether the arm reaches it, as plain values.

    Args:
        located: the objects.
        robot: the arm.
    """
    return [
        {
            "name": found.target,
            "point": _round(found.p_base, 4),
            "depth": round(found.depth_m, 4),
            "sigma": round(found.depth_sigma_m, 5),
            "reach": inverse_kinematics(robot, found.p_base).reachable,
            "colour": _css(found.target),
            "pixel": _middle(found.box_px),
        }
        for found in located
    ]


def _middle(box: tuple[int, int, int, int]) -> list[int]:
    left, top, width, height = box
    return [left + width // 2, top + height // 2]


def _css(name: str) -> str:
    """Return a colour that goes with an object's name."""
    rgb = COLOURS.get(name, (0.55, 0.36, 0.64))
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def _round(values: Array, digits: int) -> object:
    return np.round(np.nan_to_num(values), digits).tolist()
