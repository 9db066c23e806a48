"""Volumes: of every format, size, type and position; damaged; with headers that lie; with values that are none."""

from __future__ import annotations

import gzip
import os
import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ViTTransferFunction.Testing.attack.calls import Call
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step
from ViTTransferFunction.Testing.attack.damage import DAMAGES, damage_file, flip_bits, truncate
from ViTTransferFunction.Testing.attack.scans import (
    META_TYPES,
    NRRD_TYPES,
    Scan,
    make_scan,
    meta,
    meta_fields,
    nifti,
    nifti_header,
    nrrd,
    nrrd_fields,
    write_dicom,
    write_moved_dicom,
)

DONE, REFUSED = frozenset({0}), frozenset({2})
OUTPUTS = ("out.nii.gz", "out.seg.nrrd", "out.nrrd", "out.mha", "out.nii", "OUT.SEG.NRRD", "out.NII.GZ")


def a_sound_volume(chance: random.Random, place: Place) -> Case:
    """Any sound volume is segmented, whatever its format, size, type and position."""
    scan = make_scan(chance, tuple(META_TYPES))
    name = write_volume(chance, place.work, scan)
    place.write_clicks(scan)
    further = chance.choice(([], [], ["--report", "r.json"], ["--similarity-dir", "maps"], ["--refine", "none"]))
    call = place.segment(name, *further, output=chance.choice(OUTPUTS))
    what = f"{name}, {scan.array.dtype}, {'×'.join(map(str, scan.array.shape[::-1]))} of {scan.spacing} mm"
    known = _right_handed(scan) or name != "series"
    return Case("sound volume", what, [Step((call,), DONE)], scan if known else None)


def a_damaged_volume(chance: random.Random, place: Place) -> Case:
    """A file with flipped bits, without its end, or with other bytes in between."""
    scan = make_scan(chance, tuple(META_TYPES))
    name = write_volume(chance, place.work, scan)
    path = place.work / name
    place.write_clicks(scan)
    step = Step((_segment_anything(chance, place, name),))
    if path.is_dir():
        chosen = chance.choice(sorted(path.iterdir()))
        return Case("damaged volume", f"{name}: {damage_file(chosen, chance)} of one slice", [step])
    content = path.read_bytes()
    how = chance.choice((*DAMAGES, flip_bits, truncate))
    if how is truncate:
        # What is promised and not there must be missed.
        step = replace(step, codes=REFUSED)
        path = next((path.with_suffix(end) for end in (".raw", ".img") if path.with_suffix(end).exists()), path)
        path.write_bytes(truncate(path.read_bytes(), chance))
    else:
        path.write_bytes(flip_bits(content, chance, within=400) if chance.random() < 0.5 else how(content, chance))
    return Case("damaged volume", f"{name}: {how.__name__}", [step])


def a_header_that_lies(chance: random.Random, place: Place) -> Case:
    """A header that says something else than there is."""
    scan = make_scan(chance, tuple(META_TYPES))
    place.write_clicks(scan)
    name, what = chance.choice((_lying_nifti, _lying_nrrd, _lying_meta))(chance, place.work, scan)
    return Case("header that lies", f"{name}: {what}", [Step((_segment_anything(chance, place, name),))])


def odd_values(chance: random.Random, place: Place) -> Case:
    """Voxels that are no numbers, infinite, all the same, or extreme."""
    scan = make_scan(chance, ("float32", "float64"))
    array, largest = scan.array.copy(), float(np.finfo(scan.array.dtype).max)
    noise = np.random.default_rng(chance.getrandbits(32))
    some = noise.random(array.shape) < chance.choice((0.01, 0.3, 0.95))
    changes: dict[str, Callable[[], Any]] = {
        "some NaN": lambda: array.__setitem__(some, np.nan),
        "some infinite": lambda: array.__setitem__(some, chance.choice((np.inf, -np.inf))),
        "all NaN": lambda: array.fill(np.nan),
        "constant": lambda: array.fill(chance.choice((0.0, -1024.0, 1e30))),
        "two values": lambda: array.__setitem__(..., (array > array.mean()) * chance.choice((1.0, 1e-30, 1e30))),
        "the largest numbers": lambda: array.__setitem__(some, largest),
        "both extremes": lambda: (array.__setitem__(some, largest), array.__setitem__(~some, -largest)),
        "subnormal": lambda: array.__imul__(1e-310 if array.dtype == np.float64 else 1e-42),
        "a large offset": lambda: array.__iadd__(1e16),
        "one voxel of metal": lambda: array.__setitem__((0, 0, 0), 1e6),
        "negated": lambda: array.__imul__(-1.0),
    }
    what = chance.choice(list(changes))
    changes[what]()
    name = write_volume(chance, place.work, replace(scan, array=array), ("nii", "nrrd", "mha"))
    place.write_clicks(scan)
    return Case("odd values", f"{array.dtype}, {what}", [Step((_segment_anything(chance, place, name),))], scan)


