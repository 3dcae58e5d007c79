"""A trial of the jig's design: one part is placed, pulled and pushed on a jig of stated numbers."""

from __future__ import annotations

from cell.configuration.config import CellConfig
from cell.errors import BadPart
from cell.fixtures.jig_dimensions import BEAD_MASS, JIG_MASS
from cell.fixtures.soft_jig.parameters import BagParameters
from cell.products.loading import load_product
from experiments.campaigns.trial import Outcome, Task
from experiments.paper.cases import case_named, case_seed, judged
from experiments.paper.holding import LIFT, SIDEWAYS, holding
from experiments.paper.rig.stage import Observer
from experiments.paper.rig_hand import RigBench
from experiments.paper.trial import HOVER, TrialDisturbance, check_fits, run_trial
from experiments.paper.trial_metrics import AT_REST, UPRIGHT
from experiments.paper.trial_tasks import CRITERION

RADIUS = BagParameters().cap_radius
"""Of the paper's bag [m]."""


def sized(config: CellConfig, radius: float) -> CellConfig:
    """Return the configuration with a bag of another size on a base that is made for it.

    The cap keeps its shape and its fill: lengths go with the radius, bead volume with its cube. The
    base keeps its height and is as much wider (`cell.machines.jig_base`), so its mass goes with the
    square. Numbers of the bed itself, per area or volume, are those of the material and stay.

    Args:
        config: Of a cell.
        radius: Of the sphere that the cap is cut from [m].
    """
    bag, scale = BagParameters(), radius / RADIUS
    return config.with_changes(
        {
            "jig.bag.cap_radius": radius,
            "jig.bag.cap_height": scale * bag.cap_height,
            "jig.bag.bead_volume": scale**3 * bag.bead_volume,
            "push.jig_mass": scale**2 * (JIG_MASS - BEAD_MASS) + scale**3 * BEAD_MASS,
        }
    )


def design(task: Task, *, case: str = "motor/P2/a", radius: float = RADIUS) -> Outcome:
    """Place a part with the rig, pull at it in five directions, and push it.

    Measured are the least force that pulls it out of place sideways, at most 40 N (``holding_N``),
    the same upwards (``lifting_N``), the depth of the imprint (``depth_m``), how far the jig went
    along with the push (``displacement_m``), and as 0 or 1 whether the part was placed and whether
    it was pushed by the paper's criterion. A part that was not placed is held with 0 N. The pulls
    are made on copies: the push starts from the undisturbed bed.

    Args:
        task: Product, configuration, seed. Bag, beads and mass of the jig follow from the radius.
        case: Label of a case of the push experiment.
        radius: Of the bag's sphere [m].
    """
    config, chosen = sized(task.config, radius), case_named("push", case)
    product = load_product(task.product)
    nothing = {"holding_N": 0.0, "lifting_N": 0.0, "displacement_m": 0.0}
    nothing |= {"placed": 0.0, "pushed": 0.0}
    try:
        check_fits(config, product, chosen.posture)
    except BadPart as error:
        return Outcome(False, nothing, "fit", str(error))
    bench = RigBench.build(config, product, chosen.posture)
    hand = bench.begin(TrialDisturbance.draw(config, case_seed(task.seed, case, 0)))
    borne: dict[str, float] = {}

    def pull(event: str, observer: Observer) -> None:
        if event == "placed":
            found = holding(hand.simulation, (*SIDEWAYS, LIFT))
            borne["holding_N"] = min(found[name].load for name in SIDEWAYS)
            borne["lifting_N"] = found[LIFT].load

    trial = run_trial(hand, chosen.push, pull)
    result = judged(chosen, trial)
    tilt, speed = (result.measured.get(name, 1.0) for name in ("tilt_rad", "speed_m_per_s"))
    placed = trial.placed is not None and tilt < UPRIGHT and speed < AT_REST
    measured = nothing | borne | {"placed": float(placed), "pushed": float(result.success)}
    end = trial.placed or trial.moved
    if end is not None:  # Also of a press that did not end: as deep as it came.
        sunk = trial.planned.translation()[2] - end.translation()[2] - HOVER
        measured["depth_m"] = float(sunk)
    measured["displacement_m"] = result.measured.get("displacement_m", 0.0)
    if not placed:
        measured |= {"holding_N": 0.0, "lifting_N": 0.0}
    phase, evidence = trial.failure or ("", "")
    success = placed and result.success
    if not success and trial.failure is None:
        phase = CRITERION
        evidence = "the jig did not go along" if placed else "the part does not stand as placed"
    return Outcome(success, measured, phase, evidence)
