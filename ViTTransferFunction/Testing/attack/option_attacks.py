"""Arguments of every command: odd values, paths that are none, outputs that are inputs or each other."""

from __future__ import annotations

import os
import random
import shutil

from ViTTransferFunction.Testing.attack.annotation_attacks import write_scan
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step, annotated
from ViTTransferFunction.Testing.attack.scans import Scan

REFUSED = frozenset({2})
NUMBERS = (
    "0", "-1", "1", "3", "4", "7", "128", "129", "1e9", "1e400", "nan", "inf", "-inf", "", " ", "x", "0x10", "१२", "1_0",
    "--", "-",
    "9" * 400, "5.5", "1e-320", "-1e308", "1e308", "100", "\u00a05",
)  # fmt: skip
PATHS = (
    "", ".", "..", "/", "-", "--", "~", "~nosuchuser/out.nii", "~/out.nii.gz", "a" * 300 + ".nii.gz", "a/" * 2100 + "out.nii",
    "pipe", "pipe.nrrd", "nul.nii", "out", "out.", ".nii", ".nii.gz",
    ".seg.nrrd", "out.png", "out.dcm", "out.nii.gz.nii.gz", "missing/deep/out.nii.gz", "clicks.json/out.nii.gz", "out.nrrd/",
    "out\n.nii", "out\x1b[31m.nii", "%s%n.mha", "%d.nii.gz", "患者.nii.gz", "\udcff.nii.gz", "out .nii", "out.nii ", "con.mha",
    "out.NII", "out.Nii.Gz", "OUT.SEG.NRRD", "out.MHA", "out.nhdr", "out.mhd", "out.seg.nrrd.gz", "out.vtk", "out.img",
    "out.hdr",
)  # fmt: skip


def options(chance: random.Random, place: Place) -> Case:
    """A command with one to three options of any value."""
    scan = write_scan(chance, place)
    (place.work / "folder").mkdir()
    # Never a real device: who may do anything would replace it.
    for name in ("pipe", "pipe.nrrd"):
        os.mkfifo(place.work / name)
    choices = {
        "--grid": NUMBERS,
        "--preset": ("balanced", "fine", "paper", "fast", "", "best", "\x1b", "a" * 3000),
        "--model": ("tiny", "dino_vits8", "dinov2_vits14", "dinov3_vits16", "", "x", "../x", "a" * 3000),
        "--weights": (str(place.weights), "missing.pt", "folder", "scan.nrrd", "", ".", "/dev/zero", "/dev/null",
        "~nosuchuser/w"),
        "--device": ("cpu", "auto", "cuda", "mps", "", "cpu:0", "meta"),
        "--refine": ("bilateral", "guided", "none", "", "x"),
        "--report": (*PATHS, "r.json"),
        "--similarity-dir": (*PATHS, "maps", "folder"),
        "-o": PATHS,
        "--annotations": (*PATHS, "clicks.json"),
    }  # fmt: skip
    arguments = ["segment", "scan.nrrd"]
    given = {"--annotations": "clicks.json", "--grid": "5", "-o": "out.nii.gz"}
    for name in chance.sample(list(choices), chance.randint(1, 3)):
        given[name] = chance.choice(choices[name])
    arguments += [part for name, value in given.items() for part in (name, value)]
    if chance.random() < 0.25:
        arguments += ["--window", chance.choice(NUMBERS), chance.choice(NUMBERS)]
    if chance.random() < 0.1:
        arguments += chance.choice(
            (["--keep-all-components"], ["--verbose"], ["--nonsense"], ["extra"], ["--help"], ["--grid"])
        )
    arguments = [argument.replace("\x00", "") for argument in arguments]
    return Case("options", " ".join(arguments[2:])[:200], [Step((place.call(*arguments),))], scan)


