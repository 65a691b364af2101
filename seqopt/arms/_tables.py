"""How postures are found, kept in a folder, and chosen for arms with compliant joints."""

from __future__ import annotations

import hashlib
import io
import re
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache, partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seqopt._files import make_folder, read_bytes, write_file
from seqopt.arms._archives import Archive
from seqopt.arms._arm import MOST, Arm, HeldPostures
from seqopt.arms._collisions import collide_pairs
from seqopt.arms._model import SAYS, UP, ArmModel, arm_model, model_path, shape_notes
from seqopt.arms._reached import Reached, Site, beside_others, reached_alone
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, frozen
from seqopt.errors import SceneError, SceneWarning
from seqopt.scene.scene import Scene
from seqopt.work import Tell

_SWEEPS = 50  # over all robots and nodes, each given its best posture beside those of the others


@dataclass(frozen=True, eq=False, repr=False)
class PostureTable(FrozenValue):
    """The postures of all arms of a scene, one a row, those of a robot at a node side by side.

    Attributes
    ----------
    robots : tuple of str
        Names of the robots that have arms.
    nodes : tuple of int
    bricks : tuple of int
        Names of the bricks, ascending.
    robot, node : (P,) int
        Whose posture it is, and at which node: places in ``robots`` and ``nodes``.
    joints : (P, J) float
        Joint by joint, rad or m; NaN for joints that an arm does not have.
    axes : (P, 3, 3) float
        Directions of the flange as columns; the third one is that from which the tool comes.
    place : (P, 3) float
        Where the flange is, m.
    tools : (P,) float
        How long the body of the tool is that may hit something, from the flange, m.
    links : tuple of str
        Bodies of all arms, in words; `SAYS` stands for what they do.
    strikes : (P, B) int
        Which of these hits each brick, the one nearest to the base; -1 for none.
    collide : (P, P) bool
        Which pairs of postures, of different robots, are in each other's way.
    found : (R, N) int
        How many postures were found, of which at most `MOST` are kept.
    why : (R, N) str
        Why there is none; empty where there are some.
    """

    robots: tuple[str, ...]
    nodes: tuple[int, ...]
    bricks: tuple[int, ...]
    robot: Ints
    node: Ints
    joints: Floats
    axes: Floats
    place: Floats
    tools: Floats
    links: tuple[str, ...]
    strikes: Ints
    collide: Bools
    found: Ints
    why: NDArray[np.str_]

    @cached_property
    def hits(self) -> Bools:
        """Which bricks an arm hits in a posture (P, B): it is usable while none of these stands."""
        return frozen(np.asarray(self.strikes >= 0))

    def rows(self, robot: str, node: int) -> Ints:
        """Return the postures of a robot at a node."""
        return self._rows.get((robot, node), np.zeros(0, dtype=np.int64))

    def why_not(self, robot: str, node: int, rows: Ints, standing: Bools) -> str:
        """Return why none of the postures of a robot at a node, as rows, is free of bricks.

        ``standing`` (B,): which bricks stand. Named is what stops the one that comes farthest;
        nothing, if one is free.
        """
        if not len(rows):
            return str(self.why[self.robots.index(robot), self.nodes.index(node)])
        hit = self.hits[rows] & standing
        if not hit.any(axis=1).all():
            return ""
        first = np.where(hit, self.strikes[rows], len(self.links))
        best = int(first.min(axis=1).argmax())
        brick = int(first[best].argmin())
        link = int(first[best, brick])
        return self.links[link].replace(SAYS, f"hits brick {self.bricks[brick]}")

    @cached_property
    def _rows(self) -> dict[tuple[str, int], Ints]:
        keys = [(self.robots[r], self.nodes[n]) for r, n in zip(self.robot, self.node, strict=True)]
        out: dict[tuple[str, int], list[int]] = {}
        for row, key in enumerate(keys):
            out.setdefault(key, []).append(row)
        return {key: np.array(rows) for key, rows in out.items()}


def choose(
    whose: tuple[Ints, Ints], usable: Floats, collide: Bools, together: Floats, robots: int
) -> Ints:
    """Return one posture of every robot at every place, (R, N), -1 where there is none.

    Robot by robot and place by place the posture is taken that can be used the longest and is in
    the way of the fewest that were taken for others, until none changes.

    ``whose`` (P,), (P,): robot and place; ``usable`` (P,): for which share of its time each can be
    used; ``collide`` (P, P); ``together`` (N, N): how much it counts that two places cannot be held
    together; ``robots``: how many there are.
    """
    robot, place = whose
    out = np.full((robots, len(together)), -1)
    groups = [np.flatnonzero((robot == r) & (place == n)) for r, n in np.ndindex(*out.shape)]
    for at, rows in enumerate(groups):
        if len(rows):
            out.flat[at] = rows[int(np.argmax(usable[rows]))]
    chosen = np.zeros(len(robot), dtype=bool)
    chosen[out[out >= 0]] = True
    for _ in range(_SWEEPS):
        known = out.copy()
        for at, rows in enumerate(groups):
            if len(rows) > 1:
                mine = together[place[rows[0]], place[chosen]]
                cost = collide[rows][:, chosen] @ mine / together.sum(axis=1).max()
                chosen[out.flat[at]] = False
                out.flat[at] = rows[int(np.argmin(cost + 1 - usable[rows]))]
                chosen[out.flat[at]] = True
        if (out == known).all():
            break
    return out


