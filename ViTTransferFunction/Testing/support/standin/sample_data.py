"""`SampleData` without a network: every sample is the chest CT of the package slicerio, which is Slicer's CTChest, smaller."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import slicer
import slicerio

from ViTTransferFunction.Logic.files.volume_files import read_volume
from ViTTransferFunction.Logic.scene.volumes.volume_nodes import set_image


class SampleDataLogic:
    """Keeps what modules register.

    Attributes:
        sources: the keyword arguments of each source.
    """

    sources: ClassVar[list[dict[str, Any]]] = []

    @staticmethod
    def registerCustomSampleDataSource(**source: Any) -> None:  # noqa: N802
        """Offer a data set."""
        if source not in SampleDataLogic.sources:
            SampleDataLogic.sources.append(source)


def downloadSample(sampleName: str) -> Any:  # noqa: N802
    """The node of a data set that was registered."""
    (source,) = (source for source in SampleDataLogic.sources if source["sampleName"] == sampleName)
    volume = read_volume(Path(slicerio.__file__).parent / "data" / "CTChest4.nrrd")
    node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", source["nodeNames"])
    set_image(node, volume.array, volume.geometry.ijk_to_ras)
    node.CreateDefaultDisplayNodes()
    return node
