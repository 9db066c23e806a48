"""Slices as the network reads them: in three colour channels, resized to whole patches, normalised."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..core.volumes.torch_arrays import tensor_of
from .background_tokens import TokenSelection
from .line_resizing import resizing_matrix
from .network_channels import NetworkChannels
from .slice_sampling import slice_at

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from .packed_slices import PatchTokens

CHANNEL_MEAN = (0.485, 0.456, 0.406)
CHANNEL_STD = (0.229, 0.224, 0.225)


class SlicePatches:
    """The patches of a volume's slices across one axis.

    Args:
        array: (K, J, I) intensities, as the network is to see them.
        channels: colours that intensities are shown in.
        axis: across which the slices run.
        shape: patches along the array's axes.
        patch_size: of the network, pixels.
        device: where to compute.
    """

    def __init__(
        self,
        array: np.ndarray,
        channels: NetworkChannels,
        axis: int,
        shape: tuple[int, int, int],
        patch_size: int,
        device: torch.device,
    ) -> None:

        self._array, self._colors, self._axis, self._patch_size = array, channels.colors, axis, patch_size
        across = [other for other in range(3) if other != axis]
        self.rows, self.columns = (shape[other] for other in across)
        self._to_rows, self._to_columns = (
            resizing_matrix(array.shape[other], shape[other] * patch_size).to(device) for other in across
        )

    def tokens(self, position: float, chosen: TokenSelection) -> PatchTokens:
        """The chosen patches of the slice at `position`, as the network takes them."""
        from .packed_slices import PatchTokens

        channels = tensor_of(self._channels(slice_at(self._array, self._axis, position)))
        image = self._to_rows @ channels.to(self._to_rows.device) @ self._to_columns.T
        size = self._patch_size
        patches = image.reshape(3, self.rows, size, self.columns, size).permute(1, 3, 0, 2, 4)
        if len(chosen.places) == self.rows * self.columns:
            return PatchTokens(patches.reshape(self.rows * self.columns, -1), self.rows, self.columns)
        places, multiplicity = tensor_of(chosen.places), tensor_of(chosen.multiplicity)
        of_places = patches[places // self.columns, places % self.columns].flatten(1)
        return PatchTokens(of_places, self.rows, self.columns, places, multiplicity)

    def _channels(self, intensities: np.ndarray) -> np.ndarray:
        """A slice in the three colours, (3, rows, columns) float32, normalised; resizing it keeps it so."""
        shown = {color: color.apply(intensities) for color in set(self._colors)}
        channels = zip(self._colors, CHANNEL_MEAN, CHANNEL_STD, strict=True)
        return np.stack([(shown[color] - np.float32(mean)) / np.float32(std) for color, mean, std in channels])

    def spread(self, keys: Tensor, chosen: TokenSelection) -> Tensor:
        """Keys (T, C) of the chosen patches, in the places of all that they represent: (rows, columns, C)."""
        return keys[tensor_of(chosen.representative).to(keys.device)].reshape(self.rows, self.columns, -1)
