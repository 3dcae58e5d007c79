"""What an assembly is judged by, on states made by hand."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from cell.builder import Cell
from cell.products.loading import load_product
from planning.operations.bolts import in_hole, play_share, screw_play, standing
from planning.operations.grasping import HandPhase
from planning.operations.insert_shaft import INSERT_SHAFT
from planning.operations.insert_shaft.phases import mating_of
from planning.operations.log_rows import rows_between, rows_of
from planning.operations.mating_measures import riders_standing, seat_errors
from planning.operations.measures import force_plate_peaks, moved
from planning.operations.operation import PhaseRecord, Step, StepRecord
from planning.operations.pick_place import PICK_PLACE
from planning.operations.placement import placement_errors
from planning.operations.set_aside import SET_ASIDE
from planning.operations.set_aside.measures import measure as measure_set_aside
from planning.operations.set_aside.phases import AsidePhase
from planning.operations.snapshot import Snapshot, Wrench
from planning.operations.tighten_bolts import TIGHTEN_BOLTS
from planning.operations.tighten_bolts.measures import (
    advance,
    clamp_target,
    torque_shares,
    trip,
)
from planning.operations.tighten_bolts.phases import DrivePhase
from planning.operations.tighten_bolts.search import SearchPhase

PRODUCT = load_product("motor_unit")
SEATED = mating_of(PRODUCT, Step("insert plate", INSERT_SHAFT, ("plate",), PRODUCT.fits[0]))
BOLT = PRODUCT.screws["bolt_1"]
CELL = cast(Cell, SimpleNamespace(product=PRODUCT, holder=SimpleNamespace(name="left")))


def snapshot(**changes) -> Snapshot:
    """Return the assembled product with its frame A turned and moved in W, at rest."""
    X_WA = RigidTransform(RollPitchYaw(0.0, 0.0, 0.7), [0.1, 0.2, 0.3])
    state = Snapshot(
        time=1.0,
        X_WJ=RigidTransform([0.0, 0.15, 0.2]),
        X_WP={name: X_WA @ part.X_AP for name, part in PRODUCT.parts.items()},
        V_WP={name: np.zeros(6) for name in PRODUCT.parts},
        X_HF=dict.fromkeys(PRODUCT.screws, RigidTransform()),
        turns=dict.fromkeys(PRODUCT.screws, 10.0),
        clamp=dict.fromkeys(PRODUCT.screws, clamp_target(BOLT)),
        spindle_torque=0.5,
        wrenches={},
        hand_clearance={"motor": 0.002},
    )
    return replace(state, **changes)


def moved_part(state: Snapshot, part: str, X: RigidTransform) -> Snapshot:
    """Return the state with a part displaced by X in its own frame."""
    return replace(state, X_WP={**state.X_WP, part: state.X_WP[part] @ X})


def test_assembled_product_has_no_gap_and_no_tilt() -> None:
    assert seat_errors(PRODUCT, SEATED, snapshot()) == pytest.approx((0, 0, 0), abs=1e-9)


def test_gap_is_along_the_axis_and_at_the_hole() -> None:
    """A plate that is lifted by 0.3 mm, shifted and turned about the axis has a gap of 0.3 mm."""
    X = RigidTransform(RollPitchYaw(0.0, 0.0, 0.2), [1e-3, -2e-3, 3e-4])
    gap, tilt, aside = seat_errors(PRODUCT, SEATED, moved_part(snapshot(), "plate", X))
    assert gap == pytest.approx(3e-4)
    assert tilt == pytest.approx(0.0, abs=1e-7)


def test_tilt_counts_whatever_its_direction() -> None:
    for rpy in ([0.01, 0.0, 0.0], [0.0, -0.01, 0.0]):
        turned = RigidTransform(RollPitchYaw(rpy), np.zeros(3))
        _, tilt, _ = seat_errors(PRODUCT, SEATED, moved_part(snapshot(), "plate", turned))
        assert tilt == pytest.approx(0.01)


def test_motion_is_relative_to_the_jig() -> None:
    """What moves together with the jig has not moved."""
    before = snapshot()
    shake = RigidTransform(RollPitchYaw(0.0, 0.1, 0.2), [0.01, 0.02, 0.0])
    together = replace(
        before,
        X_WJ=shake @ before.X_WJ,
        X_WP={name: shake @ X_WP for name, X_WP in before.X_WP.items()},
    )
    assert moved("motor", before, together) == pytest.approx((0.0, 0.0), abs=1e-7)
    slipped = moved_part(before, "motor", RigidTransform(RollPitchYaw(0.03, 0, 0), [0, 1e-3, 0]))
    assert moved("motor", before, slipped) == pytest.approx((1e-3, 0.03))


def test_placement_is_judged_sideways_by_angle_and_by_tilt() -> None:
    planned = RigidTransform(RollPitchYaw(0.0, 0.0, 1.0), [0.0, 0.15, 0.3])
    tilted = (
        RollPitchYaw(0.0, 0.0, 1.0).ToRotationMatrix()
        @ RollPitchYaw(0.03, 0.0, 0.0).ToRotationMatrix()
    )
    errors = placement_errors(planned, RigidTransform(tilted, [3e-4, 0.15 + 4e-4, 0.28]))
    assert errors["position_error_m"] == pytest.approx(5e-4)
    assert errors["angle_error_rad"] == pytest.approx(0.03)
    assert errors["upright_tilt_rad"] == pytest.approx(0.03)
    yawed = RigidTransform(RollPitchYaw(0.0, 0.0, 1.05), planned.translation())
    errors = placement_errors(planned, yawed)
    assert errors["angle_error_rad"] == pytest.approx(0.05)
    assert errors["upright_tilt_rad"] == pytest.approx(0.0, abs=1e-7)


def test_bolt_stands_on_the_mouth_of_its_thread() -> None:
    X_HF = RigidTransform([2e-4, 0.0, BOLT.thread_depth + 1e-4])
    errors = standing(BOLT, X_HF)
    assert errors["standing_axial_m"] == pytest.approx(1e-4)
    assert errors["standing_lateral_m"] == pytest.approx(2e-4)


def test_play_of_a_bolt_is_that_of_its_hole() -> None:
    """[R] ISO 273, medium: M3 in 3.4 mm. The play is used up where the hole is off by as much."""
    assert screw_play(PRODUCT, "bolt_1") == pytest.approx(2e-4, abs=1e-6)
    assert play_share(PRODUCT, "plate", RigidTransform()) == pytest.approx(0.0, abs=1e-9)
    assert play_share(PRODUCT, "plate", RigidTransform([1e-4, 0.0, 1e-3])) == pytest.approx(
        0.5, 1e-2
    )
    assert play_share(PRODUCT, "motor", RigidTransform([1.0, 0.0, 0.0])) == 0.0


def test_holes_far_from_the_axis_of_a_turn_are_off_the_most() -> None:
    turned = RigidTransform(RollPitchYaw(0.0, 0.0, 1e-3), np.zeros(3))
    X_AP = PRODUCT.parts["plate"].X_AP
    far = max(
        float(np.linalg.norm((X_AP.inverse() @ PRODUCT.parts[bolt].X_AP).translation()[:2]))
        for bolt in PRODUCT.screws
    )
    assert play_share(PRODUCT, "plate", turned) == pytest.approx(1e-3 * far / 2e-4, rel=2e-2)


def test_clamp_force_is_compared_with_the_nut_factor() -> None:
    """0.5 N m on an M3 with K = 0.202 is 825 N."""
    assert clamp_target(BOLT) == pytest.approx(825.1, abs=0.1)
    measured = trip(BOLT, snapshot(), snapshot())
    assert measured["clamp_deviation"] == pytest.approx(0.0)
    assert measured["torque_deviation"] == pytest.approx(0.0)


def test_shares_of_torque_add_up_to_the_torque() -> None:
    """A torque about the bolt's axis is shared, wherever the sensors are, whatever was before."""
    before = snapshot(wrenches={name: _wrench(0.1) for name in ("left", "force_plate")})
    p_WB = before.X_WP["bolt_1"].translation()
    # The left arm takes 0.2 N m by a force of 2 N at a lever of 0.1 m, the jig the rest.
    left = Wrench(np.array([0.0, 0.0, 0.1]), np.array([0.0, -2.0, 0.0]), p_WB + [0.1, 0.0, 0.05])
    after = snapshot(wrenches={"left": left, "force_plate": _wrench(0.1 - 0.3)})
    shares = torque_shares("left", BOLT, PhaseRecord(before, after, {}))
    assert shares["left_arm_torque_share"] == pytest.approx(0.4)
    assert shares["jig_torque_share"] == pytest.approx(0.6)


