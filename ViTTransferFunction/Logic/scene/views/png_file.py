"""Pictures in PNG files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOImage import vtkPNGWriter

from ...core.system.atomic_file import replacing


def save_png(picture: np.ndarray, path: Path) -> None:
    """Write a picture to `path`, whole or not at all; its folder is made if missing.

    Args:
        picture: (H, W, 3) uint8, or (H, W, 4) with the opacity of each pixel.
        path: of the file.

    Raises:
        InputError: the file cannot be written.
    """
    image = vtkImageData()
    image.SetDimensions(picture.shape[1], picture.shape[0], 1)
    # VTK counts rows from the bottom.
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(picture[::-1]).reshape(-1, picture.shape[2]), deep=True))
    # Written to memory: the file's own errors then come from Python, not from VTK's error log.
    writer = vtkPNGWriter()
    writer.SetInputData(image)
    writer.WriteToMemoryOn()
    writer.Write()
    with replacing(path) as temporary:
        temporary.write_bytes(vtk_to_numpy(writer.GetResult()).tobytes())