def an_odd_file(chance: random.Random, place: Place) -> Case:
    """Something else where a volume is expected, or a volume under another name."""
    scan = make_scan(chance, ("int16", "uint8", "float32"))
    place.write_clicks(scan)
    work, sound = place.work, nifti(nifti_header(scan), scan.array)
    codes, name = REFUSED, "scan.nii"
    path = work / name
    what = chance.choice((
        "missing", "empty", "folder", "empty folder", "pipe", "device", "link to nothing", "link to itself", "text", "another",
        "compressed twice", "not compressed", "another name's", "twin", "link", "a name", "no rights",
    ))  # fmt: skip
    if what == "empty":
        path.touch()
    elif what == "folder":
        path.mkdir()
        (path / "notes.txt").write_text("no slices here")
    elif what == "empty folder":
        path.mkdir()
    elif what == "pipe":
        os.mkfifo(path)
    elif what == "device":
        name = chance.choice(("/dev/zero", "/dev/full", "/dev/null", "/dev/stdin", "/dev/tty"))
    elif what in ("link to nothing", "link to itself"):
        path.symlink_to("nowhere.nii" if what == "link to nothing" else name)
    elif what == "text":
        path.write_text(chance.choice(("hello", "NRRD0004\n", "ObjectType = Image\n", "{}", "\x00" * 400)))
    elif what == "another":
        name = "scan" + chance.choice((".png", ".txt", "", ".zip", ".hdr", ".img.gz"))
        (work / name).write_bytes(chance.randbytes(500))
    elif what == "compressed twice":
        name = "scan.nii.gz"
        (work / name).write_bytes(gzip.compress(gzip.compress(sound)))
    elif what == "not compressed":
        name, codes = "scan.nii.gz", frozenset({0, 2})
        (work / name).write_bytes(sound)
    elif what == "another name's":
        name, codes = "scan" + chance.choice((".nrrd", ".mha", ".hdr", ".img", ".dcm", ".NII", "")), frozenset({0, 2})
        (work / name).write_bytes(sound)
    elif what == "twin":
        # The file beside it holds another scan; what was named counts.
        other = make_scan(chance, ("int16",))
        compressed = gzip.compress(sound)
        twin = gzip.compress(nifti(nifti_header(other), other.array))
        name = chance.choice(("scan.nii", "scan.nii.gz"))
        path.write_bytes(sound if name == "scan.nii" else gzip.decompress(twin))
        (work / "scan.nii.gz").write_bytes(compressed if name == "scan.nii.gz" else twin)
        return Case("odd file", what, [Step((_segment_anything(chance, place, name),), frozenset({0, 2}))], scan)
    elif what == "link":
        (work / "real").mkdir()
        (work / "real" / "s.nii").write_bytes(sound)
        path.symlink_to("real/s.nii")
        codes = DONE
    elif what == "a name":
        name = chance.choice(ODD_NAMES) + ".nii"
        codes = frozenset({0, 2})
        (work / name).write_bytes(sound)
        name = f"./{name}"
    elif what == "no rights":
        path.write_bytes(sound)
        path.chmod(0)
        return Case("odd file", what, [Step((_segment_anything(chance, place, name, without_rights=True),), codes)])
    return Case("odd file", f"{what}: {name}", [Step((_segment_anything(chance, place, name),), codes)])


ODD_NAMES = (
    "with blanks ", "ünïcödé", "患者", "%s%n%d", "a" * 240, "new\nline", "tab\t", "semi;colon", "quote'\"", "$HOME", "-dash",
    "..x",
    "*", "[x]", "a=b", "~", "\x1b[31mred", "nii.gz", ".hidden", "x.seg.nrrd",
)  # fmt: skip