def windows(chance: random.Random, place: Place) -> Case:
    """Intensity windows off the data, without width, and of extreme width."""
    scan = write_scan(chance, place)
    low, high = chance.choice((
        ("0", "100"), ("1000", "2000"), ("-2000", "-1000"), ("0", "1e-30"), ("0", "1e38"), ("-1e308", "1e308"), ("-1e39",
        "1e39"),
        ("5", "5"), ("6", "5"), ("nan", "1"), ("-inf", "inf"), ("0", "inf"), ("1e16", "2e16"), ("-3.4e38", "3.4e38"), ("59",
        "61"),
    ))  # fmt: skip
    call = place.segment("scan.nrrd", "--window", low, high)
    return Case("windows", f"{low} to {high}", [Step((call,))], scan)


def colliding_outputs(chance: random.Random, place: Place) -> Case:
    """An output that is an input, or another output: by its name, through links, or in other letters."""
    scan = write_scan(chance, place)
    work = place.work
    names: dict[str, tuple[str, ...]] = {
        "output is the volume": ("scan.nrrd", "-o", "scan.nrrd"),
        "output is the volume, written otherwise": ("scan.nrrd", "-o", "./folder/../scan.nrrd"),
        "output is the volume, absolute": ("scan.nrrd", "-o", str(work / "scan.nrrd")),
        "output is a link to the volume": ("scan.nrrd", "-o", "link.nrrd"),
        "output is a hard link to the volume": ("scan.nrrd", "-o", "hard.nrrd"),
        "the volume is a link to the output": ("link.nrrd", "-o", "scan.nrrd"),
        "output lies in a linked folder": ("scan.nrrd", "-o", "linked/scan.nrrd"),
        "report is the volume": ("scan.nrrd", "-o", "out.nii.gz", "--report", "scan.nrrd"),
        "report is the annotations": ("scan.nrrd", "-o", "out.nii.gz", "--report", "clicks.json"),
        "report is a link to the annotations": ("scan.nrrd", "-o", "out.nii.gz", "--report", "link.json"),
        "report is the output": ("scan.nrrd", "-o", "out.nrrd", "--report", "out.nrrd"),
        "report is the output, written otherwise": ("scan.nrrd", "-o", "out.nrrd", "--report", "folder/../out.nrrd"),
        "report is the weights": ("scan.nrrd", "-o", "out.nrrd", "--report", "own.pth", "--weights", "own.pth"),
        "map is the volume": ("first.nii.gz", "-o", "out.nrrd", "--similarity-dir", "."),
        "map is the output": ("scan.nrrd", "-o", "first.nii.gz", "--similarity-dir", "."),
        "maps in a file": ("scan.nrrd", "-o", "out.nrrd", "--similarity-dir", "clicks.json"),
        "output is a folder": ("scan.nrrd", "-o", "folder"),
    }
    (work / "folder").mkdir()
    (work / "linked").symlink_to(".")
    (work / "link.nrrd").symlink_to("scan.nrrd")
    (work / "link.json").symlink_to("clicks.json")
    os.link(work / "scan.nrrd", work / "hard.nrrd")
    shutil.copy(place.weights, work / "own.pth")
    what = chance.choice([*names, "two maps of one name"])
    if what == "two maps of one name":
        return _two_maps_of_one_name(chance, place, scan)
    volume, *arguments = names[what]
    if volume == "first.nii.gz":
        shutil.copy(work / "scan.nrrd", work / "sound.nrrd")
        _convert(work, volume)
    call = place.call("segment", volume, "--annotations", "clicks.json", "--grid", "5", *arguments)
    return Case("colliding outputs", what, [Step((call,), REFUSED)], scan)


