"""Slicer's *Grow from seeds* on the clicks: the class `vtkImageGrowCutSegment` that its Segment Editor uses.

A user paints with a brush: to be given seeds of more than a voxel (`seeds.painted`). Air around the body is masked out.
"""

from __future__ import annotations

import numpy as np
import vtk
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from Benchmarks.accuracy.body_mask import body_mask
from Benchmarks.accuracy.seeds import Seeds
from ViTTransferFunction.Logic.core.volumes.volume import Volume


class GrowFromSeeds:
    """Grows seeds over one volume.

    Args:
        volume: the intensities.
    """

    def __init__(self, volume: Volume) -> None:
        self._shape = volume.shape
        self._spacing_mm = volume.geometry.spacing_mm[::-1]
        self._intensities = self._image(volume.array.astype(np.int16 if _fits(volume.array) else np.float32))
        self._air = self._image((~body_mask(volume)).astype(np.uint8))

    def __call__(self, seeds: Seeds) -> np.ndarray:
        """Labels (K, J, I) uint16 from the seeds."""
        from slicer import vtkImageGrowCutSegment

        said = np.zeros(self._shape, dtype=np.int16)
        # The filter takes 0 for "not said", so that background is a class of its own. Where both were said, clicks count.
        for of_kind in (~seeds.is_click, seeds.is_click):
            said[tuple(seeds.kji[of_kind].T)] = 1 + seeds.labels[of_kind]
        grow = vtkImageGrowCutSegment()
        grow.SetIntensityVolume(self._intensities)
        grow.SetSeedLabelVolume(self._image(said))
        grow.SetMaskVolume(self._air)
        grow.Update()
        grown = vtk_to_numpy(grow.GetOutput().GetPointData().GetScalars()).reshape(self._shape)
        return np.maximum(grown.astype(np.int32) - 1, 0).astype(np.uint16)

    def _image(self, array: np.ndarray) -> vtk.vtkImageData:
        image = vtk.vtkImageData()
        image.SetDimensions(*array.shape[::-1])
        image.SetSpacing(*self._spacing_mm[::-1])
        image.GetPointData().SetScalars(numpy_to_vtk(array.ravel(), deep=True))
        return image


def _fits(array: np.ndarray) -> bool:
    return bool(np.issubdtype(array.dtype, np.integer) and array.min() >= -32768 and array.max() <= 32767)