def _wrench(torque_z: float) -> Wrench:
    return Wrench(np.array([0.0, 0.0, torque_z]), np.zeros(3), np.array([1.0, 2.0, 3.0]))


def test_advance_is_the_slope_before_the_bolt_is_snug() -> None:
    """After that the bolt turns against its own stretch: that part must not count."""
    angle = np.linspace(0.0, 10 * 2 * np.pi, 200)
    height = 5e-3 - BOLT.pitch * angle / (2 * np.pi)
    clamp = np.zeros(200)
    angle = np.append(angle, angle[-1] + [0.1, 0.2])
    height, clamp = np.append(height, [0.0, 0.0]), np.append(clamp, [300.0, 800.0])
    measured = advance(BOLT, angle, height, clamp)
    assert measured["advance_per_turn_m"] == pytest.approx(BOLT.pitch)
    assert measured["snug_to_trip_rad"] == pytest.approx(0.1)
    assert advance(BOLT, angle[:2], height[:2], clamp[:2]) == {}


def test_peaks_of_the_force_plate_leave_out_the_weight_of_the_jig() -> None:
    rest = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -50.0])
    wrench = rest + [[0, 0, 0.2, 3.0, 4.0, -20.0], [0, 0, -0.4, 0.0, 0.0, 5.0]]
    peaks = force_plate_peaks(wrench, rest)
    assert peaks["force_plate_peak_normal_N"] == pytest.approx(20.0)
    assert peaks["force_plate_peak_shear_N"] == pytest.approx(5.0)
    assert peaks["force_plate_peak_torque_z_N_m"] == pytest.approx(0.4)


