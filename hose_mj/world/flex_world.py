"""`FlexWorld`: MuJoCo's 1-D flex among the bodies of a scene."""

import mujoco
import numpy as np

from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.mujoco.chain_holds import find_rows
from hose_mj.hoses.mujoco.flex_layout import FlexLayout, FlexMotion
from hose_mj.hoses.mujoco.flex_rod import add_edges, make_rod
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.mujoco_scene import PREFIX, HoseContact, Numerics
from hose_mj.world.mujoco_world import MujocoWorld
from hose_mj.world.world import check_scene


class FlexWorld(MujocoWorld):
    """Robots on point masses joined by edges (see `FlexHose`).

    The integrator is "discrete", whatever the scene says: no other takes the bending implicitly.
    The hose has no twist. Edges are soft constraints: `stretch` says how much they give. A contact
    is one of an edge, a capsule, with a geom (with a plane, of its two vertices); its force goes to
    the edge's vertices.

    Args:
        scene: checked.
        timestep: length of one step of the world (s); None for the scene's.
        segments: number of edges, at least 2; attachments that are no vertex may change it by a
            few.
        substeps: MuJoCo's steps in one of the world's.

    Raises:
        InputError: a value outside its valid set; attachments less than half an edge apart; a hose
            with drag, fittings or a rest shape.
    """

    hose_model = "flex"
    _advice = "try a smaller timestep, or more substeps"

    def __init__(
        self, scene: Scene, *, timestep: float | None = None, segments: int = 40, substeps: int = 1
    ) -> None:
        check_scene(scene)
        check_count("segments", segments, 2)
        places = (*(robot.arc_length for robot in scene.robots), 0.0)
        holds = [Hold(k, s, False) for k, s in enumerate(places)]
        length = scene.spec.length
        self._layout = FlexLayout.of_holds(length, segments, holds, clamp_correction=False)
        self._held = [int(self._layout.find_vertices(hold)[0]) for hold in holds]
        nodes = self._layout.nodes
        self._tension_places = (nodes[:-1] + nodes[1:]) / 2
        self._rest = np.zeros((len(nodes), 3))
        self._rest[:, 0] = nodes
        timestep = scene.timestep if timestep is None else timestep
        numerics = Numerics(timestep, substeps, "discrete", "sparse")
        super().__init__(scene, nodes, numerics)

    def stretch(self) -> Array:
        """Strain of the edges (K,); 0 if MuJoCo's constraints were rigid."""
        return self._read_motion().stretch()

    def _make_hose(
        self, spec: HoseSpec, contact: HoseContact, ties: dict[str, list[float]]
    ) -> mujoco.MjSpec:
        """Bending and edges are those of one flex; others over the same vertices collide."""
        masses = self._layout.compute_masses(spec.linear_density)
        maker = make_rod(spec, self._rest, masses, ties)
        changes = np.flatnonzero(np.diff(contact.bits)) + 1
        for k, run in enumerate(np.split(np.arange(len(contact.bits)), changes)):
            vertices = range(int(run[0]), int(run[-1]) + 2)
            touching = add_edges(maker, f"contact{k}", vertices, spec.outer_radius)
            contact.write(touching, int(contact.bits[run[0]]) | contact.plane_bit)
        for k, vertex in enumerate(self._held):
            maker.body(f"v{vertex}").add_site(name=f"hold{k}")
        return maker

    def _set_nodes(self, nodes: Array) -> None:
        first = self.model.jnt_qposadr[self.model.body_jntadr[self.hose_bodies[0]]]
        self.data.qpos[first : first + nodes.size] = (nodes - self._rest).ravel()

    def _read_motion(self) -> FlexMotion:
        first = self.model.jnt_qposadr[self.model.body_jntadr[self.hose_bodies[0]]]
        moved = self.data.qpos[first : first + self._rest.size].reshape(-1, 3)
        speeds = self.data.qvel[self._joints].reshape(-1, 3).copy()
        return FlexMotion(self._layout, self._rest + moved, speeds)

    def _read_tensions(self) -> Array:
        edges = find_rows(self.data, self.model.equality(f"{PREFIX}edges").id)
        return np.array(-self.data.efc_force[edges])
