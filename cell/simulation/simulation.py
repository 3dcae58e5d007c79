"""Steps a cell through phases: commands in, readings out, a verdict when one fails."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from cell.builder import Cell
from cell.errors import CellError
from cell.fixtures.soft_jig import JigState
from cell.machines.arm import Arm
from cell.machines.sensors import PoseSensor
from cell.simulation.log import Log
from cell.simulation.phase import ArmCommand, Follow, Impedance, Outcome, Phase, PhaseFailed, Sensed

# Damping of the Cartesian impedance uses these effective masses: dominated by the reflected rotor
# inertia of 0.1 kg m^2 at a lever of 0.15 to 0.4 m [D].
EFFECTIVE_MASS = 5.0
EFFECTIVE_INERTIA = 0.15


class Simulation:
    """A running cell.

    Args:
        cell: A built cell (with its diagram).
        seed: Seeds the sensor noise.

    Attributes:
        root: Context of the diagram.
        context: Context of the plant.
        sensor: Where operations learn where parts are.
        log: What happened, every ``simulation.log_period``.
        stepping_cpu: CPU seconds spent stepping so far.
        wrists: By arm name, the latest reading (6,) [N m, N] of the wrist.
        tare: By arm name, the reading that counts as zero.
    """

    def __init__(self, cell: Cell, seed: int = 0) -> None:
        if cell.diagram is None:
            raise CellError(
                "The cell has no diagram: use build_cell, or build your own and pass it."
            )
        self.cell = cell
        self.simulator = Simulator(cell.diagram)
        self.root: Context = self.simulator.get_mutable_context()
        self.context = cell.plant.GetMyMutableContextFromRoot(self.root)
        rng = np.random.default_rng(seed)
        noise = cell.config.sensor
        self.sensor = PoseSensor(
            cell.parts, noise.position_noise, np.deg2rad(noise.angle_noise_deg), rng
        )
        self.log = Log()
        self.stepping_cpu = 0.0
        self.steps = 0
        self._bed_pushes = False
        cell.reset(self.root)
        self.simulator.Initialize()
        self.wrists = {name: sensor.read(self.context) for name, sensor in cell.wrists.items()}
        self.tare = dict(self.wrists)

    @property
    def time_step(self) -> float:
        """Time step of the plant [s]."""
        return self.cell.config.simulation.time_step

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.time_step

    def sense(self, part: str) -> RigidTransform:
        """Return the sensed pose X_WP of a part."""
        return self.sensor.read(self.context, part)

    def step(self) -> None:
        """Advance plant and jig by one time step."""
        start = time.process_time()
        self.steps += 1
        self.simulator.AdvanceTo(self.time)
        self.cell.soft_jig.step(self.root, self.time_step)
        self.apply_bed_forces()
        self.stepping_cpu += time.process_time() - start

    def apply_bed_forces(self) -> None:
        """Hand the soft bed's forces to the plant for the next step."""
        forces = self.cell.soft_jig.applied_forces
        if forces or self._bed_pushes:
            port = self.cell.plant.get_applied_spatial_force_input_port()
            port.FixValue(self.context, forces)
            self._bed_pushes = bool(forces)

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
        while True:
            run.command()
            try:
                self.step()
            except RuntimeError as error:
                message = str(error).splitlines()[0]
                raise PhaseFailed(phase.name, f"solver failure: {message}") from error
            if phase.every_step is not None:
                phase.every_step(self)
            sensed = run.sense()
            reason = phase.guard(sensed) if phase.guard else None
            if reason:
                raise PhaseFailed(phase.name, reason)
            if phase.until(sensed):
                run.finish()
                return Outcome(sensed, run.peak_force)
            if sensed.time > phase.timeout:
                raise PhaseFailed(phase.name, f"end condition not met in {phase.timeout:g} s")


