"""When bolts count as placed: on their threads, or loose in their holes."""

from planning.operations.limits import BASE_STAYS, CAPTIVE, LEANING, LOOSE, Limit, standing_limits

IN_HOLE = "3 mm of shank are in the hole at least: what is below it, such as the bed, may lift it"
LIMITS = (*standing_limits("parts"), *BASE_STAYS)
LOOSE_LIMITS = (
    Limit("protrusion_m", 7e-3, IN_HOLE, each="parts"),
    Limit("off_hole_m", 5e-4, CAPTIVE, each="parts"),
    Limit("lean_rad", LEANING, LOOSE, each="parts"),
    *BASE_STAYS,
)
