"""How a hose becomes part of a scene's mjModel: options, names, ties to the robots, contact.

The hose has bits of MuJoCo's contype that no geom of the scene uses, and the geoms' conaffinity
takes them on, so contacts within the scene stay as they are. Parts of the hose that pass by the
same robots share a bit; a robot's own geoms do not take on the bits of the parts near its site.
Planes have a bit of their own: of a capsule they touch the two ends, so spheres at the nodes are
the same contacts, each of them once.
"""

import warnings
from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.mujoco.chain_settings import IMPEDANCE_RATIO, find_integrator
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import check_number
from hose_mj.scenes.mjcf.model import reset_to_start
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.scene_geoms import OWN_ARC, SceneGeoms, compute_radius, find_colliding

PREFIX = "hose/"  # of the names of all that is added to a scene
HARD = [0.9999, 0.9999, 0.001, 0.5, 2.0]  # MuJoCo's solimp of ties and edges


@dataclass(frozen=True)
class Numerics:
    """How MuJoCo steps a scene with a hose; `substeps` of its steps are one of the world's (s)."""

    timestep: float
    substeps: int
    integrator: str
    jacobian: str

    def __post_init__(self) -> None:
        check_number("timestep", self.timestep)
        check_count("substeps", self.substeps, 1)

    def tie_options(self) -> dict[str, list[float]]:
        """solref (two of MuJoCo's steps, critically damped) and solimp of ties and edges."""
        return {"solref": [2.0 * self.inner_step, 1.0], "solimp": HARD}

    @property
    def inner_step(self) -> float:
        """MuJoCo's own time step (s)."""
        return self.timestep / self.substeps

    def apply(self, option: mujoco.MjOption) -> None:
        """Writes the options of a scene that is being made.

        Raises:
            InputError: a scene that switches off what ties the hose to its robots; an integrator
                that this MuJoCo lacks.
        """
        for flag in ("CONSTRAINT", "EQUALITY"):
            if option.disableflags & getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"):
                raise InputError(f"<option> <flag> {flag.lower()}", "disable", "enable")
        option.timestep = self.inner_step
        option.integrator = find_integrator(self.integrator)
        option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{self.jacobian.upper()}")
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPEDANCE_RATIO


def join_hose(
    scene: Scene, maker: mujoco.MjSpec, hose: mujoco.MjSpec, ties: dict[str, list[float]]
) -> tuple[mujoco.MjModel, np.ndarray]:
    """Adds a hose to a scene, behind all that is there, and ties it to robots and source.

    The hose has sites hold0, hold1, ... for the robots and, last, the source; equality constraints
    of these names, with the solref and solimp of `ties`, hold it. Returned are the model and the
    ids of the hose's bodies in their order. `InputError` is raised if MuJoCo refuses the two
    together, or the scene changes the hose's mass.
    """
    names = [body.name for body in hose.bodies if body.name != "world"]
    maker.attach(hose, prefix=PREFIX, frame=maker.worldbody.add_frame())
    for k, place in enumerate((*scene.robots, scene.source)):
        maker.add_equality(
            name=f"{PREFIX}hold{k}",
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"{PREFIX}hold{k}",
            name2=place.site,
            **ties,
        )
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "flex .* is not rigid")  # those that only collide
            model = maker.compile()
    except ValueError as error:
        valid = f"one that takes a hose (MuJoCo: {' '.join(str(error).split())})"
        raise InputError("scene", str(scene.path), valid) from error
    bodies = np.array([model.body(PREFIX + name).id for name in names])
    mass = float(model.body_mass[bodies].sum())
    if not np.isclose(mass, scene.spec.mass, rtol=1e-6):
        valid = f"{scene.spec.mass:g} kg, which settotalmass and the like in <compiler> change"
        raise InputError("mass of the hose", mass, valid)
    return model, bodies


_BITS = 31
_TORSION, _ROLLING = 0.005, 0.0001


