"""Many independent runs over the cores, that stop cleanly on Ctrl-C."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing.process import BaseProcess
from typing import TypeVar

from arm3dof.errors import ArmError, InputError
from arm3dof.model.build import robot_from_description
from arm3dof.model.robot import Description, Robot

Task = TypeVar("Task")
Result = TypeVar("Result")

Progress = Callable[[int, int], None]
"""Called with the number of finished runs and of all runs."""


@dataclass(frozen=True)
class PackedRobot:
    """A robot as text, to be sent to another process and built there once.

    Attributes:
        description: its ``Description`` as JSON.
        tool_frame: the frame that is brought to a target.
    """

    description: str
    tool_frame: str

    @staticmethod
    def of(robot: Robot) -> PackedRobot:
        """Pack a robot."""
        return PackedRobot(json.dumps(robot.description.to_dict()), robot.tool_frame)

    def unpack(self) -> Robot:
        """Return the robot; in one process always the same one."""
        return _unpacked(self)


@lru_cache(maxsize=2)
def _unpacked(packed: PackedRobot) -> Robot:
    description = Description.from_dict(json.loads(packed.description))
    return robot_from_description(description, tool_frame=packed.tool_frame)


def core_count() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_all(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    *,
    workers: int = 1,
    progress: Progress | None = None,
) -> Iterator[tuple[int, Result]]:
    """Yield the index and the result of each task, in the order in which they are finished.

    When the caller stops early, by Ctrl-C for instance, tasks that have not begun are dropped.

    Args:
        function: what is done; for more than one worker it lies at the top of a module.
        tasks: its arguments.
        workers: number of processes; 1 works in this process. Each of several imports the main
            module anew, so a script that asks for them needs ``if __name__ == "__main__"``.
        progress: told of each finished task.

    Raises:
        InputError: ``workers`` is not positive.
        ArmError: a worker process has died.
    """
    if workers < 1:
        raise InputError(f"workers is {workers}; give 1 or more processes")
    total = len(tasks)
    if min(workers, total) <= 1:
        for index, task in enumerate(tasks):
            yield index, function(task)
            _tell(progress, index + 1, total)
        return
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(
        min(workers, total), mp_context=context, initializer=_end_with_parent
    )
    try:
        futures = _start(executor, function, tasks)
        for done, future in enumerate(as_completed(futures), start=1):
            yield futures[future], future.result()
            _tell(progress, done, total)
    except BrokenProcessPool:
        raise ArmError(
            "a worker process was ended from outside (out of memory?); ask for fewer workers"
        ) from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _start(
    executor: ProcessPoolExecutor, function: Callable[[Task], Result], tasks: Sequence[Task]
) -> dict[Future[Result], int]:
    """Hand out the tasks; the workers leave Ctrl-C to this process, which then stops them."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return {executor.submit(function, task): index for index, task in enumerate(tasks)}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _end_with_parent() -> None:
    """End this worker when the process that it works for is gone, however that was ended.

    The pool's own pipes do not tell: every worker holds both of their ends.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(process: BaseProcess) -> None:
    process.join()
    os._exit(1)  # nobody waits for what this one does


def _tell(progress: Progress | None, done: int, total: int) -> None:
    if progress is not None:
        progress(done, total)
