"""Which contacts may be linked: a table of what is meant to hold, and until when.

Everything else keeps its full contact, above all what is being mated: the hole that slides over a
shaft, the bolt that is set or turned, what a finger pushes. Bodies that are in no row, such as a
caller's own, are never linked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from cell.contact.links import ContactLinks
from cell.contact.memory import Intent
from cell.contact.plant_side import Pair
from cell.fixtures.base import Fixture
from cell.machines.gripper import Gripper
from cell.workpieces.parts import LoosePart
from cell.workpieces.thread import ThreadState
from cell.workpieces.threads import Threads

JAW, FIXTURE, PART, SCREW = "jaw", "fixture", "part", "screw"


@dataclass(frozen=True)
class Rule:
    """One row of the table.

    Attributes:
        kinds: Of the two bodies, in this order.
        meaning: What holds.
        until: The link ends when this changes, or is None; given the policy, the Context of the
            diagram, what the present phase intends, and the names of the two bodies.
    """

    kinds: tuple[str, str]
    meaning: str
    until: Callable[[Policy, Context, Intent, str, str], object | None]


@dataclass(frozen=True)
class Policy:
    """The table, applied to the bodies of one cell.

    Attributes:
        rows: By the numbers of two bodies that may be linked: the rules, and their names in the
            order of the rules: of the part, of the gripper, of the fixture.
        grippers: By name.
        fixture: What holds the first part.
        threads: Of the bolts; None: there are none.
    """

    rows: Mapping[Pair, tuple[tuple[Rule, ...], str, str]]
    grippers: Mapping[str, Gripper]
    fixture: Fixture
    threads: Threads | None

    @staticmethod
    def of(
        grippers: Iterable[Gripper],
        fixture: Fixture,
        parts: Iterable[LoosePart],
        threads: Threads | None = None,
    ) -> Policy:
        """Return the policy of a cell, whose plant need not be finalized yet."""
        kinds: dict[int, str] = {int(fixture.base.index()): FIXTURE}
        names = {int(fixture.base.index()): fixture.name}
        by_name = {gripper.name: gripper for gripper in grippers}
        for gripper in by_name.values():
            for index in gripper.plant.GetBodyIndices(gripper.instance):
                kinds[int(index)], names[int(index)] = JAW, gripper.name
        for part in parts:
            index, name = int(part.body.index()), part.part.name
            kinds[index] = SCREW if threads is not None and name in threads else PART
            names[index] = name
        rows = {
            (min(a, b), max(a, b)): (RULES[kinds[a], kinds[b]], names[a], names[b])
            for a, b in permutations(kinds, 2)
            if (kinds[a], kinds[b]) in RULES
        }
        return Policy(rows, by_name, fixture, threads)

    def until(self, root: Context, pair: Pair, intent: Intent) -> object | None:
        """Return what a link between two bodies lasts until the change of; None: no link.

        Args:
            root: Context of the diagram.
            pair: Numbers of the bodies.
            intent: Of the present phase.
        """
        if pair not in self.rows:
            return None
        rules, *names = self.rows[pair]
        if frozenset(names) in intent.mating:
            return None
        lasting = (rule.until(self, root, intent, *names) for rule in rules)
        return next((until for until in lasting if until is not None), None)

    def limits(
        self, root: Context, A: RigidBody, B: RigidBody, normals_W: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the pressure (n,) that the surfaces of two bodies bear [Pa].

        Args:
            root: Context of the diagram.
            A: One body.
            B: The other.
            normals_W: (n, 3) of their common surface, in W.
        """
        if self.fixture.base.index() not in (A.index(), B.index()):
            return np.full(len(normals_W), np.inf)
        X_WJ = self.fixture.pose(self.fixture.plant.GetMyContextFromRoot(root))
        return self.fixture.strength(root, normals_W @ X_WJ.rotation().matrix())

    # The conditions of the rules.

    def jaw_target(self, root: Context, _: Intent, gripper: str, __: str) -> object:
        """Return where the jaws are driven to: a link ends when they are told something else."""
        return float(self.grippers[gripper].drive.target(root)[0])

    def fixed(self, root: Context, *_: object) -> object | None:
        """Return whether the fixture holds as firmly as it will."""
        return self.fixture.fixed(root) or None

    def always(self, *_: object) -> object:
        """Return a constant."""
        return True

    def locked(self, root: Context, _: Intent, screw: str, __: str) -> object | None:
        """Return whether a bolt is in its thread and held by its friction."""
        assert self.threads is not None
        return self.threads.state(root, screw) is ThreadState.LOCKED or None

    def riding(self, root: Context, intent: Intent, screw: str, _: str) -> object | None:
        """Return whether a bolt lies loose in a part and touches nothing else."""
        return "riding" if screw in intent.riding else None


TABLE = (
    Rule((JAW, PART), "a part in the jaws", Policy.jaw_target),
    Rule((JAW, SCREW), "a bolt in the jaws", Policy.jaw_target),
    Rule((FIXTURE, PART), "a part in the frozen bed, or on the fixture", Policy.fixed),
    Rule((PART, PART), "parts on their seat, while they are not being mated", Policy.always),
    Rule((SCREW, PART), "the head of a tightened bolt", Policy.locked),
    Rule((SCREW, PART), "a loose bolt in the part that carries it", Policy.riding),
)
RULES = {kinds: tuple(r for r in TABLE if r.kinds == kinds) for kinds in {r.kinds for r in TABLE}}


def add_links(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    contact: str,
    grippers: Iterable[Gripper],
    fixture: Fixture,
    parts: Sequence[LoosePart],
    threads: Threads | None = None,
) -> ContactLinks:
    """Add the links of a cell, before the plant is finalized.

    Args:
        plant: Not finalized yet.
        scene_graph: The plant's.
        contact: "linked" or "full", as `simulation.contact`.
        grippers: Whose jaws may be linked to a part.
        fixture: Holds the first part.
        parts: Loose ones.
        threads: Of the bolts among them; None: there are none.
    """
    policy = Policy.of(grippers, fixture, parts, threads)
    if contact == "full" or not parts:
        return ContactLinks(plant, scene_graph, policy, most=0)
    # Each part has a seat or a head; a held one has two jaws more, a fixed one the fixture.
    spare = (parts[0].body, fixture.base)
    return ContactLinks(plant, scene_graph, policy, len(parts) + 4, spare)