@dataclass(frozen=True)
class HoseContact:
    """How the hose touches things."""

    friction: list[float]  # MuJoCo's five coefficients, of which the first two, Coulomb's, count
    # Above that of all geoms of the scene: in a contact with the hose its friction and hardness
    # count.
    priority: int
    solref: list[float]  # critically damped, two of the world's time steps
    bits: np.ndarray  # contype of each piece of the hose (N,), for all but planes
    plane_bit: int  # contype for planes

    def write(self, item: mujoco.MjsGeom | mujoco.MjsFlex, bits: int) -> None:
        """Lets a geom or flex of the hose touch what takes on these bits."""
        item.contype, item.conaffinity, item.condim = bits, 0, 3
        item.friction = self.friction[: len(item.friction)]
        item.priority, item.solref = self.priority, self.solref


def open_scene(
    scene: Scene, maker: mujoco.MjSpec, nodes: Array, step: float
) -> tuple[HoseContact, list[Obstacle]]:
    """Lets the geoms of a scene touch the pieces of a hose between nodes (N + 1,), m.

    What the geoms of `maker`, the scene's compiled spec, collide with is changed; `step` is the
    world's (s). Returned are how the hose touches them, and where the simple ones stand at the
    start. `InputError` is raised for a scene that leaves too few bits.
    """
    model = maker.compile()
    data = mujoco.MjData(model)
    reset_to_start(model, data)
    mujoco.mj_kinematics(model, data)
    passes = _find_neighbours(scene, model, data, nodes)
    groups, group = np.unique(passes, axis=0, return_inverse=True)
    used = int(np.bitwise_or.reduce([*model.geom_contype, *model.flex_contype, 0]))
    free = [1 << k for k in range(1, _BITS) if not used >> k & 1]
    if len(free) < len(groups) + 1:
        valid = f"at least {len(groups) + 1} bits that no geom uses, for the hose"
        raise InputError("bits of contype", bin(used), valid)
    plane_bit, bits = free[0], np.array(free[1 : len(groups) + 1])
    owner = _find_owners(scene, model)
    touched = set(find_colliding(model).tolist())
    for geom in maker.geoms:
        if geom.id in touched:
            robot = owner[geom.id]
            open_to = bits if robot < 0 else bits[~groups[:, robot]]
            is_plane = geom.type == mujoco.mjtGeom.mjGEOM_PLANE
            geom.conaffinity |= plane_bit if is_plane else int(open_to.sum())
    sites = np.array([model.site(p.site).id for p in (*scene.robots, scene.source)])
    arc_lengths = np.array([*(robot.arc_length for robot in scene.robots), 0.0])
    geoms = SceneGeoms.find(model, data, sites, arc_lengths)
    contact = HoseContact(
        [scene.friction, scene.friction, _TORSION, _ROLLING, _ROLLING],
        int(model.geom_priority.max(initial=0)) + 1,
        [2.0 * step, 1.0],
        bits[group.ravel()],
        plane_bit,
    )
    return contact, geoms.make_obstacles(model, data, scene.friction)


def _find_neighbours(
    scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, nodes: Array
) -> np.ndarray:
    """Finds which pieces (rows) pass by a robot (column) too closely to touch it, (N, robots)."""
    owner = _find_owners(scene, model)
    passes = np.zeros((len(nodes) - 1, len(scene.robots)), dtype=bool)
    for k, robot in enumerate(scene.robots):
        own = np.flatnonzero(owner == k)
        arc = OWN_ARC * compute_radius(model, data, model.site(robot.site).id, own)
        low, high = robot.arc_length - arc, robot.arc_length + arc
        passes[:, k] = (nodes[1:] > low) & (nodes[:-1] < high)
    return passes


def _find_owners(scene: Scene, model: mujoco.MjModel) -> np.ndarray:
    """Number of the robot that each geom belongs to, -1 for none, (ngeom,)."""
    owner = np.full(model.ngeom, -1)
    for k, robot in enumerate(scene.robots):
        root = model.body_rootid[model.site_bodyid[model.site(robot.site).id]]
        owner[model.body_rootid[model.geom_bodyid] == root] = k
    return owner
