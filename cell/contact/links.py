"""Links in a cell: contacts that stick are replaced by springs, and come back when they must.

Area contact forms and ends every grip, seat and imprint. In between, while two bodies stick to each
other, their polygons only say again and again what six springs say as well, for a fraction of the
time. Links are checked every few steps; a contact that would open, slide or yield, or has moved too
far, is given back to Drake.

`simulation.contact: full` leaves all of it out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import HydroelasticContactInfo, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, LeafSystem

from cell.contact.link import Link
from cell.contact.memory import Installed, Intent, LinksMemory
from cell.contact.plant_side import SPRINGS, Pair, PlantSide

Array = NDArray[np.float64]

LOOK_PERIOD = 0.01  # For contacts that have come to a stand [s] [A].
CHECK_PERIOD = 0.005  # Of the links [s] [A].
# A contact stands when it has moved for WAIT [s] at less than CREEP times the time step [m/s]:
# Drake regularises friction, so that what sticks creeps in proportion to its load and to the step.
# At 1 ms this is 0.5 mm/s, a tenth of the slowest motion of an arm [A]; a bolt in the jaws creeps
# at 0.39 mm/s [M]. After a return it has to wait longer, up to PATIENCE times.
CREEP, WAIT, PATIENCE = 0.5, 0.02, 5
LEVER = 0.02  # At which a rotation counts as motion [m] [A].
FEWEST = 4  # Polygons of a contact that resists every displacement.


class Sticking(Protocol):
    """What says which contacts may be linked: `cell.link_policy`."""

    def until(self, root: Context, pair: Pair, intent: Intent) -> object | None:
        """Return what a link of a pair of bodies lasts until the change of; None: no link."""
        ...

    def limits(self, root: Context, A: RigidBody, B: RigidBody, normals_W: Array) -> Array:
        """Return the pressure (n,) that their surfaces bear, given normals (n, 3) [Pa]."""
        ...


class ContactLinks(LeafSystem):
    """Replaces contacts that stick by springs, in the Context of a diagram.

    Args:
        plant: Not finalized yet.
        scene_graph: The plant's.
        policy: Which contacts may be linked.
        most: Links at a time; 0: contact is always full.
        spare: A free body and another one, neither the world (see `PlantSide`); None: most is 0.

    Attributes:
        policy: As given.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        policy: Sticking,
        most: int,
        spare: tuple[RigidBody, RigidBody] | None = None,
    ) -> None:
        super().__init__()
        self._plant, self.policy, self._most = plant, policy, most
        self._side = PlantSide(plant, scene_graph, most, spare)
        self._index = self.DeclareAbstractParameter(Value[object](LinksMemory()))

    def memory(self, root: Context) -> LinksMemory:
        """Return what is remembered in a Context of the diagram; not to be changed."""
        return self.GetMyContextFromRoot(root).get_abstract_parameter(self._index).get_value()

    def _changed(self, root: Context) -> LinksMemory:
        context = self.GetMyMutableContextFromRoot(root)
        return context.get_mutable_abstract_parameter(self._index).get_mutable_value()

    # Commands; each takes the Context of the whole diagram.

    def install(self, root: Context) -> None:
        """Bring a new Context into its initial state: no link."""
        self._side.switch_all_off(root)

    def intend(
        self,
        root: Context,
        mating: frozenset[frozenset[str]] = frozenset(),
        riding: frozenset[str] = frozenset(),
    ) -> None:
        """Take note of what is meant to happen from now on, until the next call.

        Links that this, or a command to jaws, has ended are gone before the next step is taken.

        Args:
            root: Of the diagram.
            mating: As of an `Intent`.
            riding: As of an `Intent`.
        """
        intent = Intent(mating, riding)
        if intent != self.memory(root).intent:
            self._changed(root).intent = intent
        self._end_unwanted(root)

    def release(self, root: Context, body: RigidBody) -> None:
        """Give all contacts of a body back, before its geometry changes."""
        for pair in self._of(root, body):
            self._end(root, pair, "geometry")

    def pause(self, root: Context, body: RigidBody, apart_from: Sequence[RigidBody] = ()) -> None:
        """Switch the springs of a body off while it sleeps.

        Args:
            root: Of the diagram.
            body: That falls asleep.
            apart_from: Only its springs to these bodies; empty: all of them.
        """
        for pair in self._of(root, body, apart_from):
            own = self.memory(root).installed[pair]
            self._set_sleepers(root, pair, own.sleepers | {int(body.index())})

    def resume(self, root: Context, body: RigidBody, apart_from: Sequence[RigidBody] = ()) -> None:
        """Switch them on again, where the contact still sticks; arguments as of `pause`."""
        for pair in self._of(root, body, apart_from):
            own = self.memory(root).installed[pair]
            sleepers = own.sleepers - {int(body.index())}
            context = self._plant.GetMyContextFromRoot(root)
            displacement = own.link.displacement(*self._side.poses(context, pair))
            reason = None if sleepers else own.link.violation(displacement)
            if reason is None:
                self._set_sleepers(root, pair, sleepers)
            else:
                self._return(root, pair, reason)

    def _set_sleepers(self, root: Context, pair: Pair, sleepers: frozenset[int]) -> None:
        memory = self._changed(root)
        own = memory.installed[pair] = replace(memory.installed[pair], sleepers=sleepers)
        self._side.switch(root, own.slots, on=not sleepers)

    # Readings.

    def wrenches(self, root: Context, body: RigidBody) -> Iterator[tuple[RigidBody, Array]]:
        """Yield every body that a body is linked to, and the wrench (6,) on that, about Wo."""
        context = self._plant.GetMyContextFromRoot(root)
        for pair in self._of(root, body):
            A, B = self._side.bodies(pair)
            link = self.memory(root).installed[pair].link
            on_A = link.wrench(*self._side.poses(context, pair))
            yield (B, -on_A) if A.index() == body.index() else (A, on_A)

    def summary(self, root: Context) -> dict[str, Any]:
        """Return what became of the links so far.

        Their mean number, how many were made, and how many ended, by reason; and for each pair of
        bodies the share of the time in which it was linked, and how often a check has given its
        contact back.
        """
        memory, name = self.memory(root), self._side.name
        shares = {name(pair): time / memory.time for pair, time in memory.linked.items()}
        returns = {name(pair): count for pair, count in memory.returns.items()}
        return {
            "mean": sum(shares.values()),
            "made": memory.made,
            "ended": dict(sorted(memory.ended.items())),
            "pairs": [
                {"pair": pair, "share_of_time": share, "returns": returns.get(pair, 0)}
                for pair, share in sorted(shares.items())
            ],
        }

    # Simulation.

    def step(self, root: Context, dt: float) -> None:
        """Check the links, and look for contacts that stick, after a step of the plant."""
        if self._most == 0:
            return
        memory = self._changed(root)
        memory.steps += 1
        memory.time += dt
        for pair in memory.installed:
            memory.linked[pair] = memory.linked.get(pair, 0.0) + dt
        self._end_unwanted(root)
        self._check(root, due=memory.steps % max(1, round(CHECK_PERIOD / dt)) == 0)
        if memory.steps % max(1, round(LOOK_PERIOD / dt)) == 0:
            self._look(root, dt)

    def _end_unwanted(self, root: Context) -> None:
        memory = self.memory(root)
        for pair, own in list(memory.installed.items()):
            if self.policy.until(root, pair, memory.intent) != own.until:
                self._end(root, pair, "command")

    def _check(self, root: Context, *, due: bool) -> None:
        """Check all links if that is due, else those that have been jolted."""
        context, memory = self._plant.GetMyContextFromRoot(root), self.memory(root)
        for pair, own in list(memory.installed.items()):
            if own.sleepers:
                continue
            displacement = own.link.displacement(*self._side.poses(context, pair))
            if not due and not own.link.jolted(displacement):
                continue
            reason = own.link.violation(displacement)
            if reason is not None:
                self._return(root, pair, reason)
            elif due and own.link.relax(displacement):
                self._side.set_springs(root, pair, own.slots, own.link)

    def _return(self, root: Context, pair: Pair, reason: str) -> None:
        """Give a contact back that does not stick any more."""
        self._end(root, pair, reason)
        returns = self._changed(root).returns
        returns[pair] = returns.get(pair, 0) + 1

    def _look(self, root: Context, dt: float) -> None:
        """Link what has been standing still."""
        memory, context = self._changed(root), self._plant.GetMyContextFromRoot(root)
        seen: dict[Pair, tuple[Array, int]] = {}
        for pair, contacts in self._side.contacts(context).items():
            until = self.policy.until(root, pair, memory.intent)
            # Drake 1.58 crashes with the world as a body of a distance constraint.
            if until is None or pair in memory.installed or 0 in pair:
                continue
            X_WA, X_WB = self._side.poses(context, pair)
            now = X_WB.InvertAndCompose(X_WA).GetAsMatrix34()
            then, since = memory.watched.get(pair, (now, memory.steps))
            if _way(then, now) > CREEP * dt * WAIT:
                then, since = now, memory.steps
            patience = WAIT * min(1 + memory.returns.get(pair, 0), PATIENCE)
            if (memory.steps - since) * dt >= patience - dt / 2:
                if self._link(root, pair, contacts, until, dt):
                    continue
                since = memory.steps
            seen[pair] = (then, since)
        memory.watched = seen

    def _link(
        self,
        root: Context,
        pair: Pair,
        contacts: list[HydroelasticContactInfo],
        until: object,
        dt: float,
    ) -> bool:
        """Replace a contact by springs, if it sticks; return whether it does."""
        memory, context = self._changed(root), self._plant.GetMyContextFromRoot(root)
        polygons, wrench = self._side.read(pair, contacts)
        used = (slot for own in memory.installed.values() for slot in own.slots)
        slots = self._side.free_slots(used)
        if len(polygons) < FEWEST or len(slots) < SPRINGS:
            return False
        limits = self.policy.limits(root, *self._side.bodies(pair), polygons.normals)
        try:
            link = Link.of(polygons, wrench, limits, *self._side.poses(context, pair))
        except np.linalg.LinAlgError:
            return False
        if not link.admissible():
            return False
        link.softening = self._side.resolvable(context, pair, link.springs, dt)
        own = Installed(link, slots, self._side.touching(root, pair), until)
        self._install(root, pair, own)
        memory.made += 1
        return True

    def _install(self, root: Context, pair: Pair, own: Installed) -> None:
        self._changed(root).installed[pair] = own
        self._side.set_springs(root, pair, own.slots, own.link)
        self._side.switch(root, own.slots, on=not own.sleepers)
        self._side.hide(root, pair, own.hidden, hidden=True)

    def _end(self, root: Context, pair: Pair, reason: str) -> None:
        memory = self._changed(root)
        own = memory.installed.pop(pair)
        memory.ended[reason] += 1
        self._side.switch(root, own.slots, on=False)
        self._side.hide(root, pair, own.hidden, hidden=False)

    def _of(self, root: Context, body: RigidBody, others: Sequence[RigidBody] = ()) -> list[Pair]:
        """Return the linked pairs of a body with some others; with none given, with any."""
        own, wanted = int(body.index()), {int(other.index()) for other in others}
        found = [pair for pair in self.memory(root).installed if own in pair]
        return [pair for pair in found if not wanted or wanted.intersection(pair)]

    # Saving.

    def save(self, root: Context) -> dict[str, Any]:
        """Return everything that changes as nested dictionaries of arrays."""
        memory, name = self.memory(root), self._side.name
        return {
            "links": {
                name(pair): own.link.arrays()
                | {
                    "slots": np.array(own.slots),
                    "hidden": own.hidden,
                    "sleepers": np.array(sorted(own.sleepers), dtype=int),
                }
                for pair, own in memory.installed.items()
            },
            "watched": {
                name(pair): {"pose": pose, "since": np.array(since)}
                for pair, (pose, since) in memory.watched.items()
            },
            "returns": {name(pair): np.array(count) for pair, count in memory.returns.items()},
            "mating": _names("|".join(sorted(pair)) for pair in memory.intent.mating),
            "riding": _names(memory.intent.riding),
            "counts": np.array([memory.steps, memory.made]),
            "time": np.array(memory.time),
            "linked": {name(pair): np.array(time) for pair, time in memory.linked.items()},
            "ended": {reason: np.array(count) for reason, count in memory.ended.items()},
        }

    def clear(self, root: Context) -> None:
        """End all links, so that what is in contact can be restored or handed over."""
        for pair in list(self.memory(root).installed):
            self._end(root, pair, "restore")
        self._changed(root).watched = {}

    def restore(self, root: Context, state: Mapping[str, Any]) -> None:
        """Return to a saved state; all links have been cleared, and all else is restored."""
        memory, pair_of = self._changed(root), self._side.pair
        watched, returns = state.get("watched", {}), state.get("returns", {})
        memory.watched = {pair_of(n): (w["pose"], int(w["since"])) for n, w in watched.items()}
        memory.returns = {pair_of(name): int(count) for name, count in returns.items()}
        memory.intent = Intent(
            mating=frozenset(frozenset(str(pair).split("|")) for pair in state["mating"]),
            riding=frozenset(map(str, state["riding"])),
        )
        memory.steps, memory.made = map(int, state["counts"])
        memory.time = float(state["time"])
        memory.linked = {pair_of(n): float(time) for n, time in state.get("linked", {}).items()}
        memory.ended = Counter({n: int(count) for n, count in state.get("ended", {}).items()})
        for name, arrays in state.get("links", {}).items():
            pair = pair_of(name)
            until = self.policy.until(root, pair, memory.intent)
            own = Installed(
                link=Link.from_arrays(arrays),
                slots=tuple(map(int, arrays["slots"])),
                hidden=arrays["hidden"],
                until=until,
                sleepers=frozenset(map(int, arrays["sleepers"])),
            )
            self._install(root, pair, own)


def _names(names: Iterable[str]) -> NDArray[np.str_]:
    return np.array(sorted(names), dtype=str)


def _way(then: Array, now: Array) -> float:
    """Return by how much a pose (3, 4) has changed [m]."""
    change = now - then
    turned = 0.5 * np.sum((LEVER * change[:, :3]) ** 2)
    return float(np.sqrt(np.sum(change[:, 3] ** 2) + turned))
