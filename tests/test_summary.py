"""Answers as JSON."""

import json
import math
from enum import Enum
from pathlib import Path

import numpy as np

from arm3dof.ui.summary import run_report, to_json


class Colour(Enum):
    RED = "red"


def test_everything_becomes_plain_json():
    report = {
        "array": np.array([[1.0, 2.0], [3.0, np.nan]]),
        "number": np.float64(0.5),
        "count": np.int64(3),
        "flag": np.bool_(True),
        "nothing": None,
        "enum": Colour.RED,
        "path": Path("out/run.npz"),
        "pair": (1, "two"),
        "infinite": math.inf,
        7: {"nested": [math.nan]},
    }
    assert json.loads(to_json(report)) == {
        "array": [[1.0, 2.0], [3.0, None]],
        "number": 0.5,
        "count": 3,
        "flag": True,
        "nothing": None,
        "enum": "red",
        "path": "out/run.npz",
        "pair": [1, "two"],
        "infinite": None,
        "7": {"nested": [None]},
    }


def test_a_run_that_did_not_happen_has_no_figures():
    report = run_report(None)
    assert report.pop("settled") is False
    assert report.pop("files") == []
    assert set(report.values()) == {None}
