"""`Driver`: motors bring each robot's site to a place, whatever kind of robot it is."""

import math

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.world.servos import (
    ArmServo,
    Motors,
    SlideServo,
    WheelServo,
    count_axes,
    find_motors,
    is_constant,
)
from hose_mj.world.world import World

BANDWIDTH = 60.0
"""Of the servos that move a site directly (1/s): within 10 % of a step after 0.065 s."""
BRAKING = 5.0
"""Braking (m/s^2) that stops a robot within half a cell: what the highest speed comes from."""
_DRIVABLE = (
    "motors that move its site in x and y, or two that turn parallel wheels of one body; else set "
    "world.control yourself"
)


class Driver:
    """Drives all robots of a world, each by the servo that suits its motors.

    Robots whose motors move the site itself, pucks, carriers and arms, get a servo on the site
    in x and y, and in z where the motors reach that far. Bases with two driven wheels
    steer. Motors of a robot that its servo has no use for, and all other actuators,
    keep the control that the user gives them.

    Args:
        world: with the robots.
        bandwidth: of the servos on sites (1/s).
        speed: highest speed (m/s); by default the one from which braking at 5 m/s^2 takes half a
            cell, 0.5 m/s on the thesis's floor.

    Attributes:
        world: as given.
        targets: where the sites are to be (N, 3), m; at first where they are.
        speed: highest speed (m/s).
        axes: along how many axes each robot is driven (N,): 3 or, in the plane, 2.
        wheeled: numbers of the robots that steer.

    Raises:
        InputError: an actuator that is no motor, a robot that neither servo can drive, a number
            out of range.
    """

    def __init__(
        self, world: World, *, bandwidth: float = BANDWIDTH, speed: float | None = None
    ) -> None:
        if not 0.0 < bandwidth <= 1.0 / world.timestep:
            raise InputError("bandwidth", bandwidth, f"above 0, at most {1.0 / world.timestep:g}/s")
        if speed is None:
            speed = math.sqrt(BRAKING * world.scene.cell_size)
        if not 0.0 < speed < math.inf:
            raise InputError("speed", speed, "a finite number above 0 (m/s)")
        self.world, self.speed = world, speed
        self.targets = world.site_positions()[:-1]
        self.axes = np.full(world.n_robots, 2)
        self.wheeled: tuple[int, ...] = ()
        sliding: list[Motors] = []
        servos: list[ArmServo | WheelServo | SlideServo] = []
        self._motors = find_motors(world)
        for motors in self._motors:
            chain = motors.choose(motors.in_chain)
            wheels = motors.choose(~motors.in_chain)
            axes = count_axes(world, chain)
            if axes:
                self.axes[motors.robot] = axes
                if is_constant(world, chain):
                    sliding.append(chain)
                else:
                    servos.append(ArmServo(world, chain, bandwidth, speed))
            elif WheelServo.fits(world, wheels):
                self.wheeled += (motors.robot,)
                servos.append(WheelServo(world, wheels, speed))
            else:
                names = [world.model.actuator(int(i)).name or str(i) for i in motors.ids]
                name = world.scene.robots[motors.robot].name
                raise InputError(f"motors of robot {name}", names, _DRIVABLE)
        if sliding:
            servos.append(SlideServo(world, sliding, bandwidth, speed))
        self._servos = tuple(servos)

    def drive_to(self, targets: ArrayLike) -> None:
        """Sets where the robots' sites are to be (N, 3), m; one driven in the plane ignores z.

        `InputError` is raised for another shape, or numbers that are not finite.
        """
        try:
            wanted = np.asarray(targets, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError("targets", targets, f"numbers of shape {self.targets.shape}") from None
        if wanted.shape != self.targets.shape or not np.all(np.isfinite(wanted)):
            valid = f"finite numbers of shape {self.targets.shape} (m)"
            raise InputError("targets", wanted.tolist(), valid)
        self.targets[:] = wanted

    def update(self) -> None:
        """Writes the motors' controls for the next step; to be called before each."""
        for servo in self._servos:
            servo.update(self.targets)

    def rest(self, robot: int) -> None:
        """Lets a robot's motors do nothing in the next step."""
        self.world.control[self._motors[robot].ids] = 0.0

    def compute_error(self, robot: int) -> float:
        """Returns how far a robot's site is from its target, along the axes it is driven in (m)."""
        axes, site = self.axes[robot], self.world.sites[robot]
        return float(np.linalg.norm((self.world.data.site_xpos[site] - self.targets[robot])[:axes]))

    def compute_speed(self, robot: int) -> float:
        """Returns how fast a robot's site moves, along the axes it is driven in (m/s)."""
        world = self.world
        rows = np.zeros((3, world.model.nv))
        mujoco.mj_jacSite(world.model, world.data, rows, None, int(world.sites[robot]))
        return float(np.linalg.norm((rows @ world.data.qvel)[: self.axes[robot]]))