def _segment_anything(chance: random.Random, place: Place, name: str, **of_call: Any) -> Call:
    """Segment a volume of which it is not sure that it can be; sometimes there is an older result already."""
    output = chance.choice(OUTPUTS)
    if chance.random() < 0.3:
        (place.work / output).write_text("an older result")
    if chance.random() < 0.1:
        return place.call("features", name, "--grid", "5", **of_call)
    return place.segment(name, output=output, **of_call)


def write_volume(chance: random.Random, folder: Path, scan: Scan, formats: tuple[str, ...] = ()) -> str:
    """Write a scan in one of many formats; returns the name of the file, or of the folder."""
    as_format = chance.choice(formats or ("nii", "nii", "nii.gz", "nrrd", "nrrd.gz", "nhdr", "mha", "mha", "mhd", "dicom"))
    if as_format in ("nii", "nii.gz") and scan.array.dtype.kind in "iuf":
        content = nifti(nifti_header(scan), scan.array)
        (folder / f"scan.{as_format}").write_bytes(content if as_format == "nii" else gzip.compress(content, mtime=0))
        return f"scan.{as_format}"
    if as_format in ("nrrd", "nrrd.gz", "nhdr"):
        return _write_nrrd(folder, scan, as_format)
    if as_format in ("mha", "mhd"):
        content = scan.array.tobytes()
        if as_format == "mhd":
            (folder / "scan.raw").write_bytes(content)
            (folder / "scan.mhd").write_bytes(meta(meta_fields(scan, "scan.raw"), b""))
        else:
            (folder / "scan.mha").write_bytes(meta(meta_fields(scan), content))
        return f"scan.{as_format}"
    write_dicom(folder / "series", scan)
    return "series"


def _write_nrrd(folder: Path, scan: Scan, as_format: str) -> str:
    fields = nrrd_fields(scan)
    if as_format == "nhdr":
        (folder / "scan.raw").write_bytes(scan.array.tobytes())
        (folder / "scan.nhdr").write_bytes(nrrd({**fields, "data file": "scan.raw"}, scan.array)[: -scan.array.nbytes])
        return "scan.nhdr"
    if as_format == "nrrd.gz":
        fields["encoding"] = "gzip"
    (folder / "scan.nrrd").write_bytes(nrrd(fields, scan.array))
    return "scan.nrrd"


def a_dicom_folder(chance: random.Random, place: Place) -> Case:
    """A series with slices that are missing, there twice, elsewhere, of another size or another series, or damaged."""
    scan = make_scan(chance, ("int16", "uint8"))
    place.write_clicks(scan)
    folder = place.work / "series"
    paths = write_dicom(folder, scan)
    what = chance.choice((
        "sound", "a slice is missing", "a slice is there twice", "two series", "another size", "damaged", "foreign file",
        "empty",
        "one slice", "a file of it", "other orientation", "a tilted gantry", "uneven distances",
    ))  # fmt: skip
    name, codes = "series", frozenset({0, 2})
    if what == "a slice is missing":
        chance.choice(paths).unlink()
    elif what == "a slice is there twice":
        shutil.copy(chance.choice(paths), folder / "again.dcm")
    elif what == "two series":
        write_dicom(folder, make_scan(chance, ("int16",)), series="1.2.3.4", first=500)
        codes = REFUSED
    elif what in ("another size", "other orientation"):
        write_dicom(folder, make_scan(chance, ("int16",)), first=500)
    elif what == "damaged":
        what += ", " + damage_file(chance.choice(paths), chance)
    elif what == "foreign file":
        (folder / "DICOMDIR").write_bytes(chance.randbytes(300))
        (folder / "readme.txt").write_text("a note")
    elif what == "empty":
        for path in paths:
            path.write_bytes(b"")
        codes = REFUSED
    elif what == "one slice":
        for path in paths[1:]:
            path.unlink()
        codes = REFUSED
    elif what in ("a tilted gantry", "uneven distances"):
        along = scan.direction[:, 1 if what == "a tilted gantry" else 2]
        steps = [chance.choice((1.0, 1.0, 1.5, 4.0)) for _ in paths] if what == "uneven distances" else [1.0] * len(paths)
        far_mm = scan.spacing[2] * chance.choice((0.05, 0.3, 0.7, 5.0))
        write_moved_dicom(folder, scan, far_mm * np.cumsum(steps)[:, None] * along)
    elif what == "a file of it":
        name, codes = f"series/{paths[0].name}", REFUSED
    return Case(
        "DICOM",
        what,
        [Step((_segment_anything(chance, place, name),), codes)],
        scan if what == "sound" and _right_handed(scan) else None,
    )


