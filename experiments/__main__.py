"""List the experiments with claim and last verdict, or run them all.

Command: ``python -m experiments`` lists; ``python -m experiments all [--quick]`` runs each one in
a process of its own and, unless quick, stores verdicts and seconds in
``experiments/results/verdicts.csv``; names in the place of ``all`` run these alone. Experiments
whose times are a result run alone, the others two at a time, those first that took longest the last
time. An experiment that an extra is missing for is named and left out. The exit status is 1 if a
claim does not hold, or if none is found.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed

import pandas as pd

from experiments.harness.claim import MISSING, PREFIX, ClaimError, claims, modules
from experiments.harness.results import HOME, ONE_CORE, RESULTS

STORE = RESULTS / "verdicts.csv"
TOGETHER = 2  # experiments at a time, a core each, where no time is a result


def run(name: str, *arguments: str) -> tuple[str, float]:
    """Return how an experiment ended and the seconds it took."""
    start = time.perf_counter()
    command = [sys.executable, "-m", modules()[name], *arguments]
    more = {"capture_output": True, "text": True, "cwd": HOME.parent, "env": os.environ | ONE_CORE}
    done = subprocess.run(command, check=False, **more)
    seconds = time.perf_counter() - start
    last = (done.stdout.splitlines() or [""])[-1]
    if done.returncode == 0 and last.startswith(PREFIX):
        return last.removeprefix(PREFIX).split(":")[0], seconds
    why = (done.stderr.splitlines() or [last])[-1]
    return ("left out: " if done.returncode == MISSING else "failed: ") + why, seconds


def stored(column: str) -> dict[str, object]:
    return pd.read_csv(STORE, index_col=0)[column].to_dict() if STORE.exists() else {}


def ended(
    names: Sequence[str], together: int, *arguments: str
) -> Iterator[tuple[str, tuple[str, float]]]:
    """Run experiments, so many at a time; yield each with how it ended, as it ends."""
    with ThreadPoolExecutor(together) as pool:
        jobs = {pool.submit(run, name, *arguments): name for name in names}
        for job in as_completed(jobs):
            yield jobs[job], job.result()


def run_all(*arguments: str, only: Sequence[str] = ()) -> pd.DataFrame:
    """Run experiments, every one by default; return a row each."""
    every, last, rows = claims(), stored("seconds"), []
    names = sorted(only or every, key=lambda name: -float(str(last.get(name, "inf"))))
    alone = [name for name in names if every[name].takes_time]
    others = [name for name in names if name not in alone]
    for group, together in ((others, TOGETHER), (alone, 1)):
        for name, (verdict, seconds) in ended(group, together, *arguments):
            print(f"{name:22}{seconds:7.1f} s  {verdict}", flush=True)
            rows.append({"experiment": name, "verdict": verdict, "seconds": seconds})
    table = pd.DataFrame(rows).sort_values("experiment", ignore_index=True)
    return table.assign(claim=[every[name].text for name in table["experiment"]])


def store(table: pd.DataFrame) -> None:
    """Store the rows of experiments that ran beside those of the others."""
    if STORE.exists():
        before = pd.read_csv(STORE)
        kept = before["experiment"].isin(set(claims()) - set(table["experiment"]))
        table = pd.concat([before[kept], table]).sort_values("experiment")
    table.to_csv(STORE, index=False, float_format="%.1f", lineterminator="\n")


def listed() -> Iterator[str]:
    """Yield a line for every experiment: its name, last verdict and claim."""
    verdicts = stored("verdict")
    for name, claim in claims().items():
        yield f"{name:22}{verdicts.get(name, 'not run')!s:22}{claim.text}"


def main() -> int:
    about = {"prog": "python -m experiments", "description": __doc__.splitlines()[0]}
    parser = argparse.ArgumentParser(**about)
    parser.add_argument("what", nargs="*", metavar="NAME", help="experiments, or list or all")
    parser.add_argument("--quick", action="store_true", help="reduced size, nothing stored")
    options = parser.parse_args()
    try:
        if options.what in ([], ["list"]):
            print(*listed(), sep="\n")
            return 0
        only = [] if options.what == ["all"] else options.what
        if unknown := [name for name in only if name not in claims()]:
            known = ", ".join(claims())
            raise ClaimError(f"{unknown[0]}: there is no such experiment; give some of {known}")
        table = run_all(*(["--quick"] if options.quick else []), only=only)
    except ClaimError as error:
        print(error, file=sys.stderr)
        return 1
    if not options.quick:
        store(table)
    return int(not table["verdict"].str.startswith(("holds", "left out")).all())


if __name__ == "__main__":
    sys.exit(main())