def test_rows_of_an_interval_leave_out_its_start() -> None:
    log = {"time": np.array([0.1, 0.2, 0.3]), "phase_start": np.zeros(1)}
    assert rows_between(log, 0.1, 0.3)["time"].tolist() == [0.2, 0.3]


def test_rows_of_phases_leave_out_what_is_between() -> None:
    """Phases that follow each other give what the interval over both gives."""
    log = {"time": np.arange(10) * 0.1, "phase_name": np.array(["a"])}

    def phase(start: float, end: float) -> PhaseRecord:
        return PhaseRecord(snapshot(time=start), snapshot(time=end), {})

    apart = rows_of(log, [phase(0.1, 0.3), phase(0.6, 0.7)])
    np.testing.assert_allclose(apart["time"], [0.2, 0.3, 0.7])
    adjacent = rows_of(log, [phase(0.1, 0.3), phase(0.3, 0.5)])
    np.testing.assert_array_equal(adjacent["time"], rows_between(log, 0.1, 0.5)["time"])
    assert "phase_name" not in apart


def test_every_limit_is_checked_and_a_missing_quantity_fails() -> None:
    insertion = Step("insert plate", INSERT_SHAFT, ("plate",))
    limits = {limit.quantity: limit.limit for limit in INSERT_SHAFT.limits}
    assert not insertion.failed_checks(limits)
    (failed,) = insertion.failed_checks(limits | {"gap_m": -1.0})
    assert (failed.quantity, failed.value) == ("gap_m", -1.0)
    (failed,) = insertion.failed_checks({k: v for k, v in limits.items() if k != "tilt_rad"})
    assert (failed.quantity, failed.value) == ("tilt_rad", None)
    (failed,) = insertion.failed_checks(limits | {"gap_m": float("nan")})
    assert failed.quantity == "gap_m"


def test_limit_of_what_not_every_fixture_has_holds_where_it_was_measured() -> None:
    placement = Step("place motor", PICK_PLACE, ("motor",))
    kept = {limit.quantity: limit.limit for limit in PICK_PLACE.limits}
    del kept["off_supports_m"]
    assert not placement.failed_checks(kept)
    (failed,) = placement.failed_checks(kept | {"off_supports_m": 2e-3})
    assert failed.quantity == "off_supports_m"


def test_limits_of_bolts_hold_for_each() -> None:
    step = Step("tighten bolts", TIGHTEN_BOLTS, ("bolt_1", "bolt_2"))
    failed = [check.quantity for check in step.failed_checks({})]
    assert {"bolt_1/torque_deviation", "bolt_2/torque_deviation"} <= set(failed)


def test_what_remains_is_read_while_the_bolt_is_awake() -> None:
    """A sleeping bolt carries no force in the model: its last waking moment counts."""
    record = StepRecord(Step("tighten bolts", TIGHTEN_BOLTS, ("bolt_1",)), snapshot())
    late, asleep = snapshot(time=3.0), snapshot(time=5.0)
    awake = frozenset(["bolt_1"])
    stop = PhaseRecord(snapshot(), snapshot(time=2.0), {}, awake)
    record.phases["bolt_1", DrivePhase.STOP] = stop
    record.phases["bolt_2", DrivePhase.STOP] = PhaseRecord(snapshot(), late, {}, awake)
    record.phases["plate", HandPhase.RETREAT] = PhaseRecord(late, asleep, {})
    assert record.last_awake("bolt_1") is late
    assert record.last_awake("plate") is None


