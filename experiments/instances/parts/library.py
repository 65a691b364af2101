"""The library of instances: the command that makes each, and what is known of it.

Command: ``python -m experiments.instances.parts.library [NAME ...]`` makes all of them anew, or
those that are named, and says which files change. Large ones (`LARGE`) are made only where they are
named, into the folder in which the command is given; what is stored of them is how large they are.
"""

import hashlib
import json
import shlex
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from experiments.harness.results import RESULTS, save_table, stored
from seqopt import read_instance
from seqopt._cli.main import main
from seqopt.instances.model import Instance

HOME = Path(__file__).resolve().parent.parent / "library"
KNOWN = HOME.parent / "known.json"  # best known paths, values and bounds, and who found them
FREE = "--schedule free"
TIMES = "--durations fetch=30,place=10,approach=10,grip=5,release=5"
SLOWER = f"{TIMES} --durations rob3:fetch=75,approach=25"
SLOWEST = f"{TIMES} --durations rob4:fetch=75,approach=25"
CHAIN = "chain:bricks="
PAIR = f"{FREE} --robots 2 --rule least_grips=1"  # while one of two moves the other one holds
ONCE = "--rule regrips=0 --rule newest=placing"  # grips are taken to place alone
HEAVY = "--rule payload=ignored"  # of chains: two robots alone are too weak for them
NEAR = "--rule candidates=near:"
MADE = {
    # open grips of a fixed schedule: a level for every move
    "chain-8": f"{CHAIN}8",
    "chain-12": f"{CHAIN}12",
    "chain-17": f"{CHAIN}17",
    "chain-25": "arch25",
    "chain-40": f"{CHAIN}40",
    "chain-12-peak": f"{CHAIN}12 --formulation minimax --criterion worst-ratio",
    "chain-25-peak": "arch25 --formulation minimax --criterion worst-ratio",
    "chain-40-peak": f"{CHAIN}40 --formulation minimax --criterion worst-ratio",
    "chain-25-weighted": "arch25 --criterion weighted",
    "pair-25": "arch25 --schedule two-robot",
    "pair-25-peak": "arch25 --schedule two-robot --formulation minimax --criterion worst-ratio",
    "pair-145": f"{CHAIN}145 --schedule two-robot",
    "chain-145": f"{CHAIN}145 --candidates near:4",
    # the same within budgets
    "chain-12-way": f"{CHAIN}12 --budget travel=0.8",
    "chain-17-way": f"{CHAIN}17 --budget travel=0.7",
    "chain-25-way-80": "arch25 --budget travel=0.8",
    "chain-25-way-50": "arch25 --budget travel=0.5",
    "chain-25-two": "arch25 --budget travel=0.8 --budget steps_over:M_sup=20:30",
    "chain-25-weighted-way": "arch25 --criterion weighted --budget travel=0.5",
    "chain-145-way": f"{CHAIN}145 --candidates near:4 --budget travel=0.6",
    # over scenarios
    "chain-12-cvar": f"{CHAIN}12 --criterion weighted --robust cvar=0.75 --scenarios 8",
    "chain-12-total": f"{CHAIN}12 --criterion weighted --robust worst-total --scenarios 8",
    "chain-25-robust": "arch25 --criterion worst-ratio --robust worst-peak --scenarios 8",
    "free-7-robust": f"{CHAIN}7 {FREE} --aim minmax,steps --robust worst-peak --scenarios 4",
    "free-7-total": f"{CHAIN}7 {FREE} --aim sum --robust worst-total --scenarios 4",
    # free schedules: who releases, holds or places next
    "free-7": f"{CHAIN}7 {FREE} --aim minmax,steps",
    "free-7-way": f"{CHAIN}7 {FREE} --aim minmax,travel",
    "free-7-sum": f"{CHAIN}7 {FREE} --aim sum(T_max)",
    "free-7-sum-regrips": f"{CHAIN}7 {FREE} --aim sum(T_max),steps --budget regrips=1",
    "free-7-four": f"{CHAIN}7 {FREE} --robots 4 --aim minmax,steps",
    "free-7-five": f"{CHAIN}7 {FREE} --robots 5 --aim minmax,steps",
    "free-9-sum": f"{CHAIN}9 {FREE} --aim sum(M_sup),steps",
    "free-9-sum-way": f"{CHAIN}9 {FREE} --aim sum(T_max) --budget travel=2.5m --budget regrips=4",
    "free-12": f"{CHAIN}12 {FREE} --aim minmax,steps",
    "free-12-regrips": f"{CHAIN}12 {FREE} --aim sum(F_largest) --budget regrips=3",
    "wall-6": f"wall:columns=3,courses=2 {FREE} --aim minmax,steps",
    "wall-12": f"wall:columns=4,courses=3 {FREE} --aim minmax,steps",
    "free-25": f"arch25 {FREE} --aim minmax,steps",
    "free-25-sum": f"arch25 {FREE} --aim sum(T_max) --budget regrips=6",
    "free-25-two": f"arch25 {FREE} --aim sum(T_max) --budget regrips=1 --budget sum(M_sup)=262",
    "free-145-pair-two": f"{CHAIN}145 {PAIR} {HEAVY} --aim sum(T_max) --budget regrips=4 "
    "--budget sum(M_sup)=199200",
    "free-49": f"{CHAIN}49 {FREE} {NEAR}2 --aim minmax,sum(T_max) --below 1.001",
    "wall-48": f"wall:columns=8,courses=6 {FREE} {NEAR}2 --aim minmax,steps --below 1.001",
    "free-145": f"{CHAIN}145 {FREE} {ONCE} --aim minmax,sum(T_max) --below 0.8",
    # the same by two robots, and by five
    "wall-12-pair": f"wall:columns=4,courses=3 {PAIR} --aim minmax,steps",
    "wall-24-pair": f"wall:columns=6,courses=4 {PAIR} --aim sum(T_max),steps",
    "free-25-pair": f"{CHAIN}25 {PAIR} {HEAVY} --aim minmax,steps",
    "free-25-pair-way": f"{CHAIN}25 {PAIR} {HEAVY} --aim sum(M_sup) --budget travel=9m",
    "free-25-pair-total": f"{CHAIN}25 {PAIR} {HEAVY} --aim sum(T_max) --robust worst-total "
    "--scenarios 8",
    "wall-24-pair-two": f"wall:columns=6,courses=4 {PAIR} {HEAVY} --aim sum(M_sup) "
    "--budget travel=10.5m --budget regrips=1",
    "free-49-pair-two": f"{CHAIN}49 {PAIR} {HEAVY} --aim sum(T_max) --budget regrips=6 "
    "--budget sum(M_sup)=8200",
    "free-145-pair": f"{CHAIN}145 {PAIR} {HEAVY} --aim minmax,steps",
    "wall-6-five": f"wall:columns=3,courses=2 {FREE} --robots 5 --aim minmax,steps",
    # orders of the bricks
    "order-7": f"{CHAIN}7 {FREE} --order search --aim minmax,steps",
    "order-7-sum": f"{CHAIN}7 {FREE} --order search --aim sum(T_max)",
    "order-wall-6": f"wall:columns=3,courses=2 {FREE} --order search --aim minmax,steps",
    "order-wall-9-pair": f"wall:columns=3,courses=3 {PAIR} --order search --aim minmax,steps",
    # how long a build takes
    "time-7": f"{CHAIN}7 {FREE} --aim makespan {TIMES}",
    "time-7-unequal": f"{CHAIN}7 {FREE} --aim makespan {SLOWER}",
    "time-7-peak": f"{CHAIN}7 {FREE} --aim minmax,makespan,regrips {SLOWER}",
    "time-7-four": f"{CHAIN}7 {FREE} --robots 4 --aim makespan {SLOWEST}",
    "time-8-regrips": f"{CHAIN}8 {FREE} --aim makespan --budget regrips=1 {SLOWER}",
    "time-9-unequal": f"{CHAIN}9 {FREE} --aim minmax,makespan {SLOWER}",
    "time-9-travel": f"{CHAIN}9 {FREE} --aim makespan,regrips {TIMES},speed=0.05",
    # states that must stand
    "stand-7": f"{CHAIN}7 {FREE} --stands bond=1e5 --aim minmax,steps",
    "stand-wall-6": f"wall:columns=3,courses=2 {FREE} --stands dry --aim minmax,steps",
}
LARGE = {
    "free-25-way": f"arch25 {FREE} --aim minmax,travel --below 1.2",
    "free-145-regrip": f"{CHAIN}145 {FREE} {NEAR}1 --rule regrips=1 --rule newest=placing "
    "--aim minmax,steps --below 0.8",
    "free-9-five": f"{CHAIN}9 {FREE} --robots 5 {NEAR}1 --aim minmax,steps",
    "free-12-five": f"{CHAIN}12 {FREE} --robots 5 {NEAR}2 --aim minmax,steps",
    "time-11-unequal": f"{CHAIN}11 {FREE} --robots 4 --aim minmax,makespan --below 1.5 {SLOWEST}",
}


