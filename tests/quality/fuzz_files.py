"""Files of every kind that is read, damaged at random: each is read, or one line says why not.

A reader is taken with what uses its result at once, so that a file which passes it means something.
"""

from __future__ import annotations

import io
import json
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import seqopt
from seqopt._files import parse_json, read_text
from seqopt.arms._reached import Site as ArmSite
from seqopt.arms._tables import PostureTable
from seqopt.arms._tables import _read as read_postures
from seqopt.errors import SeqoptError
from seqopt.exchange._formats import read_file
from seqopt.exchange.exports import export
from seqopt.exchange.imports import import_scene, read_measured
from seqopt.plan.replan import asked_before
from seqopt.scene.scene import with_robots
from seqopt.scene.scene_file import dump_scene
from tests.arms.scenes import two_arms
from tests.builders import small_arch
from tests.documents import BOXES, DOCUMENTS
from tests.quality.fuzz_cases import CHANGES, _changed_plan, _noise, pick, plan_text

Read = Callable[[Path], object]
File = tuple[str, bytes, Read]  # a name, what is right in it, and what reads it
RIGHT = "wall:columns=2,courses=2"
TIMES = "fetch=30,place=10,approach=10,grip=5,release=5"


def _instance(goals: str) -> seqopt.Instance:
    scene = with_robots(small_arch(3), 2).with_durations(TIMES)
    engine = seqopt.make_engine("compliance", scene)
    rules = seqopt.FreeRules(least_grips=1)
    problem = seqopt.pose(engine, rules, seqopt.CRITERIA["worst-ratio"], goals, budgets="regrips=3")
    return seqopt.compile_instance(problem, name=goals)


def _of_instances() -> Iterator[tuple[str, File]]:
    with TemporaryDirectory() as folder:
        for kind, goals in (("instance", "minmax,steps"), ("timed instance", "makespan,steps")):
            one, path = _instance(goals), Path(folder, "x.npz")
            seqopt.save_instance(one, path)
            plan = seqopt.solve(one)
            nodes = json.dumps({"nodes": [*plan.nodes]})

            def judged(path: Path, nodes: str = nodes) -> object:
                return seqopt.judge_instance(seqopt.read_instance(path), nodes)

            yield kind, ("x.npz", path.read_bytes(), judged)
    values = plan.certificate.values
    names = dict(zip(plan.goals, values, strict=False))
    bounds = [
        {"value": 1.0, "shares": [[0.5, 0.25, 0.25]], "prices": {"regrips": 0.0}},
        {"shares": [[1.0, 0.0, 0.0]], "weights": [1.0]},
        {"labels": {"nodes": [0], "values": [[0.0, 0.0, 0.0, 0.0]]}},
    ]
    answer = {"nodes": [*plan.nodes], "values": names, "bounds": bounds[:1]}
    yield "answer", ("a.json", _json(answer), lambda path: seqopt.judge_instance(one, path))
    arcs = " ".join(map(str, plan.nodes))
    yield "answer as text", ("a.csv", arcs.encode(), lambda p: seqopt.judge_instance(one, p))
    for k, bound in enumerate(bounds, start=1):
        right = _json([bound])
        yield f"bound {k}", ("b.json", right, lambda p: seqopt.judge_instance(one, plan.nodes, p))


def _json(document: object) -> bytes:
    return json.dumps(document).encode()


def _of_scenes() -> Iterator[tuple[str, File]]:
    scene = seqopt.load_scene(RIGHT)
    network = seqopt.build_network(scene)
    steps = seqopt.sequential(network)
    loop = seqopt.exchange.schedules.schedule_text(seqopt.three_robot_loop(network))
    yield "scene", ("s.json", dump_scene(scene).encode(), seqopt.load_scene)
    plan = plan_text(scene, steps).encode()
    yield "plan", ("plan.csv", plan, lambda path: seqopt.read_plan(scene, path))
    yield "schedule", ("l.csv", loop.encode(), lambda path: seqopt.read_schedule(scene, path))
    rows = "".join(f"{b.name},{','.join(map(str, b.position))}\n" for b in scene.bricks)
    measured = f"brick,x,y,z\n{rows}".encode()
    yield "measured", ("m.csv", measured, lambda path: read_measured(scene, path))
    told = {"schedule": "free", "rules": {"least_grips": 1}, "aims": ["minmax"], "limits": {}}
    told |= {"criterion": "worst-ratio"}
    yield (
        "summary",
        (
            "summary.json",
            _json(told),
            lambda path: asked_before(parse_json(read_text(path), "summary")),
        ),
    )


def _of_imports() -> Iterator[tuple[str, File]]:
    def brought(path: Path) -> object:
        given = seqopt.exchange.Given(unit="m", density=2000.0)
        return (
            import_scene(path, given=given) if path.suffix in (".csv", ".json") else read_file(path)
        )

    scene = seqopt.load_scene(RIGHT)
    steps = seqopt.sequential(seqopt.build_network(scene))
    yield "obj", ("i.obj", export(scene, steps, "obj").encode(), brought)
    yield "compas_assembly", ("i.json", _json(DOCUMENTS["assembly"]), brought)
    yield "boxes", ("i.csv", BOXES.encode(), brought)


