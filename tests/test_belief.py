"""What the planner knows: looks refresh it, the hand carries it, saving keeps it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.framework import Context

from cell.errors import UnknownName
from cell.workpieces.parts import Parts
from planning.perception.belief import Belief, Estimate, TruthSource

X_AT_HOME = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.1, 0.2, 0.3])
AWAY = RigidTransform(RollPitchYaw(0.0, 0.0, 1.0), [0.0, 0.1, 0.5])


@dataclass
class Scene:
    """Parts and a hand that a test moves, and what a source sees of them."""

    truth: dict[str, RigidTransform] = field(
        default_factory=lambda: {"motor": X_AT_HOME, "plate": RigidTransform()}
    )
    X_WH: RigidTransform = field(default_factory=lambda: RigidTransform([0.0, 0.0, 0.4]))
    time: float = 0.0
    duration: float = 0.0
    looks: int = 0

    def look(self, parts: Sequence[str], known: Mapping[str, Estimate]) -> dict[str, Estimate]:
        self.looks += 1
        return {name: Estimate(self.truth[name], np.zeros((6, 6)), self.time) for name in parts}

    def save(self) -> np.ndarray:
        return np.array(self.looks)

    def restore(self, state: np.ndarray) -> None:
        self.looks = int(state)

    def move_hand(self, X: RigidTransform, carrying: str | None = None) -> None:
        """Move the hand by X in W, and a part along with it."""
        self.X_WH = X @ self.X_WH
        if carrying is not None:
            self.truth[carrying] = X @ self.truth[carrying]


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def belief(scene: Scene) -> Belief:
    belief = Belief(scene, hand=lambda: scene.X_WH)
    belief.look(["motor", "plate"])
    return belief


def test_what_moves_unseen_is_believed_where_it_was(scene: Scene, belief: Belief) -> None:
    scene.truth["motor"], scene.time = AWAY, 3.0
    assert belief.pose("motor").IsExactlyEqualTo(X_AT_HOME)
    belief.look(["plate"])
    assert belief.pose("motor").IsExactlyEqualTo(X_AT_HOME)
    belief.look(["motor"])
    assert belief.pose("motor").IsExactlyEqualTo(AWAY)
    assert belief.estimates["motor"].time == 3.0


def test_part_never_seen_is_unknown(scene: Scene) -> None:
    with pytest.raises(UnknownName, match="motor"):
        Belief(scene, hand=lambda: scene.X_WH).pose("motor")


def test_part_in_the_hand_follows_it(scene: Scene, belief: Belief) -> None:
    belief.carry(["motor"])
    scene.move_hand(AWAY, carrying="motor")
    assert belief.pose("motor").IsNearlyEqualTo(scene.truth["motor"], 1e-12)
    assert belief.pose("plate").IsExactlyEqualTo(RigidTransform())


def test_look_in_the_hand_tells_a_slip(scene: Scene, belief: Belief) -> None:
    belief.carry(["motor"])
    slip = RigidTransform([0.0, 0.0, -1e-3])
    scene.truth["motor"] = slip @ scene.truth["motor"]
    scene.move_hand(AWAY, carrying="motor")
    wrong = belief.pose("motor").translation() - scene.truth["motor"].translation()
    assert np.linalg.norm(wrong) == pytest.approx(1e-3)
    belief.look(["motor"])
    assert belief.pose("motor").IsExactlyEqualTo(scene.truth["motor"])
    scene.move_hand(AWAY, carrying="motor")
    assert belief.pose("motor").IsNearlyEqualTo(scene.truth["motor"], 1e-12)


def test_part_that_was_put_down_stays_there(scene: Scene, belief: Belief) -> None:
    belief.carry(["motor"])
    scene.move_hand(AWAY, carrying="motor")
    belief.put_down()
    scene.move_hand(AWAY)
    assert belief.pose("motor").IsNearlyEqualTo(scene.truth["motor"], 1e-12)


def test_saved_belief_is_restored_with_what_is_in_the_hand(scene: Scene, belief: Belief) -> None:
    belief.carry(["motor"])
    scene.move_hand(AWAY, carrying="motor")
    again = Belief(Scene(), hand=lambda: scene.X_WH)
    again.restore(belief.save())
    for part in ("motor", "plate"):
        assert again.pose(part).IsExactlyEqualTo(belief.pose(part))
        assert again.estimates[part].time == belief.estimates[part].time
    assert cast(Scene, again.source).looks == scene.looks


def truth_source(position_noise: float, angle_noise: float) -> TruthSource:
    part = SimpleNamespace(X_WP=lambda context: X_AT_HOME)
    context = cast(Context, SimpleNamespace(get_time=lambda: 2.0))
    rng = np.random.default_rng(7)
    return TruthSource(cast(Parts, {"motor": part}), context, position_noise, angle_noise, rng)


def test_without_noise_the_truth_is_seen() -> None:
    estimate = truth_source(0.0, 0.0).look(["motor"], {})["motor"]
    assert estimate.X_WP.IsExactlyEqualTo(X_AT_HOME)
    assert not estimate.covariance.any()
    assert estimate.time == 2.0


def test_noise_is_as_large_as_its_covariance_says() -> None:
    source = truth_source(1e-3, 0.02)
    seen = [source.look(["motor"], {})["motor"] for _ in range(600)]
    offsets = [e.X_WP.translation() - X_AT_HOME.translation() for e in seen]
    turns = [RollPitchYaw(X_AT_HOME.rotation().inverse() @ e.X_WP.rotation()) for e in seen]
    errors = np.hstack([[turn.vector() for turn in turns], offsets])
    assert errors.std(axis=0) == pytest.approx(np.sqrt(np.diag(seen[0].covariance)), rel=0.1)


def test_restored_source_sees_the_same_again() -> None:
    source, other = truth_source(1e-3, 0.02), truth_source(1e-3, 0.02)
    source.look(["motor"], {})
    other.restore(source.save())
    expected, again = (s.look(["motor"], {})["motor"].X_WP for s in (source, other))
    assert again.IsExactlyEqualTo(expected)
