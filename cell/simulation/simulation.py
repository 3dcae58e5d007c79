"""Steps a cell through phases: commands in, readings out, a verdict when one fails."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.errors import InputError, UnknownName
from cell.machines.arm import Arm
from cell.machines.driver import Driver
from cell.machines.gripper import Gripper
from cell.machines.sensors import read_all
from cell.simulation.identity import identity_of
from cell.simulation.log import Log
from cell.simulation.phase import (
    ArmCommand,
    Command,
    Follow,
    Impedance,
    Jaw,
    Outcome,
    Phase,
    PhaseFailed,
    Sensed,
    SolverFailed,
    Spin,
    what_is_missing,
)

# Damping of the Cartesian impedance uses these effective masses: dominated by the reflected rotor
# inertia of 0.1 kg m^2 at a lever of 0.15 to 0.4 m [D].
EFFECTIVE_MASS = 5.0
EFFECTIVE_INERTIA = 0.15
IN_BIT = " in bit"  # After the name of a bolt: the signal that the bit is in its socket.
# Of what an arm with more than six joints can do without moving its hand [N m s/rad] [A].
SELF_MOTION_DAMPING = 10.0


class Simulation:
    """A running cell, at first with every part asleep.

    Args:
        cell: A built cell (with its diagram).

    Attributes:
        simulator: Drake's, with the cell's monitor.
        root: Context of the diagram.
        context: Context of the plant.
        log: What happened, every ``simulation.log_period``.
        stepping_cpu: CPU seconds spent stepping so far.
        wrists: By arm name, the latest reading (6,) [N m, N] of the wrist.
        tare: By arm name, the reading that counts as zero.
    """

    def __init__(self, cell: Cell) -> None:
        if cell.diagram is None:
            raise InputError(
                "The cell has no diagram: use build_cell, or cell.with_diagram(builder.Build())."
            )
        self.cell = cell
        self.simulator = Simulator(cell.diagram)
        self.simulator.set_monitor(cell.monitor)
        self.root: Context = self.simulator.get_mutable_context()
        self.context = cell.plant.GetMyMutableContextFromRoot(self.root)
        self.log = Log()
        self.stepping_cpu = 0.0
        cell.monitor.initialize(self.root)
        cell.parts.sleep_all_but(self.root, ())
        self.simulator.Initialize()
        self.wrists = self.read_wrists()
        self.tare = dict(self.wrists)

    @property
    def time_step(self) -> float:
        """Time step of the plant [s]."""
        return self.cell.config.simulation.time_step

    @property
    def steps(self) -> int:
        """Plant steps so far, whoever advanced the simulator."""
        return self.cell.monitor.counter.seen(self.root)

    @property
    def time(self) -> float:
        """Simulated time after the latest step [s]."""
        return self.steps * self.time_step

    @cached_property
    def identity(self) -> dict[str, str]:
        """What a saved state of this run holds for."""
        return identity_of(self.cell)

    def step(self) -> None:
        """Advance by one time step of the plant."""
        start = time.process_time()
        self.simulator.AdvanceTo((self.steps + 1) * self.time_step)
        self.stepping_cpu += time.process_time() - start

    def read_wrists(self) -> dict[str, np.ndarray]:
        """Return the reading (6,) of each wrist [N m, N], by arm name."""
        wrists = [arm.wrist for arm in self.cell.arms.values()]
        return dict(zip(self.cell.arms, read_all(wrists, self.context), strict=True))

    def run(self, phases: Iterable[Phase]) -> None:
        """Run an operation: a generator of phases that receives each `Outcome` back."""
        operation = iter(phases)
        send = getattr(operation, "send", lambda _: next(operation))
        outcome = None
        while True:
            try:
                phase = send(outcome)
            except StopIteration:
                return
            outcome = self.run_phase(phase)

    def run_phase(self, phase: Phase) -> Outcome:
        """Run one phase to its end.

        Raises:
            PhaseFailed: Time out, guard, solver failure or a state that is not finite.
        """
        self.log.phases.append((phase.name, self.time))
        self.cell.parts.sleep_all_but(self.root, phase.awake)
        for event in phase.start:
            event(self)
        run = _PhaseRun(self, phase)
        self.cell.links.intend(self.root, phase.mating, phase.riding)
        while True:
            run.command()
            try:
                self.step()
            except RuntimeError as error:
                message = str(error).splitlines()[0]
                raise SolverFailed(phase.name, f"solver failure: {message}") from error
            if phase.every_step is not None:
                phase.every_step(self)
            sensed = run.sense()
            reason = phase.guard(sensed) if phase.guard else None
            if reason:
                raise PhaseFailed(phase.name, reason)
            if phase.until(sensed):
                run.finish()
                kept = replace(sensed, grippers=dict(sensed.grippers), drivers=dict(sensed.drivers))
                return Outcome(kept, run.peak_force)
            if sensed.time > phase.timeout:
                missing = what_is_missing(phase.until, sensed)
                evidence = f"end condition not met in {phase.timeout:g} s"
                raise PhaseFailed(phase.name, f"{evidence}: {missing}" if missing else evidence)


class WhenRead[Reading](Mapping[str, Reading]):
    """Readings of sensors, computed when they are read: once, and before the next step.

    Args:
        read: Returns the reading of a device.
        names: Of the devices.
    """

    def __init__(self, read: Callable[[str], Reading], names: Iterable[str]) -> None:
        self._read, self._names = read, tuple(names)
        self._known: dict[str, Reading] = {}

    def __getitem__(self, name: str) -> Reading:
        if name not in self._known:
            self._known[name] = self._read(name)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class _PhaseRun:
    """The moving state of one phase: step count, peaks."""

    def __init__(self, simulation: Simulation, phase: Phase) -> None:
        self.simulation, self.phase = simulation, phase
        self.cell, self.root = simulation.cell, simulation.root
        self.step = 0
        self.peak_force = dict.fromkeys(self.cell.arms, 0.0)
        period = self.cell.config.simulation.log_period
        self.log_every = max(1, round(period / simulation.time_step))
        self.last: Sensed | None = None
        self.tools = {arm.tool.name: arm.tool for arm in self.cell.arms.values()}
        tools = self.tools.items()
        self.grippers = {name: tool for name, tool in tools if isinstance(tool, Gripper)}
        self.drivers = {name: tool for name, tool in tools if isinstance(tool, Driver)}
        self.arm_commands: dict[str, ArmCommand] = {}
        if phase.tare:
            simulation.tare = dict(simulation.wrists)
        for device, command in phase.commands.items():
            self._accept(device, command)
        for name, arm in self.cell.arms.items():
            if isinstance(self.arm_commands.get(name), Impedance):
                arm.drive.use_torque(self.root, True)
            elif arm.drive.uses_torque(self.root):
                arm.hold_here(self.root)

    def _accept(self, device: str, command: Command) -> None:
        """Pass a tool's command on; keep an arm's for every step."""
        tool = self.tools.get(device)
        if isinstance(command, Jaw) and isinstance(tool, Gripper):
            tool.command(self.root, command.opening, command.force)
        elif isinstance(command, Spin) and isinstance(tool, Driver):
            tool.command(self.root, command.speed)
        elif not isinstance(command, Jaw | Spin) and device in self.cell.arms:
            self.arm_commands[device] = command
        elif device in self.tools or device in self.cell.arms:
            kind = type(command).__name__
            raise InputError(f"Device '{device}' does not take a {kind} command.")
        else:
            raise UnknownName("device", device, [*self.tools, *self.cell.arms])

    def command(self) -> None:
        """Send this step's command to each arm."""
        time_step = self.simulation.time_step
        for name, command in self.arm_commands.items():
            arm = self.cell.arms[name]
            if isinstance(command, Follow):
                if self.last is not None:
                    q, v = command.target(self.last)
                    self._check(name, q, v)
                    arm.drive.set_target(self.root, q, v)
            elif isinstance(command, Impedance):
                now = self.step * time_step
                torque = impedance_torque(arm, self.simulation.context, command, now)
                self._check(name, torque)
                arm.drive.set_effort(self.root, torque)
            else:
                # The implicit drive reaches the target at the end of the step.
                now = self.step * time_step
                q, v = command.at(now + time_step)
                self._check(name, q, v)
                arm.drive.set_target(self.root, q, v)

    def _check(self, arm: str, *values: np.ndarray) -> None:
        """Refuse a command that is no number, before it makes the whole state none."""
        if not all(np.isfinite(value).all() for value in values):
            raise PhaseFailed(self.phase.name, f"the command for the {arm} arm is not finite")

    def sense(self) -> Sensed:
        """Read the sensors after a step, and log if it is time."""
        self.step += 1
        context, simulation = self.simulation.context, self.simulation
        simulation.wrists = simulation.read_wrists()
        wrench = {name: now - simulation.tare[name] for name, now in simulation.wrists.items()}
        for name, value in wrench.items():
            self.peak_force[name] = max(self.peak_force[name], math.hypot(*value[3:]))
        now = self.step * simulation.time_step
        motions = [c for c in self.arm_commands.values() if not isinstance(c, Follow | Impedance)]
        self.last = Sensed(
            time=now,
            step=self.step,
            wrench=wrench,
            grippers=WhenRead(lambda name: self.grippers[name].read(context), self.grippers),
            drivers=WhenRead(lambda name: self.drivers[name].read(context), self.drivers),
            finished=all(now >= motion.duration for motion in motions),
            X_WF=lambda frame: frame.CalcPoseInWorld(context),
            signal=self._signal,
            lacking=lambda: self.cell.fixture.lacking(self.root),
        )
        if self.phase.fine_log or simulation.steps % self.log_every == 0:
            self._log(self.last)
        return self.last

    def _signal(self, name: str) -> bool:
        """Return what the fixture, or the sensor in the bit, says."""
        fixture, threads, root = self.cell.fixture, self.cell.threads, self.root
        says = {"fixture fixed": fixture.fixed, "fixture freed": fixture.freed}
        if name in says:
            return says[name](root)
        bolt = name.removesuffix(IN_BIT)
        if bolt == name:
            raise UnknownName("signal", name, [*says, *(f"{bolt}{IN_BIT}" for bolt in threads)])
        return threads.bit_engaged(root, bolt)

    def _log(self, sensed: Sensed) -> None:
        cell, context, root = self.cell, self.simulation.context, self.root
        q, v = cell.plant.GetPositions(context), cell.plant.GetVelocities(context)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise PhaseFailed(self.phase.name, "the state is not finite")
        self.simulation.log.append(
            time=self.simulation.time,
            q=q,
            v=v,
            **{f"{name}_wrench": wrench for name, wrench in sensed.wrench.items()},
            force_plate=cell.force_plate.read(context),
            **{f"{name}_opening": reading.opening for name, reading in sensed.grippers.items()},
            **{f"{name}_torque": reading.torque for name, reading in sensed.drivers.items()},
            **{f"jig_{name}": value for name, value in cell.fixture.reading(root).items()},
            thread_turns=[cell.threads.turns(root, bolt) for bolt in cell.threads],
            clamp_force=[cell.threads[bolt].clamp_force(context) for bolt in cell.threads],
            links=len(cell.links.memory(root).installed),
        )

    def finish(self) -> None:
        """Leave the arms where their commands end; a motion that was cut short stops there."""
        for name, command in self.arm_commands.items():
            arm = self.cell.arms[name]
            if arm.drive.uses_torque(self.root):
                arm.hold_here(self.root)
            elif not isinstance(command, Follow | Impedance):
                q, _ = command.at(self.step * self.simulation.time_step)
                arm.drive.set_target(self.root, q, np.zeros(arm.dof))


