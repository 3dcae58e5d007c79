"""When threads catch and lock, and when the bit is in a socket: rules applied after every step.

A bit beside a socket stands on the head. One that is told to turn engages in a socket that it
meets; a turned bolt that meets the helix is caught; a caught bolt that nothing drives is locked by
its static friction; a bit that is told to stand leaves the socket once the bit holder's spring does
not push it in any more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, LeafSystem

from cell.errors import UnknownName
from cell.machines.driver import Driver
from cell.products.product import Product
from cell.workpieces.bit_end import BitEnd
from cell.workpieces.parts import Parts
from cell.workpieces.thread import (
    BIT_GATE,
    NO_BIT,
    STATES,
    THREAD_GATE,
    Engagement,
    Thread,
    ThreadState,
    add_thread,
    set_head_friction,
)


class Threads(LeafSystem):
    """All threads of a product in one diagram: who is tied to what lives in its Context.

    Args:
        threads: By the name of the bolt.
        driver: Whose bit drives them; None: nothing does.
        bit_end: What of the bit touches their heads; None without a driver.
    """

    def __init__(
        self, threads: Mapping[str, Thread], driver: Driver | None, bit_end: BitEnd | None
    ) -> None:
        super().__init__()
        self._threads, self._driver, self._bit_end = dict(threads), driver, bit_end
        self._row_of = {bolt: row for row, bolt in enumerate(self._threads)}
        rows = [Engagement().row() for _ in threads]
        self._index = self.DeclareDiscreteState(np.array(rows).reshape(-1))
        self._touching = self.DeclareDiscreteState([1.0])  # Whether the bit's end touches.

    def __getitem__(self, bolt: str) -> Thread:
        if bolt not in self._threads:
            raise UnknownName("bolt", bolt, self._threads)
        return self._threads[bolt]

    def __iter__(self) -> Iterator[str]:
        return iter(self._threads)

    def __len__(self) -> int:
        return len(self._threads)

    # Readings.

    def engagements(self, root: Context) -> dict[str, Engagement]:
        """Return what is remembered of every thread, by the name of the bolt."""
        rows = self._rows(root)
        return {bolt: Engagement.of(row) for bolt, row in zip(self._threads, rows, strict=True)}

    def _rows(self, root: Context) -> np.ndarray:
        """Return what is remembered as rows (n, 3)."""
        state = self.GetMyContextFromRoot(root).get_discrete_state(self._index)
        return state.value().reshape(-1, 3).copy()

    def engagement(self, root: Context, bolt: str) -> Engagement:
        """Return what is remembered of one thread.

        Raises:
            UnknownName: No such bolt; so do all readings and commands by name.
        """
        state = self.GetMyContextFromRoot(root).get_discrete_state(self._index).value()
        start = 3 * self._row_of[self[bolt].screw.part]
        return Engagement.of(state[start : start + 3])

    def state(self, root: Context, bolt: str) -> ThreadState:
        """Return the state of one thread."""
        return self.engagement(root, bolt).state

    def bit_engaged(self, root: Context, bolt: str) -> bool:
        """Return whether the bit is in the socket of a bolt."""
        return self.engagement(root, bolt).bit_position != NO_BIT

    def turns(self, root: Context, bolt: str) -> float:
        """Return the turns of a bolt since its thread caught, positive for tightening."""
        thread = self[bolt]
        angle = thread.joint.get_rotation(thread.plant.GetMyContextFromRoot(root))
        return (self.engagement(root, bolt).caught_angle - angle) / (2 * np.pi)

    # Simulation.

    def install(self, root: Context) -> None:
        """Bring the ties of a new Context in line with what is remembered: Drake has all closed."""
        for bolt, engagement in self.engagements(root).items():
            self._threads[bolt].apply(root, engagement)
        self.meet_heads(root)

    def set(self, root: Context, bolt: str, engagement: Engagement) -> None:
        """Put one thread into a state; the positions are left as they are."""
        self[bolt].apply(root, engagement)
        self._remember(root, bolt, engagement)

    def step(self, root: Context, dt: float) -> None:
        """Apply the rules, after a step of the plant."""
        if self._driver is None or not self._threads:
            return
        self.meet_heads(root)
        rows = self._rows(root)
        turning = self._driver.drive.commanded_speed(root) != 0.0
        busy = (rows[:, 0] == STATES.index(ThreadState.CAUGHT)) | (rows[:, 1] != NO_BIT)
        if not turning and not busy.any():
            return
        now = self.engagements(root)
        driven = [bolt for bolt, row in now.items() if row.bit_position != NO_BIT]
        if turning and not driven:
            self._engage(root, now)
        for bolt in driven if turning else ():
            if now[bolt].state is ThreadState.FREE:
                self._catch(root, bolt, now[bolt])
            elif now[bolt].state is ThreadState.LOCKED:
                self.set(root, bolt, replace(now[bolt], state=ThreadState.CAUGHT))
        for bolt, row in () if turning else now.items():
            if row.state is ThreadState.CAUGHT:
                row = replace(row, state=ThreadState.LOCKED)
                self.set(root, bolt, row)
            if (
                bolt in driven
                and self._driver.push(self._driver.plant.GetMyContextFromRoot(root)) <= 0.0
            ):
                self._threads[bolt].set_bit(root, NO_BIT)
                self._remember(root, bolt, replace(row, bit_position=NO_BIT))

    def meet_heads(self, root: Context) -> None:
        """Let the bit's end touch what it meets, but for the head whose drive it is over or in."""
        if self._bit_end is None:
            return
        touches = not (self._rows(root)[:, 1] != NO_BIT).any()
        for thread in self._threads.values() if touches else ():
            context = thread.plant.GetMyContextFromRoot(root)
            if not thread.bolt.is_locked(context) and thread.takes_bit(context):
                touches = False
                break
        context = self.GetMyMutableContextFromRoot(root)
        if context.get_discrete_state(self._touching).value()[0] != touches:
            context.SetDiscreteState(self._touching, [float(touches)])
            self._bit_end.set(root, touches=touches)

    def _engage(self, root: Context, now: Mapping[str, Engagement]) -> None:
        """Tie the bit to a bolt if it is inside its socket."""
        for bolt, thread in self._threads.items():
            context = thread.plant.GetMyContextFromRoot(root)
            if thread.bolt.is_locked(context):
                continue
            misfit, position = thread.bit_misfit(context)
            if misfit.within(BIT_GATE):
                thread.set_bit(root, position)
                self._remember(root, bolt, replace(now[bolt], bit_position=position))
                return

    def _catch(self, root: Context, bolt: str, row: Engagement) -> None:
        """Let the thread catch if the turning bolt meets the helix."""
        thread = self._threads[bolt]
        misfit, theta = thread.thread_misfit(thread.plant.GetMyContextFromRoot(root))
        if misfit.within(THREAD_GATE):
            thread.set_angle(root, theta)
            caught = Engagement(ThreadState.CAUGHT, row.bit_position, theta)
            self.set(root, bolt, caught)

    def _remember(self, root: Context, bolt: str, engagement: Engagement) -> None:
        rows = self._rows(root)
        rows[self._row_of[bolt]] = engagement.row()
        self.GetMyMutableContextFromRoot(root).SetDiscreteState(self._index, rows.reshape(-1))

    # Saving.

    def save(self, root: Context) -> np.ndarray:
        """Return one row (3,) per thread."""
        return self._rows(root)

    def restore(self, root: Context, rows: np.ndarray) -> None:
        """Undo `save`; the positions are restored with the plant's, `meet_heads` is to follow."""
        for bolt, row in zip(self._threads, rows, strict=True):
            self.set(root, bolt, Engagement.of(row))


def add_threads(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    product: Product,
    parts: Parts,
    driver: Driver | None,
) -> Threads:
    """Add the tapped hole and the open ties of every screw of the product.

    Args:
        plant: Not finalized yet.
        scene_graph: Where collision filters and the heads' friction are set.
        product: Its screws.
        parts: In the plant.
        driver: Whose bit drives them; None if there is none: then no thread ever catches.
    """
    threads, bit_end = {}, None
    if driver is not None:
        bit_end = BitEnd.add(plant, scene_graph, driver.bit_frame)
        plant.AddModelInstance("threads")
        for name, screw in product.screws.items():
            bolt, into = parts[name].body, parts[screw.into].body
            set_head_friction(plant, scene_graph, screw, bolt, parts[screw.clamps].body)
            X_IH = product.parts[screw.into].X_AP.inverse() @ product.parts[name].X_AP
            head_height = float(product.parts[name].mesh.bounds[1][2])
            threads[name] = add_thread(
                plant, scene_graph, screw, bolt, into, X_IH, driver.bit_frame, head_height
            )
    return Threads(threads, driver, bit_end)
