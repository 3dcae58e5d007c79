"""The kinds of random assemblies and how many there are of each, 200 in all."""

from __future__ import annotations

from collections.abc import Callable

import drafts_awkward as awkward
import drafts_fastened as fastened
import drafts_fits as fits
from assembly_drafts import Draft, Rng

KINDS: dict[str, tuple[Callable[[Rng], Draft], int]] = {
    "pegs": (fits.pegs, 17),
    "screwed cover": (fastened.screwed_cover, 16),
    "stack with nut": (fastened.stack_with_nut, 12),
    "print with clearance": (fits.print_with_clearance, 10),
    "ball in cavity": (awkward.ball_in_cavity, 4),
    "box in box": (fits.box_in_box, 8),
    "stray": (awkward.stray, 8),
    "overlapping boxes": (awkward.overlapping_boxes, 10),
    "slanted pin": (awkward.slanted_pin, 8),
    "tied pairs": (awkward.tied_pairs, 6),
    "bayonet": (awkward.bayonet, 4),
    "captured ring": (awkward.dumbbell, 4),
    "press fit": (fastened.press_fit, 8),
    "light press fit": (fastened.light_press_fit, 4),
    "snap fit": (fastened.snap_fit, 8),
    "cone in seat": (fits.cone_in_seat, 5),
    "ball in seat": (fits.ball_in_seat, 5),
    "key in keyway": (fastened.key_in_keyway, 5),
    "clip in groove": (fastened.clip_in_groove, 6),
    "shaft in bearings": (fastened.shaft_in_bearings, 5),
    "squeezed ring": (fastened.squeezed_ring, 4),
    "hinge": (fastened.hinge, 5),
    "touching edges": (awkward.touching_edges, 3),
    "thin sheets": (awkward.thin_sheets, 5),
    "thin wire": (awkward.thin_wire, 4),
    "tiny beside large": (awkward.tiny_beside_large, 3),
    "slivers": (awkward.slivers, 3),
    "meshing gears": (fits.meshing_gears, 3),
    "tapered plug": (fits.tapered_plug, 4),
    "set screw": (fastened.set_screw, 5),
    "stud with nuts": (fastened.stud_with_nuts, 4),
    "clevis with play": (fastened.clevis, 4),
}
"""Kind and number of assemblies of it, 200 in all."""
