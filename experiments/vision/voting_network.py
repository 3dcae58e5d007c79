"""The network that is trained to find keypoints. Only training needs this file, and PyTorch.

A small U-Net: residual blocks down to a sixteenth of the image's size, and up again to a quarter.
Weights are where images are small, so that one core of a CPU trains and runs it.
"""

from __future__ import annotations

from pathlib import Path

# PyTorch is in an environment of its own, see docs/guide/keypoints.md.
import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]
from torch.nn import functional  # pyright: ignore[reportMissingImports]

STEM, QUARTER, EIGHTH, SIXTEENTH, JOINED = 16, 32, 64, 128, 64  # Channels.
OPSET = 17
SMOOTH = 0.1  # Where the loss of a direction goes over from squares to sizes.


class VotingNetwork(nn.Module):
    """See the module.

    Args:
        keypoints: How many.
    """

    def __init__(self, keypoints: int) -> None:
        super().__init__()
        self.stem = nn.Sequential(_convolution(3, STEM, stride=2), _convolution(STEM, STEM))
        self.quarter = _Block(STEM, QUARTER)
        self.eighth = _Block(QUARTER, EIGHTH)
        self.sixteenth = nn.Sequential(
            _Block(EIGHTH, SIXTEENTH),
            _convolution(SIXTEENTH, SIXTEENTH, dilation=2),
            _convolution(SIXTEENTH, SIXTEENTH, dilation=4),
        )
        self.join_eighth = nn.Sequential(
            _convolution(SIXTEENTH + EIGHTH, JOINED, size=1), _convolution(JOINED, JOINED)
        )
        self.join_quarter = nn.Sequential(
            _convolution(JOINED + QUARTER, JOINED, size=1), _convolution(JOINED, JOINED)
        )
        self.head = nn.Conv2d(JOINED, 1 + 2 * keypoints, 1)

    def forward(self, images: Tensor) -> Tensor:
        """Return (n, 1 + 2 K, h / 4, w / 4): the mask's logit, then directions, x and y by turns.

        Args:
            images: (n, 3, h, w), -0.5 to 0.5.
        """
        quarter = self.quarter(self.stem(images))
        eighth = self.eighth(quarter)
        sixteenth = self.sixteenth(eighth)
        eighth = self.join_eighth(torch.cat([_twice(sixteenth), eighth], 1))
        return self.head(self.join_quarter(torch.cat([_twice(eighth), quarter], 1)))


def losses(output: Tensor, masks: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
    """Return the losses of mask and directions, as in PVNet; the latter where the part is seen.

    Args:
        output: Of the network.
        masks: (n, h, w).
        directions: (n, 2 K, h, w).
    """
    of_mask = functional.binary_cross_entropy_with_logits(output[:, 0], masks)
    apart = functional.smooth_l1_loss(output[:, 1:], directions, reduction="none", beta=SMOOTH)
    seen = masks[:, None]
    of_directions = (apart * seen).sum() / (seen.sum() * directions.shape[1] + 1e-6)
    return of_mask, of_directions


def export(network: VotingNetwork, size: int, path: Path) -> None:
    """Write a network as ONNX, for one image (1, 3, size, size) at a time."""
    network.eval()
    with torch.no_grad():
        torch.onnx.export(
            network, (torch.zeros(1, 3, size, size),), str(path), input_names=["image"],
            output_names=["votes"], dynamo=False, opset_version=OPSET,
        )  # fmt: skip
    network.train()


class _Block(nn.Module):
    """Half the size, with a shortcut."""

    def __init__(self, channels: int, more: int) -> None:
        super().__init__()
        self.first = _convolution(channels, more, stride=2)
        self.second = nn.Sequential(
            nn.Conv2d(more, more, 3, padding=1, bias=False), nn.BatchNorm2d(more)
        )
        self.shortcut = nn.Sequential(
            nn.Conv2d(channels, more, 1, stride=2, bias=False), nn.BatchNorm2d(more)
        )

    def forward(self, values: Tensor) -> Tensor:
        return functional.relu(self.second(self.first(values)) + self.shortcut(values))


def _convolution(
    channels: int, more: int, size: int = 3, stride: int = 1, dilation: int = 1
) -> nn.Sequential:
    padding = dilation * (size // 2)
    return nn.Sequential(
        nn.Conv2d(channels, more, size, stride, padding, dilation, bias=False),
        nn.BatchNorm2d(more),
        nn.ReLU(inplace=True),
    )


def _twice(values: Tensor) -> Tensor:
    return functional.interpolate(values, scale_factor=2, mode="nearest")