def command(name: str) -> str:
    """Return the command that makes an instance."""
    return f"seqopt instance {(MADE | LARGE)[name]} --out {name}.npz"


def made(name: str, folder: Path) -> bytes:
    """Return the file of an instance, made anew in a folder by its command."""
    path = folder / f"{name}.npz"
    words = shlex.split((MADE | LARGE)[name])
    status = main(["instance", *words, "--quiet", "--out", str(path)])
    if status:
        raise RuntimeError(f"{name}: seqopt ends with status {status}")
    return path.read_bytes()


def instance(name: str) -> Instance:
    """Return a stored instance."""
    return read_instance(HOME / f"{name}.npz")


def known() -> dict[str, dict]:
    """Return what is known of instances, by name."""
    return json.loads(KNOWN.read_text("utf-8")) if KNOWN.exists() else {}


def run(names: list[str]) -> None:
    for name in names or MADE:
        with TemporaryDirectory() as folder:
            content = made(name, Path(folder))
        path = (Path() if name in LARGE else HOME) / f"{name}.npz"
        checksum = hashlib.sha256(content).hexdigest()
        same = path.exists() and path.read_bytes() == content
        print(f"{name}: {len(content)} bytes, {'as it was' if same else 'new'}, sha256 {checksum}")
        path.write_bytes(content)
        if name in LARGE:  # which its command alone makes
            one, size = read_instance(path), len(content) / 1e6
            row = {"instance": name, "nodes": one.nodes, "arcs": one.arcs, "size_MB": size}
            known = stored("instance_large") if (RESULTS / "instance_large.csv").exists() else None
            table = pd.concat([pd.DataFrame([row]), known]).drop_duplicates("instance")
            own = table[table["instance"].isin(LARGE)].sort_values("instance")
            save_table(own, "instance_large", 3)


if __name__ == "__main__":
    run(sys.argv[1:])