def _of_caches() -> Iterator[tuple[str, File]]:
    arms = two_arms(3)
    site = ArmSite.of(arms)
    p, r, n, b = 4, len(site.robots), len(site.nodes), len(site.bricks)
    table = {
        "robots": np.array([x.name for x in site.robots]),
        "nodes": np.array(site.nodes),
        "bricks": np.array([x.name for x in site.bricks]),
        "robot": np.arange(p) % r,
        "node": np.arange(p) % n,
        "joints": np.zeros((p, 6)),
        "axes": np.zeros((p, 3, 3)),
        "place": np.zeros((p, 3)),
        "tools": np.zeros(p),
        "links": np.array(["link a …"]),
        "strikes": np.zeros((p, b), int),
        "why": np.full((r, n), ""),
        "collide": np.zeros((p, p), bool),
        "found": np.ones((r, n), int),
    }
    assert {*table} == {each.name for each in fields(PostureTable)}
    np.savez_compressed(out := io.BytesIO(), **table)
    yield "postures", ("postures.npz", out.getvalue(), lambda path: read_postures(path, site))


@cache
def right_files() -> dict[str, File]:
    """Return a file of every kind that is right, with what reads it."""
    return {
        kind: file
        for made in (_of_instances, _of_scenes, _of_imports, _of_caches)
        for kind, file in made()
    }


# damage
def damaged(rng: np.random.Generator, content: bytes) -> bytes:
    """Return a file in which something is changed: as what it is, or as bytes."""
    if content[:2] == b"PK" and rng.random() < 0.8:
        return _repacked(rng, content)
    if content[:1] in b"{[" and rng.random() < 0.8:
        return _changed_document(rng, content.decode()).encode(errors="surrogatepass")
    if rng.random() < 0.5:
        return _changed_bytes(rng, content)
    text = content.decode("latin-1")
    changed = _changed_plan(rng, text) if rng.random() < 0.5 and "," in text else _noise(rng, text)
    return changed.encode("latin-1", errors="replace")


def _changed_document(rng: np.random.Generator, text: str) -> str:
    document = json.loads(text)
    if rng.random() < 0.1:
        return "[" * 5000 + text + "]" * 5000
    for _ in range(int(rng.integers(1, 4))):
        if isinstance(document, dict) and document:
            pick(rng, CHANGES)(rng, document)
    return json.dumps(document)


def _changed_bytes(rng: np.random.Generator, content: bytes) -> bytes:
    at, what = int(rng.integers(len(content) + 1)), int(rng.integers(4))
    if what == 0:
        return content[:at]
    if what == 1:
        return content[:at] + rng.bytes(int(rng.integers(1, 9))) + content[at:]
    if what == 2:
        return content[:at] + content[at + int(rng.integers(1, 30)) :]
    out = bytearray(content)
    for place in rng.integers(len(out), size=int(rng.integers(1, 6))).tolist() if out else ():
        out[place] ^= int(rng.integers(1, 256))
    return bytes(out)


def _repacked(rng: np.random.Generator, content: bytes) -> bytes:
    """Return an archive of which a part is changed, lost, new, packed otherwise, or a lie."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name, what = pick(rng, [*parts]), int(rng.integers(8))
    if what <= 3:
        array = name.endswith(".npy") and rng.random() < 0.8
        parts[name] = _changed_array(rng, parts[name]) if array else damaged(rng, parts[name])
    elif what == 4:
        del parts[name]
    elif what == 5:
        parts[pick(rng, ("more.npy", "../x.npy", "amount_99.npy", "\x1b[2J"))] = parts[name]
    how = pick(rng, (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2)) if what == 6 else zipfile.ZIP_DEFLATED
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", how) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that occur twice
        for each, part in [*parts.items(), *[(name, parts.get(name, b""))][: rng.random() < 0.05]]:
            archive.writestr(each, part)
    packed = bytearray(out.getvalue())
    if what == 7:  # the directory announces another size
        at = packed.find(b"PK\x01\x02") + int(rng.integers(8, 46))
        packed[at] = int(rng.integers(256))
    return bytes(packed)


def _changed_array(rng: np.random.Generator, content: bytes) -> bytes:
    """Return an array of another shape or type, with a number changed, or as changed bytes."""
    array, what = np.load(io.BytesIO(content)), int(rng.integers(7))
    if what == 0:
        array = array[..., None]
    elif what == 1 and array.ndim:
        array = array[:-1]
    elif what == 2 and array.dtype.kind in "iufb":
        array = array.astype(pick(rng, ("S9", "U9", "c16", "f2", "u8", "?", ">i4")))
    elif what == 3 and array.size and array.dtype.kind in "iuf":
        odd = (-1, 127, 10**6, np.nan, np.inf) if array.dtype.kind == "f" else (-3, -1, 99, 127)
        array.flat[int(rng.integers(array.size))] = pick(rng, odd)
    elif what == 4:
        return _changed_bytes(rng, content[:128]) + content[128:]
    elif what == 5:
        shape = pick(rng, (b"(99999999999,)", b"(" * 90, b"(-1,)", b"(1e3,)"))
        return content[:60] + shape + content[60 + len(shape) :]
    out = io.BytesIO()
    np.save(out, array, allow_pickle=False)
    return out.getvalue()


def read_damaged(kind: str, number: int, folder: Path) -> str:
    """Return what is wrong with how a damaged file of a kind is read; empty if nothing is."""
    name, right, read = right_files()[kind]
    rng = np.random.default_rng([number, sorted(right_files()).index(kind)])
    path = folder / name
    path.write_bytes(damaged(rng, right))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", seqopt.errors.SceneWarning)
        try:
            read(path)
        except SeqoptError as error:
            return "" if str(error) and "\n" not in str(error) else f"more than a line: {error!r}"
        except Exception as error:  # what this looks for
            where: Any = error.__traceback__
            while where.tb_next is not None:
                where = where.tb_next
            at = f"{where.tb_frame.f_code.co_filename}:{where.tb_lineno}"
            return f"case {number} of {kind}: {type(error).__name__}: {error} at {at}"[:400]
    return ""
