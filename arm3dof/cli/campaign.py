"""``arm3dof campaign``: one trial many times over, and how often it succeeds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from arm3dof.cli import output
from arm3dof.cli.compare import Workers
from arm3dof.cli.options import JsonFlag, writable
from arm3dof.cli.progress import counted
from arm3dof.runtime.campaign import Campaign, Trial, run_campaign
from arm3dof.runtime.parallel import core_count

if TYPE_CHECKING:
    from arm3dof.runtime.see_trial import SeeTrial

campaign = typer.Typer(
    help="Try something many times over and count how often it succeeds.", no_args_is_help=True
)

Trials = Annotated[int, typer.Option("--n", metavar="N", min=1, help="Number of trials.")]
Seed = Annotated[
    int, typer.Option(metavar="S", min=0, help="Decides what is random in all of the trials.")
]
Only = Annotated[
    list[int] | None,
    typer.Option(
        "--trial",
        metavar="K",
        min=0,
        help="Run this one of the trials alone, by its number. Repeatable.",
        show_default=False,
    ),
]
Folder = Annotated[
    Path,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the journals, by which campaigns are resumed."
    ),
]
OUT = Path("out/campaign")


@campaign.command()
def see(
    n: Trials = 1000,
    seed: Seed = 0,
    renderer: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Who takes the pictures. drawn: cast rays; physics: MuJoCo's camera.",
        ),
    ] = "drawn",
    only: Only = None,
    workers: Workers = None,
    folder: Folder = OUT,
    as_json: JsonFlag = False,
) -> int:
    """Look at random tables, and say how much is seen and how far off.

    Light from 0.3 to 2 times what the picture wants, shadows, clutter, noise, objects 0.15 to
    0.6 m away. The answer is no when it misses its goals: recall of 99 %, no false object, a median
    error of 3 mm, 8 mm at the 95th percentile, and a stated 90 % interval that holds in 85 to 95 %.
    With --trial only whether those trials succeed counts, and their pictures are written too.
    """
    from arm3dof.runtime.see_trial import SeeTrial, goals, see_report

    trial = SeeTrial(renderer)
    done = run("see", trial, n, seed, only=only, workers=workers, folder=folder)
    report = see_report(done)
    met = {} if only else goals(report)
    if only:
        report["files"] = [str(it) for it in _write_pictures(trial, seed, only, folder)]

    def show(console: Console) -> None:
        console.print(
            f"[bold]{report['objects']}[/] objects, recall {100 * report['recall']:.1f} %, "
            f"{report['false_objects']} false"
        )
        if report["median_error_m"] is not None:
            console.print(
                f"off by {1000 * report['median_error_m']:.1f} mm at the median, "
                f"{1000 * report['p95_error_m']:.1f} mm at the 95th percentile; the stated 90 % "
                f"interval holds in {100 * report['coverage_90']:.1f} %"
            )
        for name, reached in met.items():
            console.print(f"  {'[green]reached[/]' if reached else '[red]missed [/]'} {name}")

    report["goals"] = met
    yes = all(met.values()) if met else done.success_rate == 1
    return finish(done, report, as_json=as_json, yes=yes, details=show)


def run(
    name: str,
    trial: Trial,
    n: int,
    seed: int,
    *,
    only: list[int] | None,
    workers: int | None,
    folder: Path,
) -> Campaign:
    """Run a campaign over the cores with a progress bar, resumed from its journal.

    Args:
        name: names the journal.
        trial: the trial.
        n: how many.
        seed: decides what is random.
        only: numbers of the trials to run; all without it.
        workers: number of processes; one a core without it.
        folder: where the journal is.
    """
    writable(folder)
    with counted(f"campaign {name}", "trials") as progress:
        return run_campaign(
            trial,
            n,
            seed,
            only=only or (),
            journal=folder / f"{name}.jsonl",
            workers=workers or core_count(),
            progress=progress,
        )


def finish(
    done: Campaign,
    report: dict[str, Any],
    *,
    as_json: bool,
    yes: bool,
    details: Callable[[Console], None],
) -> int:
    """Print what came of a campaign and return the exit code.

    Args:
        done: the campaign.
        report: its report, with what this campaign adds.
        as_json: print ``report`` alone, as JSON.
        yes: whether the campaign's goals are met.
        details: prints for people what this campaign adds.
    """

    def show(console: Console) -> None:
        share, total = 100 * done.success_rate, len(done.outcomes)
        console.print(
            f"[bold]{done.successes} of {total}[/] trials succeeded ({share:.1f} %) "
            f"in {done.wall_s:.1f} s"
            + (f", {done.reused} of them taken from the journal" if done.reused else "")
        )
        details(console)
        for number, reason in done.failures:
            console.print(f"  [yellow]trial {number}[/] ", end="")
            console.print(reason, markup=False)

    return output.deliver(report, as_json=as_json, show=show, yes=yes)


def _write_pictures(trial: SeeTrial, seed: int, numbers: list[int], folder: Path) -> list[Path]:
    from arm3dof.runtime.campaign import trial_rng
    from arm3dof.vision.annotate import annotate
    from arm3dof.vision.locate import look
    from arm3dof.vision.sources import write_image

    files = []
    for number in numbers:
        rng = trial_rng(seed, number)
        table = trial.scene(rng)
        picture = trial.picture(table, rng)
        view = look(picture, table.camera, table.targets)
        path = folder / f"see-{seed}-{number}.png"
        files.append(write_image(path, annotate(picture, view)))
    return files