def _two_maps_of_one_name(chance: random.Random, place: Place, scan: Scan) -> Case:
    first, second = chance.choice((("a/b", "a:b"), ("liver", "Liver"), ("x ", "x"), ("a?", "a*"), ("ä", "a\u0308"), ("?", "*")))
    entries = annotated(scan)["classes"]
    entries[0]["name"], entries[1]["name"] = first, second
    place.write_clicks(scan, classes=entries)
    step = Step((place.segment("scan.nrrd", "--similarity-dir", "maps"),))

    def one_map_for_each_class(_: object) -> list[str]:
        if not (place.work / "out.nii.gz").exists():
            return []
        maps = {path.name.lower() for path in (place.work / "maps").iterdir()}
        return [] if len(maps) == 2 else [f"{len(maps)} maps of 2 classes"]

    return Case("colliding outputs", f"maps of {first!r} and {second!r}", [step], scan, judge=one_map_for_each_class)


def _convert(work: os.PathLike[str], name: str) -> None:
    import SimpleITK as sitk  # noqa: N813

    sitk.WriteImage(sitk.ReadImage(os.path.join(work, "scan.nrrd")), os.path.join(work, name))  # noqa: PTH118


def other_commands(chance: random.Random, place: Place) -> Case:
    """`features`, `cache`, `weights`, and what is no command."""
    write_scan(chance, place)
    shutil.copy(place.work / "scan.nrrd", place.work / "\udcff.nrrd")
    if chance.random() < 0.5:
        _fill_cache_with_other_things(place)
    arguments = chance.choice((
        [], ["segment"], ["--help"], ["segment", "--help"], ["nonsense"], ["cache"], ["cache", "info"], ["cache", "clear"],
        ["cache", "empty"], ["weights"], ["weights", "list"], ["weights", "get", "nonsense"], ["weights", "get", "tiny"],
        ["weights", "get", "dinov2_vits14"], ["weights", "get", "dinov3_vits16"], ["weights", "remove", "tiny"],
        ["weights", "remove", "nonsense"], ["weights", "remove", "../../x"], ["features", "scan.nrrd", "--grid", "4"],
        ["features", "missing"], ["features", "scan.nrrd", "--weights", "scan.nrrd"], ["features", "clicks.json"],
        ["features", "scan.nrrd", "--model", "dinov2_vits14"], ["features", ""], ["features", "\udcff"], ["", ""],
        ["features", "\udcff.nrrd"],
    ))  # fmt: skip
    environment = chance.choice((
        {}, {}, {}, {"VITTF_CACHE": "~nosuchuser"}, {"VITTF_WEIGHTS": ""},
        {"VITTF_CACHE": "clicks.json"}, {"VITTF_CACHE": "a" * 300}, {"VITTF_WEIGHTS": "missing"},
        {"VITTF_WEIGHTS": "scan.nrrd"}, {"VITTF_WEIGHTS": "."}, {"LANG": "C", "LC_ALL": "C"}, {"VITTF_WEIGHTS": "~nosuchuser"},
    ))  # fmt: skip
    kept = {path: path.read_bytes() for path in place.cache.rglob("*") if path.is_file()} if place.cache.exists() else {}
    call = place.call(*arguments, environment=environment)

    def others_are_kept(_: object) -> list[str]:
        return [f"removed or changed {path.name} in the cache" for path, was in kept.items() if _content(path) != was]

    codes = frozenset({0, 2})
    return Case("commands", f"{' '.join(arguments)[:100]} {environment}", [Step((call,), codes)], judge=others_are_kept)


def _content(path: os.PathLike[str]) -> bytes | None:
    try:
        with open(path, "rb") as file:  # noqa: PTH123
            return file.read()
    except OSError:
        return None


def _fill_cache_with_other_things(place: Place) -> None:
    for folder in ("features", "weights"):
        (place.cache / folder).mkdir(parents=True)
        for name in ("notes.txt", "mine.npz", ".hidden.npz", "photo.jpg"):
            (place.cache / folder / name).write_text("somebody else's")
        (place.cache / folder / "a folder.npz").mkdir()
        (place.cache / folder / "nothing.npz").symlink_to("nowhere")
    place.cache.chmod(0o777)
