"""What is seen where: patches of pictures told by the words that name objects."""

from __future__ import annotations

from typing import Any

import torch
from torch import nn
from torch.nn import functional

from aerialdojo_gen.learning.encoding import PATCH_PX

_WIDTH = 128


def as_patches(pictures: Any) -> Any:
    """Cut pictures into patches, -1 to 1: (n, H, W, 4) uint8 to (n, H / 4, W / 4, 64)."""
    n, height, width, bytes_a_pixel = pictures.shape
    rows, columns = height // PATCH_PX, width // PATCH_PX
    cut = pictures.view(n, rows, PATCH_PX, columns, PATCH_PX, bytes_a_pixel).transpose(2, 3)
    return cut.reshape(n, rows, columns, -1).float().div(127.5).sub(1.0)


class Sight(nn.Module):  # type: ignore[misc]  # torch is looked at by no type checker here
    """Chances that the words of objects' names name what a patch of a picture shows.

    Objects of a kind look alike in every scene: what is learned here holds in scenes that were never seen. It shares
    nothing with the network that tells places apart, which learns scenes by heart.
    """

    def __init__(self, words: int, channels: tuple[int, int, int]) -> None:
        super().__init__()
        fine, middle, coarse = channels
        self.patches = nn.Linear(4 * PATCH_PX**2, fine)
        self.halved = nn.Conv2d(fine, middle, 3, stride=2, padding=1)
        self.quartered = nn.Conv2d(middle, coarse, 3, stride=2, padding=1)
        # A patch's own pixels, and what surrounds it, of two sizes.
        self.joined = nn.ModuleList(nn.Conv2d(n, _WIDTH, 1) for n in channels)
        self.words = nn.Linear(_WIDTH, words + 1)
        self.to(memory_format=torch.channels_last)

    def forward(self, pictures: Any, keep: Any = None) -> Any:
        """Name patches of pictures (n, H, W, 4): logits (patches, words + 1), the last of no object."""
        cut = as_patches(pictures)
        n, rows, columns, _ = cut.shape
        fine = functional.relu(self.patches(cut))
        fine = fine.permute(0, 3, 1, 2)
        middle = functional.relu(self.halved(fine))
        coarse = functional.relu(self.quartered(middle))
        known = 0.0
        for layer, of in zip(self.joined, (fine, middle, coarse), strict=True):
            known = known + functional.interpolate(
                layer(of), size=(rows, columns), mode="bilinear", align_corners=False
            )
        flat = functional.relu(known).permute(0, 2, 3, 1).reshape(n * rows * columns, _WIDTH)
        if keep is not None:
            return self.words(flat[keep])
        return self.words(flat).view(n, rows * columns, -1)