def test_places_at_which_a_socket_was_searched_for_are_counted() -> None:
    step = Step("tighten bolts", TIGHTEN_BOLTS, ("bolt_1", "bolt_2", "bolt_3"))
    record = StepRecord(step, snapshot())
    record.end = snapshot()
    for bolt in ("bolt_1", "bolt_2"):
        record.phases[bolt, DrivePhase.BIT_IN] = PhaseRecord(snapshot(), snapshot(), {})
    searched = PhaseRecord(snapshot(), snapshot(), {}, times=7)
    record.phases["bolt_2", SearchPhase.DOWN] = searched
    measured = TIGHTEN_BOLTS.measure(cast(Cell, SimpleNamespace(product=PRODUCT)), record, {})
    assert measured == {"bolt_1/socket_searches": 0.0, "bolt_2/socket_searches": 7.0}


def test_loose_bolt_is_judged_in_the_hole_of_what_it_clamps() -> None:
    """Wherever that is: it stands off, leans about the hole's upper end, or passes beside it."""
    state = snapshot()
    hanging = in_hole(PRODUCT, "bolt_2", state)
    assert hanging == pytest.approx(
        {"protrusion_m": 0.0, "off_hole_m": 0.0, "lean_rad": 0.0}, abs=1e-7
    )
    # The axis leans by 0.05 about the middle of the hole's upper end, 4 mm below the head.
    lean = RigidTransform(RollPitchYaw(0.05, 0.0, 0.0), np.zeros(3))
    leaning = in_hole(
        PRODUCT, "bolt_2", moved_part(state, "bolt_2", lean @ RigidTransform([0.0, 0.0, 4e-3]))
    )
    assert leaning["protrusion_m"] == pytest.approx(4e-3 * np.cos(0.05))
    assert leaning["off_hole_m"] == pytest.approx(0.0, abs=1e-9)
    assert leaning["lean_rad"] == pytest.approx(0.05)
    beside = in_hole(PRODUCT, "bolt_2", moved_part(state, "bolt_2", RigidTransform([1e-3, 0, 0])))
    assert beside["off_hole_m"] == pytest.approx(1e-3)


def test_bolts_that_rode_in_are_judged_on_their_threads() -> None:
    """Only bolts are, and each has to stand as if the hand had set it."""
    stands = RigidTransform([0.0, 0.0, BOLT.thread_depth + 2e-4])
    state = snapshot(X_HF=dict.fromkeys(PRODUCT.screws, stands))
    measured = riders_standing(PRODUCT, ("plate", "bolt_1"), state)
    assert set(measured) == {
        f"bolt_1/standing_{name}" for name in ("axial_m", "lateral_m", "tilt_rad")
    }
    assert measured["bolt_1/standing_axial_m"] == pytest.approx(2e-4)
    back = Step("insert plate", INSERT_SHAFT, ("plate",), None, ("bolt_1",))
    missing = {check.quantity for check in back.failed_checks({})}
    assert "bolt_1/standing_axial_m" in missing
    alone = Step("insert plate", INSERT_SHAFT, ("plate",))
    assert not any("standing" in check.quantity for check in alone.failed_checks({}))


def test_part_set_aside_is_compared_with_where_it_was_taken_from() -> None:
    step = Step("set aside plate", SET_ASIDE, ("plate",), None, ("bolt_1",))
    before = snapshot()
    shift = RigidTransform(RollPitchYaw(0.0, 0.0, 0.02), [3e-4, 4e-4, 0.0])
    both = moved_part(before, "plate", shift)
    origin = before.X_WP["plate"]
    record = StepRecord(step, before, origin=origin, end=both)
    assert measure_set_aside(CELL, record, {}) == {}  # It has not been set down.
    for phase in (AsidePhase.SET_DOWN, AsidePhase.SETTLE):
        record.phases["plate", phase] = PhaseRecord(before, both, {"left": 3.1})
    measured = measure_set_aside(CELL, record, {})
    assert measured["return_error_m"] == pytest.approx(5e-4)
    assert measured["return_angle_rad"] == pytest.approx(0.02)
    assert measured["lowered_force_peak_N"] == 3.1
    assert measured["bolt_1/off_hole_m"] == pytest.approx(np.hypot(*_left_behind(shift)), abs=1e-9)


def _left_behind(X_PlatePlate: RigidTransform) -> np.ndarray:
    """Return the offset (2,) of bolt 1 from its hole in a plate that moved without it."""
    p_PB = PRODUCT.parts["bolt_1"].X_AP.translation()
    return (X_PlatePlate.inverse() @ p_PB - p_PB)[:2]
