"""The training of a net for keypoints, step by step, with checkpoints. It needs PyTorch."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

# PyTorch is in an environment of its own, see docs/guide/keypoints.md.
import torch  # pyright: ignore[reportMissingImports]

from cell.errors import InputError
from cell.machines.cameras.pinhole import Pinhole
from cell.whole_file import whole_file
from experiments.vision.labelled_views import LabelledView
from experiments.vision.training_images import batch
from experiments.vision.voting_network import VotingNetwork, losses
from planning.perception.keypoint_card import KeypointCard
from planning.perception.keypoint_net import as_input

RATE, LAST_RATE, WARM_UP = 3e-3, 1e-5, 100  # Of learning, at most and at the end; steps to it [A].
DECAY = 1e-4  # Of the weights [A].
DIRECTIONS = 3.0  # By which their loss counts more than that of the mask [A].
REPORTED, KEPT = 50, 200  # Steps between two lines, and two checkpoints.


@dataclass
class Training:
    """See the module.

    Attributes:
        card: Of the net.
        views, pinhole: What it learns from, and the camera that took it.
        steps: In all.
        count: Of close-ups in a step.
        seed: Of weights and close-ups.
        made_from: What decides about the result: a checkpoint of something else is refused.
        done: Steps so far.
        history: Means of the losses of mask and directions, over each `REPORTED` steps.
    """

    card: KeypointCard
    views: Sequence[LabelledView]
    pinhole: Pinhole
    steps: int
    count: int
    seed: int
    made_from: dict[str, Any]
    done: int = 0
    history: list[list[float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        torch.manual_seed(self.seed)
        self.network = VotingNetwork(len(self.card.p_PK)).to(memory_format=torch.channels_last)
        self._optimiser = torch.optim.AdamW(self.network.parameters(), weight_decay=DECAY)
        self._recent: list[list[float]] = []

    def run(self, file: Path, minutes: float | None, report: Callable[[str], None]) -> None:
        """Go on from a checkpoint, if there is one, to the last step or until time is up.

        Args:
            file: The checkpoint; written from time to time, and at the end.
            minutes: For this call; None: no limit.
            report: Takes a line from time to time.

        Raises:
            InputError: The checkpoint is of another training.
        """
        if file.is_file():
            self._load(file)
        started = time.monotonic()
        while self.done < self.steps:
            if minutes is not None and time.monotonic() - started > 60.0 * minutes:
                break
            self._step()
            if self.done % REPORTED == 0:
                means = np.mean(self._recent, axis=0)
                self.history.append([round(float(mean), 5) for mean in means])
                self._recent = []
                seconds = time.monotonic() - started
                report(f"step {self.done}: mask {means[0]:.4f}, directions {means[1]:.4f}, "
                       f"{seconds:.0f} s")  # fmt: skip
            if self.done % KEPT == 0:
                self._save(file)
        self._save(file)

    def _step(self) -> None:
        # Of the step's own, so that what was interrupted goes on as if it had not been.
        rng = np.random.default_rng([self.seed, self.done])
        chosen = rng.choice(len(self.views), self.count)
        drawn = batch([self.views[k] for k in chosen], self.pinhole, self.card, rng)
        images = torch.from_numpy(as_input(drawn.images))
        output = self.network(images.contiguous(memory_format=torch.channels_last))
        of_mask, of_directions = losses(
            output, torch.from_numpy(drawn.masks), torch.from_numpy(drawn.directions)
        )
        for group in self._optimiser.param_groups:
            group["lr"] = self._rate
        self._optimiser.zero_grad()
        (of_mask + DIRECTIONS * of_directions).backward()
        self._optimiser.step()
        self._recent.append([of_mask.item(), of_directions.item()])
        self.done += 1

    @property
    def _rate(self) -> float:
        """Of learning in the present step: it rises, then falls like a cosine."""
        falling = 0.5 * (1.0 + np.cos(np.pi * self.done / self.steps))
        return float(min(1.0, (self.done + 1) / WARM_UP) * (LAST_RATE + RATE * falling))

    def _save(self, file: Path) -> None:
        state = {
            "made_from": self.made_from,
            "done": self.done,
            "history": self.history,
            "recent": self._recent,
            "network": self.network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
        }
        with whole_file(file) as temporary:
            torch.save(state, temporary)

    def _load(self, file: Path) -> None:
        try:
            state = torch.load(file, weights_only=True)
            other = [name for name, value in self.made_from.items()
                     if state["made_from"].get(name) != value]  # fmt: skip
            if other:
                raise InputError(
                    f"'{file}' is of a training with another {', '.join(other)}: name another "
                    "folder with --out."
                )
            self.network.load_state_dict(state["network"])
            self._optimiser.load_state_dict(state["optimiser"])
        except InputError:
            raise
        except Exception as error:  # Whatever PyTorch makes of a file that is not its own.
            raise InputError(f"'{file}' is no checkpoint that can be read: {error}.") from error
        self.done, self.history = state["done"], state["history"]
        self._recent = state["recent"]
