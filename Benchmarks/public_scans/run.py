"""Public scans as `bench own_scans` takes them: `python dev.py bench public_scans --clones DIR --volumes OUT`.

DIR holds clones of the repositories that docs/RESULTS.md names (*Where are the scans from?*), as DIR/owner/repository, and
two packages, unpacked. Writes each scan and its segmentation, NAME.nii.gz and NAME.seg.nrrd, into OUT/not_looked_at,
OUT/lung_nodules or OUT/other_kinds. Nothing is resampled. A scan whose files are not there is left out, with a word about it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from Benchmarks.public_scans.scans import SCANS, PublicScan
from ViTTransferFunction.Logic.core.classes.colors import default_color
from ViTTransferFunction.Logic.core.volumes.label_dtype import label_dtype
from ViTTransferFunction.Logic.files.segmentation_files import Segment, write_image, write_segmentation

TUMOUR = "tumour"
"""The structure that is written over all others: lungs and oedemas are drawn around it, and with it."""


def main() -> None:
    """Write every scan whose files are there."""
    options = _parser().parse_args()
    for folder, scans in SCANS.items():
        for scan in scans:
            missing = [path for path in scan.paths if not (options.clones / path).exists()]
            if missing:
                print(f"{scan.name}: left out, {options.clones / missing[0]} is not there.")
            else:
                write(scan, options.clones, options.volumes / folder)


def write(scan: PublicScan, clones: Path, folder: Path) -> None:
    """Write a scan and its segmentation into a folder, and say how large each structure is."""
    folder.mkdir(parents=True, exist_ok=True)
    volume, masks = scan.read(*(clones / path for path in scan.paths))
    labels = np.zeros(volume.shape, label_dtype(len(masks)))
    names = list(masks)
    for name in sorted(names, key=TUMOUR.__eq__):
        labels[masks[name]] = names.index(name) + 1
    segments = [Segment(name, default_color(index)) for index, name in enumerate(masks)]
    write_image(folder / f"{scan.name}.nii.gz", volume.array, volume.geometry)
    write_segmentation(folder / f"{scan.name}.seg.nrrd", labels, volume.geometry, segments)
    counts = np.bincount(labels.ravel(), minlength=len(masks) + 1)[1:]
    millilitres = counts * volume.geometry.voxel_volume_mm3 / 1000.0
    print(f"{scan.name}:", ", ".join(f"{name} {ml:.3g} ml" for name, ml in zip(masks, millilitres, strict=True)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clones", type=Path, required=True, help="folder with the repositories, each as owner/repository")
    parser.add_argument("--volumes", type=Path, required=True, help="folder to write to")
    return parser


if __name__ == "__main__":
    main()