def _right_handed(scan: Scan) -> bool:
    return bool(np.linalg.det(scan.direction) > 0)


def _lying_nifti(chance: random.Random, folder: Path, scan: Scan) -> tuple[str, str]:
    header = nifti_header(scan)
    number = chance.choice((0.0, -1.0, np.nan, np.inf, 1e-5, 1e-30, 1e30, 1000.0))
    size = chance.choice((0, -1, 1, 2, 3, 7, 300, 32767))
    axis = chance.randrange(1, 4)
    lies: dict[str, Callable[[], object]] = {
        f"dim[{axis}] = {size}": lambda: header["dim"].__setitem__(axis, size),
        f"all dim = {size}": lambda: header["dim"].__setitem__(slice(1, 4), size),
        f"dim[0] = {size}": lambda: header["dim"].__setitem__(0, size),
        f"dim[4] = {size}": lambda: (header["dim"].__setitem__(0, 4), header["dim"].__setitem__(4, size)),
        f"datatype = {size}": lambda: header.__setitem__("datatype", size),
        "datatype complex": lambda: header.__setitem__("datatype", 32),
        "datatype rgb": lambda: header.__setitem__("datatype", 128),
        f"bitpix = {size}": lambda: header.__setitem__("bitpix", size),
        f"pixdim[{axis}] = {number}": lambda: header["pixdim"].__setitem__(axis, number),
        f"all pixdim = {number}": lambda: header["pixdim"].__setitem__(slice(1, 4), number),
        f"vox_offset = {number}": lambda: header.__setitem__("vox_offset", number),
        f"vox_offset = {size}": lambda: header.__setitem__("vox_offset", size),
        f"scl_slope = {number}": lambda: header.__setitem__("scl_slope", number),
        f"scl_inter = {number}": lambda: (header.__setitem__("scl_slope", 1), header.__setitem__("scl_inter", number)),
        f"srow has {number}": lambda: header["srow"].__setitem__((chance.randrange(3), chance.randrange(4)), number),
        f"srow all {number}": lambda: header.__setitem__("srow", number),
        f"srow × {number}": lambda: header.__setitem__("srow", header["srow"] * number),
        f"quaternion {number}": lambda: (
            header.__setitem__("sform_code", 0),
            header.__setitem__("qform_code", 1),
            header.__setitem__("quatern", number),
        ),
        "no form": lambda: header.__setitem__("sform_code", 0),
        "metres": lambda: (
            header.__setitem__("xyzt_units", 1),
            header.__setitem__("srow", header["srow"] / 1000),
            header.__setitem__("pixdim", header["pixdim"] / 1000),
        ),
        f"units {size}": lambda: header.__setitem__("xyzt_units", size % 256),
        f"sizeof_hdr = {size}": lambda: header.__setitem__("sizeof_hdr", size),
        "magic": lambda: header.__setitem__("magic", chance.choice((b"ni1", b"n+2", b"", b"abcd"))),
        "other byte order": lambda: header.__setitem__("dim", header["dim"].byteswap()),
        "an extension": lambda: None,
    }
    what = chance.choice(list(lies))
    with np.errstate(all="ignore"):
        lies[what]()
    content = nifti(header, scan.array)
    if what == "an extension":
        content = content[:348] + b"\x01\0\0\0" + chance.randbytes(chance.choice((8, 16, 64))) + content[352:]
    name = chance.choice(("scan.nii", "scan.nii.gz"))
    (folder / name).write_bytes(content if name == "scan.nii" else gzip.compress(content))
    return name, what


ODD_FIELDS = (
    "", "0", "-1", "nan", "inf", "1e400", "99999999999999999999", "%s%s%s%n", "a" * 3000, "(1,0,0)", "none", "(nan,nan,nan)",
    "1 1",
    "0 0 0", "-3 4 5", "4 4 4", "1000000 1000000 1000000", "30000 30000 30000", "1e-5 1e-5 1e-5", "nan nan nan", "1 1 1 1",
    "x y z",
    "0 0 0 0 0 0 0 0 0", "\ufeff", "../../../etc/passwd", "/dev/zero", "/dev/stdin", "block", "short", "True",
)  # fmt: skip
"""Values of fields of text headers."""