def impedance_torque(arm: Arm, context: Context, command: Impedance, t: float) -> np.ndarray:
    """Joint torques (n,) of a Cartesian impedance with critical damping, in the axes of W.

    An arm with more joints than six is damped where it can move without moving the hand.
    """
    X_WC = command.frame.CalcPoseInWorld(context) @ command.X_FC
    X_WD = command.X_WD(t)
    jacobian = arm.jacobian(context, command.frame, command.X_FC.translation())
    v = arm.velocities(context)
    turn = (X_WD.rotation() @ X_WC.rotation().inverse()).ToAngleAxis()
    error = np.concatenate([turn.angle() * turn.axis(), X_WD.translation() - X_WC.translation()])
    spring = np.clip(command.stiffness * error, -command.limit, command.limit)
    mass = np.repeat([EFFECTIVE_INERTIA, EFFECTIVE_MASS], 3)
    damping = 2.0 * np.sqrt(command.stiffness * mass)
    wrench = spring - damping * (jacobian @ v) + command.bias
    torque = jacobian.T @ wrench
    if arm.dof > 6:
        still = np.eye(arm.dof) - np.linalg.pinv(jacobian) @ jacobian
        torque -= SELF_MOTION_DAMPING * still @ v
    return np.clip(torque, -arm.effort_limits, arm.effort_limits)
