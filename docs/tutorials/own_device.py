"""Your own arm and gripper: a description each, registered by one line, named in the configuration.

The arm is a table of links; its kinematics follow from it. The table is also written as the arm's
SDF here; yours will come from its maker. The gripper is one that is there, on a softer spring.
"""

import tempfile
from math import pi
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator

from cell import (
    ARM_MODELS,
    GRIPPER_MODELS,
    ArmModel,
    CellConfig,
    GripperModel,
    Link,
    Product,
    build_cell,
)

FOLDER = Path(tempfile.mkdtemp())
# Origin in the link before [m], its roll, pitch and yaw there; every joint turns about its own z.
TABLE = {
    "pan": ((0.0, 0.0, 0.20), (0.0, 0.0, 0.0)),
    "lift": ((0.0, 0.0, 0.15), (-pi / 2, 0.0, 0.0)),
    "elbow": ((0.45, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "forearm": ((0.15, 0.0, 0.0), (0.0, pi / 2, 0.0)),
    "bend": ((0.0, 0.0, 0.25), (0.0, -pi / 2, 0.0)),
    "roll": ((0.10, 0.0, 0.0), (0.0, pi / 2, 0.0)),
}
MASS, MOMENT, SPEED, EFFORT = 2.0, 0.01, 3.0, 150.0  # [kg], [kg m2], [rad/s], [N m]; each link.
FLANGE_Z = 0.05  # In front of the last link's frame [m].


def link_sdf(name, parent, xyz, rpy):
    """Return a link and its joint as SDF; a real one has shapes, to be seen and touched."""
    pose = " ".join(map(str, (*xyz, *rpy)))
    return f"""
    <link name="{name}">
      <pose relative_to="{parent}">{pose}</pose>
      <inertial><mass>{MASS}</mass><inertia>
        <ixx>{MOMENT}</ixx><iyy>{MOMENT}</iyy><izz>{MOMENT}</izz>
        <ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>
      </inertia></inertial>
    </link>
    <joint name="{name}_joint" type="revolute">
      <parent>{parent}</parent><child>{name}</child>
      <axis><xyz>0 0 1</xyz><limit>
        <lower>{-pi}</lower><upper>{pi}</upper>
        <velocity>{SPEED}</velocity><effort>{EFFORT}</effort>
      </limit></axis>
    </joint>"""


parents = ["base_link", *TABLE][:-1]
rows = zip(TABLE.items(), parents, strict=True)
links = "".join(link_sdf(name, parent, *pose) for (name, pose), parent in rows)
SDF = FOLDER / "my_arm.sdf"
SDF.write_text(f"""<sdf version="1.9"><model name="my_arm">
    <link name="base_link"/>{links}
    <frame name="flange" attached_to="roll"><pose>0 0 {FLANGE_Z} 0 0 0</pose></frame>
</model></sdf>""")


class MyArm(ArmModel):
    sdf = SDF.as_uri()


class MyGripper(GripperModel):
    sdf = "hand_e"  # The model of another gripper.


HOME = (0.0, -50.0, 80.0, 0.0, 60.0, 0.0)  # [deg]
ARM_MODELS["my_arm"] = MyArm(
    name="my_arm",
    links=tuple(
        Link(n, f"{n}_joint", *pose, MASS, (0, 0, 0), (MOMENT,) * 3, -pi, pi, SPEED, EFFORT)
        for n, pose in TABLE.items()
    ),
    base_mass=0.0,
    stiffness=(1e4,) * 6,
    damping=(300.0,) * 6,
    home_deg={"gripper": HOME, "driver": HOME},
    flange_z=FLANGE_Z,
)
hand = vars(GRIPPER_MODELS["hand_e"])
GRIPPER_MODELS["my_gripper"] = MyGripper(**hand | {"name": "my_gripper", "stiffness": 5e3})

config = CellConfig.load(
    overrides={
        "arms.left.model": "my_arm",
        "arms.left.tool": "my_gripper",
        "arms.left.home_pan_deg": 0.0,
    }
)
cell = build_cell(config, Product())
arm, plant = cell.arms["left"], cell.plant
simulator = Simulator(cell.diagram)
simulator.set_monitor(cell.monitor)
simulator.Initialize()
root = simulator.get_mutable_context()
context = plant.GetMyContextFromRoot(root)

# Over the bag, jaws down: the flange's pose in the arm's base, and joint angles for it.
p_WTip = cell.X_WJ.translation() + [0.0, 0.0, cell.fixture.entry_height + 0.05]
X_WTip = RigidTransform(RotationMatrix.MakeXRotation(pi), p_WTip)
X_WF = X_WTip @ RigidTransform([0.0, 0.0, -arm.tool.model.tip_z])
solutions = arm.model.inverse(arm.config.X_WB.inverse() @ X_WF, near=arm.home)
print(f"{arm.model.name}: {len(solutions)} inverse-kinematics solutions over the bag")
arm.tool.command(root, opening=0.03, force=0.0)
for share in np.linspace(0.0, 1.0, 101):
    q = arm.home + share * (solutions[0] - arm.home)
    arm.drive.set_target(root, q, np.zeros(arm.dof))
    simulator.AdvanceTo(root.get_time() + 0.01)
simulator.AdvanceTo(root.get_time() + 0.5)
miss = np.linalg.norm(arm.frame("tip").CalcPoseInWorld(context).translation() - p_WTip)
opening = arm.tool.read(context).opening
print(f"after the way there: tip {1e3 * miss:.3f} mm off, jaws {1e3 * opening:.1f} mm open")
assert miss < 1e-4 and abs(opening - 0.03) < 1e-4
