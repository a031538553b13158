"""The replay as one file: complete, small, without a word to the network, whole or not at all."""

from __future__ import annotations

import base64
import gzip
import re
from pathlib import Path

import msgpack
import pytest
from runs import smooth_run

import arm3dof.ui.page as page
from arm3dof.errors import InputError, MissingFile
from arm3dof.files import write_atomically
from arm3dof.model.library import load_robot
from arm3dof.runtime.recording import Recording
from arm3dof.ui.report import replay_html, write_replay

LIMIT = 5_000_000  # bytes


@pytest.fixture(scope="module")
def run() -> Recording:
    return smooth_run(load_robot(), duration=6.0)


def scene_of(html: str) -> list[dict[str, object]]:
    data = re.search(r'id="embedded-scene"[^>]*>([^<]*)<', html)[1]
    return msgpack.unpackb(gzip.decompress(base64.b64decode(data)))["commands"]


def test_the_file_holds_the_run_and_is_small(run: Recording, tmp_path: Path) -> None:
    path = write_replay(run, tmp_path / "out" / "replay.html")
    assert path.stat().st_size < 1_500_000
    html = path.read_text(encoding="utf-8")
    kinds = [command["type"] for command in scene_of(html)]
    assert kinds.count("replay") == 1
    assert kinds.index("replay") == len(kinds) - 1
    caption = next(each for each in scene_of(html) if each["type"] == "caption")
    assert caption["verdict"].startswith("Settled in ")
    assert "<title>arm3dof replay</title>" in html
    assert list(path.parent.iterdir()) == [path]


def test_it_asks_nothing_of_the_network(run: Recording) -> None:
    html = replay_html(run)
    own = html.replace(page.viewer_script(), "")
    assert not re.findall(r"https?://", own)
    assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(?!data:)', own)
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', own)[1]
    assert policy.startswith("default-src 'none'; script-src 'unsafe-inline'")
    assert "connect-src" not in policy


def test_the_same_run_is_the_same_file(run: Recording) -> None:
    assert replay_html(run) == replay_html(run)


@pytest.mark.parametrize("name", ["so101", pytest.param("panda", marks=pytest.mark.slow)])
def test_heavy_robots_and_long_runs_stay_small(name: str) -> None:
    robot = load_robot(name)
    start = robot.limits.q_min / 2 + robot.limits.q_max / 2
    run = smooth_run(robot, start=start, target=start + 0.3, duration=60, dt=0.02)
    assert len(replay_html(run).encode()) < LIMIT


def test_a_folder_that_cannot_be_written_is_named(run: Recording, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"replay\.html: cannot be written"):
        write_replay(run, tmp_path / "file" / "replay.html")


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.txt"
    write_atomically(path, b"old")

    def fail(self: Path, target: Path) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_viewer_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    page.viewer_script.cache_clear()
    monkeypatch.setattr(page.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingFile, match="run: pip install meshcat"):
        page.viewer_script()
    monkeypatch.undo()
    assert len(page.viewer_script()) > 500_000


@pytest.mark.parametrize("title", ["<b>&\"'", "{{scripts}}", "\\1"])
def test_titles_are_text(title: str) -> None:
    html = page.live_page(title)
    assert "<b>" not in html
    assert html.count("<script") == 1 + len(page._SCENE)  # MeshCat and the 3-D view
