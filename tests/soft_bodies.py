"""Rigid bodies on springs, held by springs: a dense solver with mechanics of its own.

Forces of a joint or a hand are its stiffness times its stretch, all of them and the weights
balance: one matrix, factored in double precision, the answer corrected with residuals of twice the
digits. For the grips' forces and the nodes' displacements alone.
"""

import numpy as np
from scipy import linalg, sparse

from seqopt.engines.rigid._mixed import add_products


def _reach(arm):
    """Motions (3, 6) of a point for unit twists of its body."""
    x, y, z = arm
    turn = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
    return np.hstack([np.eye(3), turn])


class SoftBodies:
    """A partial structure of ``bricks`` of a scene."""

    def __init__(self, scene, bricks):
        self.bricks = bricks
        self.placed = scene.placed[:bricks]
        self.body = {node: i for i, b in enumerate(self.placed) for node in b.nodes}
        self.center = [np.array(b.position) for b in self.placed]
        self.at = {n: np.array(scene.node_position(n)) for n in self.body}
        index = {b.name: i for i, b in enumerate(self.placed)}
        size = 6 * bricks
        self.maps, self.stiffness = [], []
        standing = {*index}
        for joint in scene.joints:
            if {*joint.bricks} <= standing:
                first, second = (index[name] for name in joint.bricks)
                self._spring(joint, second, first, size)
        for ground in scene.grounds:
            closes = ground.brick if ground.closes_with is None else ground.closes_with
            if {ground.brick, closes} <= standing:
                self._spring(ground, index[ground.brick], None, size)
        self.load = np.zeros(size)
        for i, brick in enumerate(self.placed):
            pull = brick.mass * scene.weight_factor * np.array(scene.gravity)
            self.load[6 * i : 6 * i + 3] = pull

    def _spring(self, spring, second, first, size):
        x, y = np.array(spring.along), np.array(spring.across)
        axes = np.stack([x, y, np.cross(x, y)])
        both = np.zeros((6, size))
        for body, sign in ((second, 1), (first, -1)):
            if body is not None:
                arm = np.array(spring.position) - self.center[body]
                both[:3, 6 * body : 6 * body + 6] += sign * axes @ _reach(arm)
                both[3:, 6 * body + 3 : 6 * body + 6] += sign * axes
        self.maps.append(both)
        self.stiffness.append([*spring.translational_stiffness, *spring.rotational_stiffness])

    def solve(self, nodes, hands, moved):
        """Return forces and moments of grips (r, 6), and displacements of inner nodes.

        ``hands``: stiffness along or about each of six axes, for every node, zero where there is
        none; or, as matrices (6, 6) or (3, 3), compliances, of those three that bear no moment.
        ``moved`` (r, 3).
        """
        maps, stiffness, stretch = [*self.maps], [*self.stiffness], [np.zeros(6)] * len(self.maps)
        turned = []
        for node, given, far in zip(nodes, hands, moved, strict=True):
            body = self.body[node]
            hand, axes = _principal(given)
            own = np.zeros((6, len(self.load)))
            own[:3, 6 * body : 6 * body + 6] = _reach(self.at[node] - self.center[body])
            own[3:, 6 * body + 3 : 6 * body + 6] = np.eye(3)
            maps.append(axes.T @ own)
            stiffness.append(hand)
            stretch.append(axes.T @ [*far, 0, 0, 0])
            turned.append(axes)
        rows = np.concatenate(maps)
        stiff = np.concatenate([np.array(s) for s in stiffness])
        apart = np.concatenate([np.array(s) for s in stretch])
        matrix = rows.T @ (stiff[:, None] * rows)
        scale = 1 / np.sqrt(np.diag(matrix))
        factors = linalg.cho_factor(scale[:, None] * matrix * scale)
        across, back = sparse.csr_array(rows), sparse.csr_array(rows.T)
        answer, change = np.zeros_like(self.load), np.zeros_like(self.load)
        for _ in range(30):
            answer = answer + change
            stretched = add_products(-apart, across, answer)
            left = add_products(self.load, back, -stiff * stretched)
            change = scale * linalg.cho_solve(factors, scale * left)
        stretched = add_products(rows @ change - apart, across, answer)
        force = -(stiff * stretched).reshape(-1, 6)
        shifts = [
            _reach(self.at[n] - self.center[i]) @ answer[6 * i : 6 * i + 6]
            for n, i in self.body.items()
        ]
        pairs = zip(turned, force[len(self.maps) :], strict=True)
        borne = np.array([axes @ own for axes, own in pairs]).reshape(-1, 6)
        return borne, np.array(shifts)


def _principal(hand):
    """Stiffness (6,) of a hand along directions of its own, and these (6, 6), as columns."""
    hand = np.array(hand, dtype=float)
    if hand.ndim == 1:
        return hand, np.eye(6)
    give, axes = np.linalg.eigh(hand)
    stiffness, whole = np.zeros(6), np.eye(6)
    stiffness[: len(give)] = 1 / give
    whole[: len(give), : len(give)] = axes
    return stiffness, whole
