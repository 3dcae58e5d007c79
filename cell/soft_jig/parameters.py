"""Every number of the soft jig, with its unit, source and range.

Source tags: [S] the paper, [R] read in the source named, [M] measured on public CAD,
[D] derived from stated inputs, [A] assumption. "DEM" is the project's discrete-element reference
run with glass beads in a dome of the same size.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cell.errors import CellError

# Vacuum at which stiffness and suction of the frozen bed are stated [Pa]; [S] about 90 kPa.
FULL_VACUUM = 90e3


class BadJig(CellError):
    """Numbers of the jig that contradict each other."""


def positive(default: float) -> Any:
    """Declare a field that must be above zero."""
    return field(default=default, metadata={"positive": True})


@dataclass(frozen=True)
class BagParameters:
    """The bag at rest: a spherical cap of beads under a silicone membrane.

    Attributes:
        cap_radius: Radius of the sphere the cap is cut from [m]. [S] about 60 mm.
        cap_height: Apex above the base plate [m]. [D] from 296 cm3 [S] and the radius.
        cell: Edge of a height-field cell [m]. [A] 1-3 mm; 1.5 resolves the motor's terminals.
        floor: Least thickness of beads over the base plate [m]. [A] three 1 mm beads.
        bead_volume: Of all beads [m3]. [D] 450 g of glass at 2500 kg/m3 [S]: 61 % of the bare cap;
            range 173e-6 to 184e-6.
    """

    cap_radius: float = positive(0.060)
    cap_height: float = positive(0.0459)
    cell: float = positive(0.0015)
    floor: float = positive(0.003)
    bead_volume: float = positive(180e-6)

    def __post_init__(self) -> None:
        if self.cap_height >= 2 * self.cap_radius:
            raise BadJig(
                f"The bag cannot be {self.cap_height:g} m high (jig.bag.cap_height): the sphere "
                f"that it is cut from measures {2 * self.cap_radius:g} m (2 jig.bag.cap_radius)."
            )

    @property
    def aperture_radius(self) -> float:
        """Radius of the opening that the cap rises from [m]; [D] 58.3 mm."""
        return float(np.sqrt(self.cap_height * (2 * self.cap_radius - self.cap_height)))

    @property
    def volume(self) -> float:
        """Volume of the cap [m3]; [D] 296 cm3."""
        return float(np.pi * self.cap_height**2 * (self.cap_radius - self.cap_height / 3))


@dataclass(frozen=True)
class SoilParameters:
    """Beads and membrane while soft: an elastic-plastic bed with stretch hardening.

    Attributes:
        friction_angle: Of the beads [rad]. [R] DEM 23-27 deg; 25 deg, range 22-28.
        bead_weight: Bulk weight gamma [N/m3]. [D] 450 g in 296 cm3 [S].
        gravity_pressure: Mean confinement by the beads' own weight [Pa]. [D] 250, range 200-420.
        membrane_modulus: Shear modulus times thickness [N/m]. [R] 0.15 MPa x 1 mm; 100-150.
        initial_stretch: Stretch of the membrane on the bare cap. [A] 1.02, range 1.00-1.05.
        stiffness: Elastic Winkler modulus [Pa/m]. [A] 3e7, range 1e7-1.5e8; what a step of 1 ms
            nearly carries under a free 68 g plate, and bounded where it does not
            (`cell.soft_jig.stable`). It springs back 0.3 mm where DEM gives below 0.06 mm.
        damping: Viscous part of the contact pressure and of the friction [Pa s/m]. [A] 1e4,
            numerical, below 2 % of the yield pressure at 10 mm/s.
        recovery_time: Of the damper beside the spring [s]: the bed gives back its elastic part in
            this time and throws nothing off. [A] 50 ms, range 20-200; beads return little energy.
        viscosity: Overstress per plastic sinking speed [Pa s/m]. [A] 5e4, 0.5 kPa at 10 mm/s;
            DEM finds no rate effect at 10-80 mm/s, so keep it small.
        shear_stiffness: Tangential Winkler modulus of the membrane [Pa/m]. [A] 3e7; the 1 mm
            silicone sheet alone gives 1.5e8 [D], too stiff for an explicit step.
        surface_friction: Silicone on metal. [R] 0.6-1.3; 0.9.
        collar_place: Distance from the part's rim at which displaced beads rise most [m]. [R] 16 mm
            in the DEM's rigid cup, 30 mm on the flanks of its free dome; range 16-30.
        shoulder_share: How far the bed at a part's rim sinks with it, relative. [R] 0.85 in the
            DEM dome, which has no membrane, next to 0 in its rigid cup; range 0-0.85. [A] 0,
            for a practical reason and not by evidence: with 0.85 a press of 20 N finds no end, and
            leaning plates cannot be meshed. It would lower the walls.
        shoulder_length: Decay of the shoulder relative to the radius of the contact. [R] 0.33 (5.8
            mm beside the 17.5 mm punch in the DEM dome).
        dilation_limit: Volume that the beads gain by shear in the end [m3]. [R] DEM cup 7e-6, 2.4 %
            of the bag; range 0-7e-6.
        dilation_scale: Displaced volume over which they do [m3]. [R] 6.6e-6; with the limit it
            gives raised over displaced volume 1.75 / 1.56 / 1.43 at 5 / 10 / 15 mm, as DEM.
        packing_slack: Volume the packing takes up before the collar rises [m3]. [A] 0; the fill
            allows 0-12e-6 [D], but DEM beds dilate rather than compact.
        settle_period: Time between two redistributions of displaced volume [s]. [A]
    """

    friction_angle: float = positive(float(np.radians(25.0)))
    bead_weight: float = positive(1520.0 * 9.81)
    gravity_pressure: float = 250.0
    membrane_modulus: float = 150.0
    initial_stretch: float = positive(1.02)
    stiffness: float = positive(3.0e7)
    damping: float = 1.0e4
    recovery_time: float = 0.050
    viscosity: float = positive(5.0e4)
    shear_stiffness: float = 3.0e7
    surface_friction: float = 0.9
    collar_place: float = positive(0.016)
    shoulder_share: float = 0.0
    shoulder_length: float = 0.33
    dilation_limit: float = 7.0e-6
    dilation_scale: float = positive(6.6e-6)
    packing_slack: float = 0.0
    settle_period: float = 0.010

    @property
    def overburden_factor(self) -> float:
        """Bearing factor Nq of a strip on a cohesionless bed (Prandtl-Reissner)."""
        tangent = np.tan(self.friction_angle)
        return float(np.exp(np.pi * tangent) * np.tan(np.pi / 4 + self.friction_angle / 2) ** 2)

    @property
    def cohesion_factor(self) -> float:
        """Bearing factor Nc = (Nq - 1) / tan(phi); 20.7 at 25 deg."""
        return float((self.overburden_factor - 1) / np.tan(self.friction_angle))


@dataclass(frozen=True)
class VacuumParameters:
    """The pump.

    Attributes:
        pressure: Confining pressure when pumped out [Pa]. [S] about 90 kPa.
        time_constant: First-order response [s]. [D] 0.25, range 0.23-0.70 for 30-10 L/min.
        jam_fraction: Part of the full pressure above which the bed counts as frozen. [A] 0.95.
        contraction: Volumetric shrinkage on evacuation to 90 kPa. [R] DEM 0.4 %; below 1 % in the
            literature.
        contraction_exponent: Of the shrinkage over the vacuum. [R] DEM about 0.7.
    """

    pressure: float = 90e3
    time_constant: float = positive(0.25)
    jam_fraction: float = 0.95
    contraction: float = 0.004
    contraction_exponent: float = 0.7

    def __post_init__(self) -> None:
        if not self.jam_fraction < 1:
            raise BadJig(
                f"The bag would never freeze at {self.jam_fraction:g} of its vacuum "
                "(jig.vacuum.jam_fraction): it must be below 1."
            )

    @property
    def closing(self) -> float:
        """Return how far beads and imprint close, relative to that at 90 kPa."""
        return float((self.pressure / FULL_VACUUM) ** self.contraction_exponent)


@dataclass(frozen=True)
class JammedParameters:
    """The frozen bed: a compliant hydroelastic body.

    Attributes:
        pressure_gradient: Contact pressure per depth at 90 kPa [Pa/m]. [D] 4e8: a flat 35 mm punch
            on a half-space of E50 = 10 MPa, 2 E / (pi a (1 - nu2)); range 2e8-1.3e9 (E50 5 MPa to
            the DEM's 33 MPa). It goes with the square root of the confinement [R].
        soft_gradient: The same while not jammed, for hands that touch the bag [Pa/m]. [A] one
            tenth: stiffness of a packing goes with the square root of pressure [R].
        squeeze: Offset g of the wall from the part's outline at 90 kPa [m], negative squeezes; it
            goes with the contraction. [R] DEM dome: the dent closes by 0.05 mm in diameter; [D]
            0.4 % of volume is 0.13 % of length, 0.023 mm of a 17.5 mm radius. Range 0 to -0.04 mm;
            in a rigid cup it opens.
        friction: Membrane on metal. [R] 0.6-1.3; 0.9.
        dissipation: Hunt-Crossley [s/m]. [A] 5; 0-50 changes holding by 15 %.
        mesh_size: What the frozen bed's mesh scales with [m]. [A] numerical, 5 mm: half of it
            changes what a cylinder or the plate holds by less than 4 %.
        strength: Factor on the beads' strength while frozen; infinity never yields. [A] 1; the
            formulas for smooth walls and floors are conservative, DEM walls are weaker.
        return_depth: Excess depth at which the surface is moved for good [m]. [A] numerical: until
            then friction is too strong by what it carries, 30 % of the lateral strength.
        return_period: Least time between two such moves [s]. [A] numerical.
    """

    pressure_gradient: float = positive(4.0e8)
    soft_gradient: float = positive(4.0e7)
    squeeze: float = -0.025e-3
    friction: float = 0.9
    dissipation: float = 5.0
    mesh_size: float = positive(0.005)
    strength: float = positive(1.0)
    return_depth: float = positive(0.1e-3)
    return_period: float = 0.005

    @property
    def layer(self) -> float:
        """Depth of the pressure field's interior vertices [m]."""
        return self.mesh_size

    @property
    def ring(self) -> float:
        """Radial width of the ring of cells around the part [m].

        Twice `layer`: the interior vertices then lie as far behind the wall as below the rim, and
        both are equally stiff. Varied alone, either changes the wall's stiffness.
        """
        return 2 * self.mesh_size

    @property
    def edge(self) -> float:
        """Longest edge along the outline [m]."""
        return 2.4 * self.mesh_size


@dataclass(frozen=True)
class SuctionParameters:
    """Suction of the membrane on a part when the beads contract; wholly an assumption.

    DEM with a perfect seal holds 8 to 50 times as much as with air under the part, and decides
    whether a flat plate can be pushed. No source gives the seal of silicone on metal.

    Attributes:
        enabled: Switch: false shows every outcome with air under the part.
        strength: Suction on closed contact at 90 kPa of vacuum [Pa]. [A] 12e3, chosen with the
            paper's table of pushes in view; range 0-90e3 (DEM with a perfect seal). It goes with
            the vacuum.
        reach: Opening at which the seal is lost [m]. [A] 1 mm, the membrane's thickness.
        slip: Sliding at which the seal is lost [m]. [A] 3 mm, the width of the lip.
        lip: Width of contact that seals against an edge, hole or pin [m]. [A] 3 mm.
    """

    enabled: bool = True
    strength: float = 12.0e3
    reach: float = positive(1.0e-3)
    slip: float = positive(3.0e-3)
    lip: float = 3.0e-3

    def pressure(self, vacuum: float) -> float:
        """Return the suction on closed contact under a vacuum [Pa]."""
        return self.strength * vacuum / FULL_VACUUM if self.enabled else 0.0


@dataclass(frozen=True)
class JigParameters:
    """All of the soft jig.

    Attributes:
        visual_period: Time between two refreshes of the visible membrane while something presses
            into it [s]; infinity refreshes at changes of state only.
    """

    bag: BagParameters = field(default_factory=BagParameters)
    soil: SoilParameters = field(default_factory=SoilParameters)
    vacuum: VacuumParameters = field(default_factory=VacuumParameters)
    jammed: JammedParameters = field(default_factory=JammedParameters)
    suction: SuctionParameters = field(default_factory=SuctionParameters)
    visual_period: float = float("inf")