def _lie(fields: dict[str, str], chance: random.Random, further: dict[str, tuple[str, ...]]) -> str:
    name = chance.choice([*fields, *further])
    value = chance.choice((*ODD_FIELDS, *further.get(name, ()) * 8))
    how = chance.randrange(6)
    if how == 0 and name in fields:
        del fields[name]
        return f"no {name}"
    fields[name] = value
    return f"{name} is {value[:40]!r}"


def _lying_nrrd(chance: random.Random, folder: Path, scan: Scan) -> tuple[str, str]:
    fields = nrrd_fields(scan)
    sizes = fields["sizes"].split()
    further = {
        "encoding": ("gzip", "bzip2", "hex", "ascii", "RAW"),
        "type": (*NRRD_TYPES.values(), "block", "complex"),
        "sizes": (" ".join(sizes[::-1]), " ".join([*sizes, "2"]), f"{int(sizes[0]) + 1} {sizes[1]} {sizes[2]}"),
        "endian": ("big",),
        "space": ("right-anterior-superior", "scanner-xyz", "3D-right-handed"),
        "data file": ("missing.raw", "LIST", "scan.nrrd", "pipe", "%d.raw 1 3 1", "clicks.json"),
        "byte skip": ("-1", "-2", "10", "999999999"),
        "line skip": ("1", "-1", "99999"),
        "spacings": ("1 1 1", "nan nan nan", "0 0 0"),
        "space units": ('"m" "m" "m"', '"mm" "mm" "mm"'),
        "dimension": ("2", "4", "16", "17"),
        "kinds": ("vector domain domain", "list domain domain"),
        "space directions": ("(0,0,0) (0,0,0) (0,0,0)", "(1,0,0) (1,0,0) (0,0,1)", "(1e-5,0,0) (0,1e-5,0) (0,0,1e-5)"),
    }
    what = _lie(fields, chance, further)
    if fields.get("data file") == "pipe":
        os.mkfifo(folder / "pipe")
    (folder / "scan.nrrd").write_bytes(nrrd(fields, scan.array))
    return "scan.nrrd", what


def _lying_meta(chance: random.Random, folder: Path, scan: Scan) -> tuple[str, str]:
    fields = meta_fields(scan)
    sizes = fields["DimSize"].split()
    further = {
        "ElementDataFile": (
            "missing.raw", "LIST", "%s", "%d%d", "scan%03d.raw 1 3 1", "%n%n%n", "pipe", "scan.mha", "clicks.json",
            "LIST 2", "Local", "a" * 4000,
        ),
        "ElementType": (*META_TYPES.values(), "MET_OTHER", "MET_STRING", "MET_FLOAT_ARRAY"),
        "DimSize": (" ".join(sizes[::-1]), f"{int(sizes[0]) + 1} {sizes[1]} {sizes[2]}", f"{sizes[0]} {sizes[1]}"),
        "NDims": ("2", "4", "10", "11", "100"),
        "ElementNumberOfChannels": ("2", "0", "3", "-1"),
        "CompressedData": ("True",),
        "CompressedDataSize": ("10", "-1", "99999999999"),
        "HeaderSize": ("-1", "100", "99999"),
        "BinaryDataByteOrderMSB": ("True",),
        "BinaryData": ("False",),
        "TransformMatrix": ("1 0 0 1 0 0 0 0 1", "0 0 0 0 0 0 0 0 0", "2 0 0 0 2 0 0 0 2", "nan 0 0 0 1 0 0 0 1"),
        "ElementSpacing": ("0.001 0.001 0.001", "0 1 1", "-1 1 1", "1e-5 1e-5 1e-5", "nan 1 1"),
        "Offset": ("1e300 0 0", "nan 0 0", "inf 0 0"),
    }  # fmt: skip
    what = _lie(fields, chance, further)
    data = fields.get("ElementDataFile", "")
    if "ElementDataFile" in fields:
        # It is the last field, by the format.
        fields["ElementDataFile"] = fields.pop("ElementDataFile")
    if data == "pipe":
        os.mkfifo(folder / "pipe")
    (folder / "scan.mha").write_bytes(meta(fields, scan.array.tobytes()))
    return "scan.mha", what
