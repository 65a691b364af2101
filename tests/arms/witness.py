"""Arms, bricks and the ground in MuJoCo: other kinematics and other collisions than seqopt has."""

import re

import mujoco
import numpy as np

from seqopt.arms._model import model_path

STILL = """
<mujoco><compiler meshdir="{meshes}" strippath="true" discardvisual="true" fusestatic="false"
inertiafromgeom="true"/></mujoco>"""


def _arm(arm):
    """The model of an arm as MuJoCo reads its URDF; no masses, no pictures."""
    path = model_path(arm)
    text = path.read_text()
    name = re.search(r'<collision>.*?filename="package://([^"]+)"', text, re.DOTALL)[1]
    meshes = next(p / name for p in path.parents if (p / name).is_file()).parent
    text = re.sub(r"<(visual|inertial)>.*?</\1>", "", text, flags=re.DOTALL)
    text = re.sub(r"(<robot[^>]*>)", r"\1" + STILL.format(meshes=meshes), text, count=1)
    return mujoco.MjSpec.from_string(text)


def _quaternion(columns):
    out = np.zeros(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(columns).ravel())
    return out


def ground(scene):
    """How high the ground is: at the lower one of the bases and of the lowest brick."""
    low = [
        b.position[2] - 0.5 * np.abs(b.frame[:, 2]) @ np.array(b.dimensions) for b in scene.bricks
    ]
    return min([*low, *(r.arm.position[2] for r in scene.robots if r.arm is not None)])


class Site:
    """All arms of a scene among its bricks, in the postures of a step."""

    def __init__(self, scene, table):
        spec = mujoco.MjSpec()
        self.arms = [robot for robot in scene.robots if robot.arm is not None]
        for robot in self.arms:
            arm, x, y = robot.arm, np.array(robot.arm.x_axis), np.array(robot.arm.y_axis)
            turn = _quaternion(np.column_stack([x, y, np.cross(x, y)]))
            frame = spec.worldbody.add_frame(pos=arm.position, quat=turn)
            child = _arm(arm)
            for geom in child.geoms:
                geom.contype, geom.conaffinity = 1, 3
            flange = child.body("tool0")
            flange.add_geom(
                name="tool", type=mujoco.mjtGeom.mjGEOM_CYLINDER, contype=1, conaffinity=3,
                size=[arm.tool_radius, 0.1, 0], pos=[0, 0, 0.1],
            )  # fmt: skip
            spec.attach(child, frame=frame, prefix=f"{robot.name}/")
        for brick in scene.bricks:
            spec.worldbody.add_geom(
                name=f"brick/{brick.name}", type=mujoco.mjtGeom.mjGEOM_BOX, contype=2,
                conaffinity=1, size=0.5 * np.array(brick.dimensions), pos=brick.position,
                quat=_quaternion(brick.frame.T),
            )  # fmt: skip
        spec.worldbody.add_geom(
            name="brick/0", type=mujoco.mjtGeom.mjGEOM_PLANE, contype=2, conaffinity=1,
            size=[9, 9, 1], pos=[0, 0, ground(scene)],
        )  # fmt: skip
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.scene, self.table = scene, table
        self._always = self._touching_however()

    def _name(self, geom):
        """Whose a body is: the robot and the link, or the brick; the ground is brick 0."""
        name = self.model.geom(geom).name
        if name.startswith("brick/"):
            return "brick", int(name.removeprefix("brick/"))
        robot, _, link = self.model.body(self.model.geom_bodyid[geom]).name.partition("/")
        return robot, "tool" if name.endswith("tool") else link

    def pose(self, robot, row):
        """Where MuJoCo puts the flange in a posture: axes as columns, and place."""
        self.put({robot: row})
        body = self.data.body(f"{robot}/tool0")
        return body.xmat.reshape(3, 3), body.xpos

    def put(self, rows):
        """Bring arms to postures, by robot; tools become as long as they are in these."""
        for robot, row in rows.items():
            names = [self.model.joint(j).name for j in range(self.model.njnt)]
            joints = [j for j, name in enumerate(names) if name.startswith(f"{robot}/")]
            for j, value in zip(joints, self.table.joints[row], strict=True):
                self.data.qpos[self.model.jnt_qposadr[j]] = value
            tool, half = self.model.geom(f"{robot}/tool").id, 0.5 * self.table.tools[row]
            self.model.geom_size[tool, 1] = half
            self.model.geom_pos[tool, 2] = half
            self.model.geom_rbound[tool] = np.hypot(half, self.model.geom_size[tool, 0])
            self.model.geom_aabb[tool, 5] = half
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_collision(self.model, self.data)

    def touching(self, rows, bricks):
        """What touches what with arms in postures, by robot, among so many bricks; free arms and
        neighboring links aside."""
        self.put(rows)
        standing = {0} | {brick.name for brick in self.scene.placed[:bricks]}
        out = set()
        for contact in self.data.contact:
            one, two = sorted(map(self._name, contact.geom), key=str)
            if any(kind == "brick" and what not in standing for kind, what in (one, two)):
                continue
            if any(kind not in {"brick", *rows} for kind, _ in (one, two)):
                continue
            if one[0] == two[0] and (one[1], two[1]) in self._always:
                continue
            if one == ("brick", 0) and two[1] in ("base_link", "link_1"):
                continue  # it stands there
            out.add((one, two))
        return out

    def _touching_however(self):
        """The pairs of links that touch however an arm moves: neighbors, and what overlaps."""
        draws, found = np.random.default_rng(5), []
        for _ in range(50):
            self.data.qpos = draws.uniform(*self.model.jnt_range.T)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_collision(self.model, self.data)
            pairs = (sorted(map(self._name, c.geom), key=str) for c in self.data.contact)
            found.append({(a[1], b[1]) for a, b in pairs if a[0] == b[0] != "brick"})
        return set.intersection(*found)
