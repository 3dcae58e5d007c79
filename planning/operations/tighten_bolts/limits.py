"""When bolts count as tightened."""

from planning.operations.limits import BASE_STAYS, Limit

LIMITS = (
    Limit("torque_deviation", 0.10, "what clutch drivers repeat", each="parts"),
    Limit("advance_deviation", 0.02, "the bolt follows its helix", each="parts"),
    Limit("clamp_deviation", 0.15, "against T / (K d); K scatters so", each="parts"),
    Limit("clamp_deviation_at_end", 0.15, "later bolts relax earlier ones", each="parts"),
    *BASE_STAYS,
)