class _PhaseRun:
    """The moving state of one phase: step count, peaks."""

    def __init__(self, simulation: Simulation, phase: Phase) -> None:
        self.simulation, self.phase = simulation, phase
        self.cell, self.root = simulation.cell, simulation.root
        self.step = 0
        self.commands = {"left": phase.left, "right": phase.right}
        self.peak_force = {"left": 0.0, "right": 0.0}
        period = self.cell.config.simulation.log_period
        self.log_every = max(1, round(period / simulation.time_step))
        if phase.tare:
            simulation.tare = dict(simulation.wrists)
        self.last: Sensed | None = None
        if phase.jaw is not None:
            self.cell.gripper.command(self.root, phase.jaw.opening, phase.jaw.force)
        if phase.spindle is not None:
            self.cell.driver.command(self.root, phase.spindle)
        for name, command in self.commands.items():
            arm = self.cell.arms[name]
            if isinstance(command, Impedance):
                arm.use_torque_drive()
            elif arm.in_torque_drive():
                self._hold_here(arm)

    def _hold_here(self, arm: Arm) -> None:
        """Back from torque to position drive, with the target where the arm is."""
        arm.use_position_drive()
        drive = self.cell.drives[arm.name]
        drive.set_effort(self.root, np.zeros(6))
        drive.set_target(self.root, arm.positions(self.simulation.context), np.zeros(6))

    def command(self) -> None:
        """Send this step's command to each arm."""
        for name, command in self.commands.items():
            if command is not None:
                self._command_arm(self.cell.arms[name], command)

    def _command_arm(self, arm: Arm, command: ArmCommand) -> None:
        drive = self.cell.drives[arm.name]
        if isinstance(command, Follow):
            if self.last is not None:
                drive.set_target(self.root, *command.target(self.last))
        elif not isinstance(command, Impedance):
            # The implicit drive reaches the target at the end of the step.
            drive.set_target(self.root, *command.at(self._time() + self.simulation.time_step))
        else:
            torque = impedance_torque(arm, self.simulation.context, command, self._time())
            drive.set_effort(self.root, torque)

    def _time(self) -> float:
        return self.step * self.simulation.time_step

    def sense(self) -> Sensed:
        """Read the sensors after a step, and log if it is time."""
        self.step += 1
        cell, context, simulation = self.cell, self.simulation.context, self.simulation
        simulation.wrists = {name: sensor.read(context) for name, sensor in cell.wrists.items()}
        wrench = {name: now - simulation.tare[name] for name, now in simulation.wrists.items()}
        for name, value in wrench.items():
            self.peak_force[name] = max(self.peak_force[name], float(np.linalg.norm(value[3:])))
        self.last = Sensed(
            time=self._time(),
            step=self.step,
            wrench=wrench,
            jaw_opening=cell.gripper.opening(context),
            jaw_rate=cell.gripper.rate(context),
            bit_push=cell.driver.push(context),
            spindle_torque=cell.driver.torque(context),
            spindle_rate=cell.driver.rate(context),
            finished=self._motions_finished(),
            X_WF=lambda frame: frame.CalcPoseInWorld(context),
            X_WP=lambda name: cell.parts[name].X_WP(context),
        )
        if self.phase.fine_log or self.simulation.steps % self.log_every == 0:
            self._log(self.last)
        return self.last

    def _motions_finished(self) -> bool:
        commands = [c for c in self.commands.values() if c is not None]
        motions = [c for c in commands if not isinstance(c, Follow | Impedance)]
        return all(self._time() >= motion.duration for motion in motions)

    def _log(self, sensed: Sensed) -> None:
        cell, context = self.cell, self.simulation.context
        q, v = cell.plant.GetPositions(context), cell.plant.GetVelocities(context)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise PhaseFailed(self.phase.name, "the state is not finite")
        self.simulation.log.append(
            time=self.simulation.time,
            q=q,
            v=v,
            left_wrench=sensed.wrench["left"],
            right_wrench=sensed.wrench["right"],
            force_plate=cell.force_plate.read(context),
            jaw_opening=sensed.jaw_opening,
            spindle_torque=sensed.spindle_torque,
            jig_pressure=cell.soft_jig.pressure,
            jig_state=list(JigState).index(cell.soft_jig.state),
            thread_turns=[thread.turns(context) for thread in cell.threads.values()],
            clamp_force=[thread.clamp_force(context) for thread in cell.threads.values()],
        )

    def finish(self) -> None:
        """Leave the arms where their commands end; a motion that was cut short stops there."""
        for name, command in self.commands.items():
            arm = self.cell.arms[name]
            if arm.in_torque_drive():
                self._hold_here(arm)
            elif command is not None and not isinstance(command, Follow | Impedance):
                q, _ = command.at(self._time())
                self.cell.drives[name].set_target(self.root, q, np.zeros(6))


def impedance_torque(arm: Arm, context: Context, command: Impedance, t: float) -> np.ndarray:
    """Joint torques (6,) of a Cartesian impedance with critical damping, in the axes of W."""
    X_WC = command.frame.CalcPoseInWorld(context) @ command.X_FC
    X_WD = command.X_WD(t)
    jacobian = arm.jacobian(context, command.frame, command.X_FC.translation())
    turn = (X_WD.rotation() @ X_WC.rotation().inverse()).ToAngleAxis()
    error = np.concatenate([turn.angle() * turn.axis(), X_WD.translation() - X_WC.translation()])
    spring = np.clip(command.stiffness * error, -command.limit, command.limit)
    mass = np.repeat([EFFECTIVE_INERTIA, EFFECTIVE_MASS], 3)
    damping = 2.0 * np.sqrt(command.stiffness * mass)
    wrench = spring - damping * (jacobian @ arm.velocities(context)) + command.bias
    return np.clip(jacobian.T @ wrench, -arm.effort_limits, arm.effort_limits)