_MOST_ROWS = 6000  # postures that are kept in all, where that leaves one for every node
_STIFFER = 1e-6  # share of a posture's use that counts as much as how stiff it is


def _compute_table(site: Site, tell: Tell = lambda _: None) -> PostureTable:
    """Return the posture table of a site, if its models can be read and bases stand clear."""
    kept = max(1, min(MOST, _MOST_ROWS // max(1, len(site.robots) * len(site.nodes))))
    alone = []
    for number, robot in enumerate(site.robots):
        tell(f"postures of {robot.name}")
        try:
            alone.append(reached_alone(site.alone(number), kept))
        except SceneError as error:
            why = str(error).removeprefix("robot alone: ").removeprefix("arm: ")
            raise SceneError(f"robot {robot.name}: {why}") from error
    reached = beside_others(site, alone)
    tell("postures that are in each other's way")
    robot_of = np.repeat(np.arange(len(reached)), [len(each.node) for each in reached])
    node = np.concatenate([each.node for each in reached])
    joints = np.full((len(node), max(each.joints.shape[1] for each in reached)), np.nan)
    for number, each in enumerate(reached):  # an arm may have fewer joints than another one
        joints[robot_of == number, : each.joints.shape[1]] = each.joints
    links = [each.model.names for each in reached]
    first = np.cumsum([len(fixed) for fixed in ((), *links)])
    places = range(len(site.nodes))
    return PostureTable(
        robots=tuple(robot.name for robot in site.robots),
        nodes=site.nodes,
        bricks=tuple(brick.name for brick in site.bricks),
        robot=robot_of,
        node=node,
        joints=joints,
        axes=np.concatenate([each.axes for each in reached]),
        place=np.concatenate([each.place for each in reached]),
        tools=np.concatenate([each.placed.tools for each in reached]),
        links=tuple(name for own in links for name in own),
        strikes=np.concatenate(
            [
                np.where(each.strikes < 0, -1, each.strikes + start)
                for each, start in zip(reached, first.tolist(), strict=False)
            ]
        ),
        collide=_collisions(site, reached, robot_of),
        found=np.array([each.found for each in reached]),
        why=np.array([[each.why.get(place, "") for place in places] for each in reached]),
    )


def _collisions(site: Site, reached: list[Reached], robot: Ints) -> Bools:
    """Return which pairs of postures of different robots collide, (P, P)."""
    out = np.zeros((len(robot), len(robot)), dtype=bool)
    for i, j in combinations(range(len(reached)), 2):
        if not site.together(i, j):
            continue
        one, two = reached[i], reached[j]
        grid = np.indices((len(one.node), len(two.node))).reshape(2, -1)
        found = collide_pairs((one.model, two.model), one.placed, two.placed, (grid[0], grid[1]))
        block = found.reshape(len(one.node), len(two.node))
        out[np.ix_(robot == i, robot == j)] = block
        out[np.ix_(robot == j, robot == i)] = block.T
    return out


def _soft_models(arms: Iterable[tuple[str, Arm | None]]) -> dict[str, ArmModel]:
    """Return the models of arms with compliant joints, by the names of their robots.

    Raises `SceneError` if an arm does not give a stiffness for every joint.
    """
    found = dict[str, ArmModel]()
    for name, arm in arms:
        try:
            found |= {name: arm_model(arm)} if arm is not None and arm.joint_stiffness else {}
        except SceneError as error:
            raise SceneError(f"robot {name}: {str(error).removeprefix('arm: ')}") from error
    return found


_VERSION = 3  # of what is computed: tables of another one are not taken
_DAMAGED = (
    *(OSError, ValueError, TypeError, EOFError, SyntaxError, AttributeError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error, tokenize.TokenError),
)  # what reading broken bytes raises
_NAMES = ("robots", "nodes", "bricks", "links")
_MESH = re.compile(rb'filename="(?:package://|file://)?([^"]+)"')


def _stored_table(folder: Path, site: Site, compute: Callable[[], PostureTable]) -> PostureTable:
    """Return the table of a site from a folder, or compute it and keep it there."""
    make_folder(folder)
    path = folder / f"postures-{_key(site)}.npz"
    if path.exists() and (found := _read(path, site)) is not None:
        return found
    table = compute()
    out = io.BytesIO()
    arrays = {each.name: np.asarray(getattr(table, each.name)) for each in fields(table)}
    np.savez_compressed(out, **arrays)  # type: ignore[arg-type]
    write_file(path, out.getvalue())
    return table


def _key(site: Site) -> str:
    """Return the content that postures depend on, condensed: robots, bricks, models, meshes."""
    found = hashlib.sha256(repr((_VERSION, site.up, site.blocked)).encode())
    for brick in site.bricks:
        shape = None if brick.shape is None else brick.shape.vertices
        own = (brick.name, brick.position, brick.length_axis, brick.width_axis, brick.dimensions)
        found.update(repr((*own, brick.nodes, brick.node_offsets, shape)).encode())
    for robot in site.robots:
        arm = robot.arm
        assert arm is not None
        own = tuple(getattr(arm, each.name) for each in fields(arm) if each.name != "urdf")
        found.update(repr((robot.name, robot.reach, own)).encode())
        for content in _model(model_path(arm)):
            found.update(hashlib.sha256(content).digest())
    return found.hexdigest()[:32]


def _model(path: Path) -> Iterator[bytes]:
    """Yield the content of a URDF and of the meshes that it names, as far as they are found."""
    text = read_bytes(path)
    yield text
    folders = [*path.resolve().parents][:UP]
    for name in sorted({*_MESH.findall(text)}):
        for each in folders:
            mesh = each / name.decode("utf-8", "replace")
            if mesh.is_file():
                yield read_bytes(mesh)
                break


def _read(path: Path, site: Site) -> PostureTable | None:
    """Return the table of a file; None if it is none, damaged, or of another site."""
    try:
        archive = Archive(read_bytes(path), str(path))
        archive.require(f"{each.name}.npy" for each in fields(PostureTable))
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as stored:
            content: dict[str, Any] = {name: stored[name] for name in stored.files}
        table = PostureTable(**content | {n: tuple(content[n].tolist()) for n in _NAMES})
        shape = len(table.robot), len(site.bricks)
        right = table.strikes.shape == shape and table.collide.shape == shape[:1] * 2
        right &= len(table.joints) == len(table.node) == shape[0]
    except _DAMAGED:
        return None
    wanted = tuple(each.name for each in site.robots), site.nodes
    return table if right and (table.robots, table.nodes) == wanted else None


_SITES = 16  # of which tables are kept, the last ones that were asked for


def known_table(scene: Scene, cache: Path | str | None, progress: Tell | None) -> PostureTable:
    """Return the posture table of a scene in which a robot has an arm, computed once."""
    site = Site.of(scene)
    known = _known(site)
    for note in () if known else shape_notes(scene):
        warnings.warn(note, SceneWarning, stacklevel=3)
    compute = partial(_compute_table, site, progress or (lambda _: None))
    if cache is not None and Path(cache) not in known:
        known[Path(cache)] = _stored_table(Path(cache), site, lambda: known.get(None) or compute())
        known.setdefault(None, known[Path(cache)])
    if None not in known:
        known[None] = compute()
    _soft_models((robot.name, robot.arm) for robot in scene.robots)
    return known[None]


@lru_cache(maxsize=_SITES)
def _known(site: Site) -> dict[object, PostureTable]:  # noqa: ARG001  # kept by site
    """Return the table of a site, if it is known, under the folders that have it."""
    return {}


@lru_cache(maxsize=_SITES)
def held_by(
    site: Site, table: PostureTable, arms: tuple[tuple[str, Arm | None], ...]
) -> HeldPostures:
    """Return the postures in which arms with compliant joints hold; ``arms``: with their names."""
    order, models = np.argsort(table.nodes), _soft_models(arms)
    chosen, robots, rows, found = _chosen(site, table, models)[:, order], [], [], []
    for robot, (name, _) in enumerate(arms):
        if name not in models:
            continue
        model, own = models[name], chosen[table.robots.index(name)]
        jacobian = np.full((len(own), 6, model.joints), np.nan)
        for place in np.flatnonzero(own >= 0).tolist():
            jacobian[place] = model.jacobian(table.joints[own[place], : model.joints])
        robots.append(robot)
        rows.append(own)
        found.append(jacobian)
    return HeldPostures(
        np.array(robots), np.array(table.nodes)[order], np.array(rows), tuple(found)
    )


def _chosen(site: Site, table: PostureTable, models: Mapping[str, ArmModel]) -> Ints:
    """Return the posture of every arm at every node, (R, N), -1 where there is none.

    What is near counts most: bricks near the node, which stand when it is held, and postures at
    nodes near by, which are held with it. The build order does not count.
    """
    at = np.array([b.node_position(n) for b in site.bricks for n in b.nodes])
    middle = np.array([brick.position for brick in site.bricks])
    size = np.mean([max(brick.dimensions) for brick in site.bricks])
    near = 1 / (1 + np.linalg.norm(at[:, None] - middle, axis=2) / size)
    together = 1 / (1 + np.linalg.norm(at[:, None] - at, axis=2) / size)
    own = near[table.node]
    usable = 1 - (table.hits * own).sum(axis=1) / own.sum(axis=1)
    give = np.zeros(len(table.robot))  # how far a force moves a node, by the joints
    for name, model in models.items():
        for row in np.flatnonzero(table.robot == table.robots.index(name)).tolist():
            moved = model.jacobian(table.joints[row, : model.joints])[:3]
            give[row] = (moved**2 / np.array(model.arm.joint_stiffness)).sum()
    usable -= _STIFFER * give / max(give.max(initial=0.0), np.finfo(float).tiny)
    return choose((table.robot, table.node), usable, table.collide, together, len(table.robots))
