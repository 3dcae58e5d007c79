"""A program as URScript, one file per arm of Universal Robots.

Both arms go through all phases. At the start of each they wait for each other; then the arm whose
devices a phase commands or reads carries it out, and watches its end condition and its guard.

A script is made for a cell like the twin's, and not tried on a robot. What a UR has no command for
is approximated: an impedance by force mode about the tool, with the forces of the twin's springs at
their limits; the servo of the driver's feed by force mode along the tool. Gripper, spindle, fixture
and the handshake of the arms are functions at the top of the file, for the integrator to fill in.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cell.builder import Cell
from cell.machines.arm import Arm
from cell.simulation.phase import Follow, Impedance, Jaw, Spin
from cell.simulation.vocabulary import from_data
from experiments.assembly.urscript_conditions import Dialect, ends, fails, numbers, pose_text
from planning.motion.timing import JointMotion

PERIOD = 0.02  # Between two points that the robot is led through [s] [A].
HEADER = """\
  # Fill in for the devices of the cell; forces in N, openings in m, speeds in rad/s.
  def jaw(opening, grip):
    textmsg("jaw to ", opening)
  end
  def jaw_opening():
    return 0.0
  end
  def spindle(speed):
    textmsg("spindle at ", speed)
  end
  def spindle_torque():
    return 0.0
  end
  def spindle_push():
    return 0.0
  end
  def fixture(order):
    textmsg("fixture: ", order)
  end
  def signal(name):
    return False
  end
  # The handshake: each arm says which phase it has come to, and waits for the other one.
  def meet(phase):
    write_output_integer_register(0, phase)
    while read_input_integer_register(0) < phase:
      sync()
    end
  end
  # Clock, memory of what is steady, and how a phase goes on.
  global clock = 0.0
  global over = False
  global steady_last = [0.0, 0.0, 0.0]
  global steady_since = 0.0
  def restart():
    clock = 0.0
    over = False
    steady_last = [1000000.0, 0.0, 0.0]
    steady_since = 0.0
  end
  def steady(value, band, duration):
    local x = value[0] - steady_last[0]
    local y = value[1] - steady_last[1]
    local z = value[2] - steady_last[2]
    if sqrt(x * x + y * y + z * z) > band:
      steady_last = value
      steady_since = clock
    end
    return clock - steady_since >= duration
  end
  def felt(axis):
    local wrench = get_tcp_force()
    return wrench[axis]
  end
  def felt_force():
    return sqrt(felt(0) * felt(0) + felt(1) * felt(1) + felt(2) * felt(2))
  end
  def height(point):
    local there = pose_trans(pose_trans(base_in_world, get_actual_tcp_pose()), point)
    return there[2]
  end
  def give_up(reason):
    textmsg("failed: ", reason)
    halt
  end
"""


def urscript(cell: Cell, arm: Arm, program: Mapping[str, Any]) -> str:
    """Return the script of one arm.

    Args:
        cell: That the program was made for.
        arm: One of its arms.
        program: Data of the program.
    """
    X_WB = cell.plant.GetFrameByName("base_link", arm.instance).CalcPoseInWorld(
        cell.plant.CreateDefaultContext()
    )
    dialect = Dialect(cell, arm)
    lines = [f"def {_name(program['product'])}_{_name(arm.name)}():"]
    lines.append("  set_tcp(p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0])")
    lines.append(f"  global base_in_world = {pose_text(X_WB)}")
    lines += HEADER.splitlines()
    phases = [phase for step in program["steps"] for phase in step["phases"]]
    for number, phase in enumerate(phases, start=1):
        lines += ["  " + line for line in _phase(cell, dialect, program, phase, number)]
    lines += ["end", ""]
    return "\n".join(lines)


def _name(text: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in text)


def _phase(
    cell: Cell, dialect: Dialect, program: Mapping[str, Any], phase: Mapping[str, Any], number: int
) -> Iterator[str]:
    """Yield the lines of a phase for one arm."""
    arm, plant = dialect.arm, cell.plant
    commands = {
        device: from_data(program["commands"][row], plant)
        for device, row in phase["commands"].items()
    }
    own = {device: command for device, command in commands.items() if device in dialect.devices}
    until, guard = from_data(phase["until"], plant), from_data(phase["guard"], plant)
    yield f"# {number}: {phase['name']}"
    yield f"meet({number})"
    watches = dialect.reads(until) or dialect.reads(guard)
    if not own and not watches and (commands or arm is not cell.holder):
        return  # The other arm's, or, where no arm is told anything, the holder's.
    if phase["tare"]:
        yield "zero_ftsensor()"
    for event in phase["start"]:
        order = f"{event['is']} {event.get('part', '')}".strip()
        yield f'fixture("{order}")'
    yield "restart()"
    motion = next((c for c in own.values() if isinstance(c, JointMotion)), None)
    duration = motion.duration if motion is not None else 0.0
    yield f"def go_on_{number}(finished):"
    yield f"  clock = clock + {PERIOD}"
    for condition, reason in fails(dialect, guard):
        yield f"  if {condition}:"
        yield f'    give_up("{phase["name"]}: {reason}")'
        yield "  end"
    yield f"  if {ends(dialect, until)}:"
    yield "    over = True"
    yield f"  elif clock > {phase['timeout']:.3f}:"
    yield f'    give_up("{phase["name"]}: end condition not met")'
    yield "  end"
    yield "end"
    for command in own.values():
        if isinstance(command, Jaw):
            yield f"jaw({command.opening:.6f}, {command.force:.3f})"
        elif isinstance(command, Spin):
            yield f"spindle({command.speed:.4f})"
        elif isinstance(command, Impedance):
            yield from _force_mode(-command.limit[5], [1, 1, 1, 1, 1, 0])
        elif isinstance(command, Follow):
            thrust = getattr(command.target, "thrust", 0.0)
            yield from _force_mode(-thrust, [0, 0, 1, 0, 0, 0])
    if motion is not None:
        for time in np.arange(PERIOD, duration + PERIOD, PERIOD):
            q, _ = motion.at(float(time))
            yield "if not over:"
            yield f"  servoj({numbers(q)}, 0, 0, {PERIOD}, 0.05, 500)"
            yield f"  go_on_{number}(False)"
            yield "end"
    yield "while not over:"
    yield f"  sleep({PERIOD})"
    yield f"  go_on_{number}(True)"
    yield "end"
    if any(isinstance(command, Impedance | Follow) for command in own.values()):
        yield "end_force_mode()"
    elif motion is not None:
        yield "stopj(2.0)"


def _force_mode(force: float, axes: list[int]) -> Iterator[str]:
    """Yield the command to press along z of the base [N], and to comply along some axes."""
    press = numbers([0.0, 0.0, force, 0.0, 0.0, 0.0])
    limits = numbers([0.05, 0.05, 0.05, 0.2, 0.2, 0.2])  # Speeds [m/s, rad/s] [A].
    frame = numbers(np.zeros(6))
    yield f"force_mode(p{frame}, {axes}, {press}, 2, {limits})"
