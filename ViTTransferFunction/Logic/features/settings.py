"""How features are extracted, and the names of what comes out."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..core.system.errors import InputError
from ..core.volumes.geometry import Geometry
from ..core.volumes.intensity_window import IntensityWindow, full_range_window
from ..core.volumes.orientation import canonical_orientation
from ..core.volumes.volume import Volume
from .network_channels import NetworkChannels, network_channels
from .precision import Precision, precision_name

if TYPE_CHECKING:
    import torch

SMALLEST_GRID, LARGEST_GRID = 4, 128
CELL_DECIMALS = 4
"""To which edges count, in cells: a volume that is turned, or stored in single precision, is as long as before but for rounding
errors, and has the same cells, also where an edge is half a cell longer than a whole number of them."""
FORMAT_VERSION = 13
"""Part of every key: to be raised when the same settings come to give other features, or these other whitened ones."""
FINE_SPACING_MM = 0.0073
"""Below it, units of 2⁻¹⁴ mm would round away the proportions of voxels. Neither it nor a half of a half of it is a usual size,
of which rounding errors would decide on which side it is."""


@dataclass(frozen=True)
class FeatureSettings:
    """How features are extracted.

    Attributes:
        grid: number of cells along the volume's longest edge, at least.
        largest_cell_mm: where cells would be larger by `grid`, more of them, but in all no more than a cube has, grid³: then a
            click takes no longer in a long volume than in a cube, and what is thin in it is seen. None: `grid` alone.
        most_patches: of all slices together, about; where one patch a cell would be more, patches are larger than cells, and
            features are interpolated before they are compared. None: one patch a cell, whatever it takes.
        layer_step: run the slices of every n-th layer of patches and interpolate between; 1 runs all.
        isotropic: cells are cubes in millimetres; otherwise they have the voxels' proportions, as in the paper.
        canonical: show the network slices as a person would look at them (`orientation`); otherwise as they are stored, as
            in the paper.
        every_slice: run every slice and average-pool, as in the paper; otherwise one slice through a layer's centre.
        merge_background: let a few tokens stand for the air around the body (`background_tokens`).
        window: of intensities that the network sees: chosen from the volume ("robust", `network_channels`), from its smallest
            to its largest value ("full range", as in the paper), or as given.
        precision: of the network; "device": the one that suits the device (`device_precision`).

    Raises:
        InputError: `grid`, `most_patches` or `layer_step` is out of range, or layers are to be skipped and pooled at once.
    """

    grid: int = 64
    largest_cell_mm: float | None = None
    most_patches: int | None = None
    layer_step: int = 1
    isotropic: bool = True
    canonical: bool = True
    every_slice: bool = False
    merge_background: bool = True
    window: IntensityWindow | Literal["robust", "full range"] = "robust"
    precision: Precision | Literal["device"] = "device"

    def __post_init__(self) -> None:
        check_grid(self.grid)
        if self.most_patches is not None and self.most_patches < 1:
            raise InputError(f"The network must see 1 patch or more; got {self.most_patches}.")
        if self.layer_step < 1 or (self.every_slice and self.layer_step > 1):
            raise InputError(f"layer_step must be 1 or more, and 1 where every slice is run; got {self.layer_step}.")

    def channels_for(self, volume: Volume) -> NetworkChannels:
        """The colour channels in which the network sees `volume`."""
        if self.window == "robust":
            return network_channels(volume)
        return NetworkChannels.grey(full_range_window(volume.whole) if self.window == "full range" else self.window)

    def with_grid(self, grid: int) -> FeatureSettings:
        """The same settings with `grid` cells along the longest edge, however large they are."""
        return replace(self, grid=grid, largest_cell_mm=None)

    def on(self, device: torch.device) -> FeatureSettings:
        """The same settings with the precision that they come to on `device`."""
        return replace(self, precision=precision_name(device)) if self.precision == "device" else self

    def dtype_on(self, device: torch.device) -> torch.dtype:
        """The precision to use on `device`."""
        import torch

        dtype: torch.dtype = getattr(torch, self.on(device).precision)
        return dtype


def check_grid(grid: int) -> None:
    """Raise InputError unless a grid may have so many cells along the volume's longest edge."""
    if not SMALLEST_GRID <= grid <= LARGEST_GRID:
        raise InputError(f"The grid must have {SMALLEST_GRID} to {LARGEST_GRID} cells; got {grid}.")


def grid_shape(geometry: Geometry, settings: FeatureSettings) -> tuple[int, int, int]:
    """Number of cells along (K, J, I): `grid` along the longest edge or more (`FeatureSettings`), the others in proportion."""
    finer = settings.grid
    if settings.largest_cell_mm is not None:
        finer = min(math.ceil(round(geometry.extent_mm.max() / settings.largest_cell_mm, CELL_DECIMALS)), LARGEST_GRID)
    shapes = (shape_along(geometry, longest, settings.isotropic) for longest in range(finer, settings.grid, -1))
    coarsest = shape_along(geometry, settings.grid, settings.isotropic)
    return next((shape for shape in shapes if math.prod(shape) <= settings.grid**3), coarsest)


def shape_along(geometry: Geometry, longest: int, isotropic: bool) -> tuple[int, int, int]:
    """A grid (K', J', I') of `longest` cells along the longest edge, the others in proportion, at least 1."""
    edges = geometry.extent_mm[::-1] if isotropic else np.array(geometry.shape, dtype=float)
    in_cells = np.round(edges * longest / edges.max(), CELL_DECIMALS)
    cells = np.maximum(1, np.round(in_cells)).astype(int)
    return int(cells[0]), int(cells[1]), int(cells[2])


def feature_key(volume: Volume, model_name: str, weights_digest: str, settings: FeatureSettings, device: torch.device) -> str:
    """A name for the features of this content, model, settings and precision: hexadecimal SHA-256.

    Of the device only the precision counts that the settings come to on it (`FeatureSettings.on`). Of the volume's place in the
    patient only what the network sees of it counts: a volume that is moved, or turned a little, keeps its features.
    """
    digest = hashlib.sha256()
    digest.update(f"{FORMAT_VERSION} {model_name} {weights_digest} {sorted(asdict(settings.on(device)).items())}".encode())
    digest.update(f"{canonical_orientation(volume.geometry)} {_rounded(volume.geometry.spacing_mm)}".encode())
    digest.update(volume.digest)
    return digest.hexdigest()


def _rounded(spacing_mm: np.ndarray) -> list[float]:
    """A volume's spacing, in units that are the same where it is turned, or where a file keeps fewer digits.

    400 mm / 512 is a whole number of these units, so that what is about as much is not rounded apart. Microscopes' voxels have
    smaller ones: features go by the proportions alone.
    """
    halvings = max(math.ceil(math.log2(FINE_SPACING_MM / spacing_mm.min())), 0)
    rounded: list[float] = np.rint(np.ldexp(spacing_mm, 14 + halvings)).tolist()
    return rounded
