"""Full disks, folders that cannot be written, consoles that are gone, signals at any moment, and several runs at once."""

from __future__ import annotations

import os
import random
import stat
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ViTTransferFunction.Testing.attack.annotation_attacks import write_scan
from ViTTransferFunction.Testing.attack.cases import Case, Place, Step

DONE, REFUSED = frozenset({0}), frozenset({2})
OUTPUTS = ("out.nii.gz", "out.nii", "out.nrrd", "out.seg.nrrd", "out.mha")
PAGE_BYTES = 4096


def a_quota(chance: random.Random, place: Place) -> Case:
    """No file may grow beyond a size that is too small for a result, or for the features in the cache, or for neither."""
    scan = write_scan(chance, place)
    output, largest = chance.choice(OUTPUTS), chance.choice((0, 1, 100, 200, 352, 400, 700, 1000, 2000, 4000, 10_000))
    further = chance.choice(([], ["--similarity-dir", "maps"], ["--report", "r.json"]))
    sound = place.segment("scan.nrrd", output=f"sound_{output}", environment={"VITTF_CACHE": str(place.other_cache)})
    limited = place.segment("scan.nrrd", *further, output=output, largest_file_bytes=largest)
    steps = [
        Step((sound,), DONE),
        Step((limited,), late=True, before=lambda: _age(chance, place.work / output)),
    ]
    return Case(
        "full disk", f"{output}, no file beyond {largest} bytes", steps, scan, judge=lambda _: _old_or_new(place, output)
    )


def a_full_disk(chance: random.Random, place: Place) -> Case:
    """A file system that has room for nothing more, or for next to nothing, under the results or under the cache."""
    if os.getuid() != 0 or sys.platform != "linux":
        # Only who may do anything may mount one.
        return a_quota(chance, place)
    scan = write_scan(chance, place)
    output, free_pages, of_cache = chance.choice(OUTPUTS), chance.choice((0, 0, 1, 2)), chance.random() < 0.3
    disk = place.cache if of_cache else place.work / "disk"
    path = place.work / output if of_cache else disk / output
    sound = place.segment("scan.nrrd", output=f"sound_{output}", environment={"VITTF_CACHE": str(place.other_cache)})
    further = [] if of_cache else chance.choice(([], ["--similarity-dir", "disk/maps"], ["--report", "disk/r.json"]))
    limited = place.segment("scan.nrrd", *further, output=os.path.relpath(path, place.work))

    def fill() -> None:
        disk.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={(free_pages + 2) * PAGE_BYTES}", "tmpfs", disk], check=True)
        _age(chance, path)
        (disk / "other").write_bytes(b"x" * PAGE_BYTES * (1 if path.exists() and not of_cache else 2))

    def tidy_up() -> None:
        if disk.is_mount():
            subprocess.run(["umount", "--lazy", disk], check=True)

    steps = [Step((sound,), DONE), Step((limited,), late=True, before=fill)]
    what = f"{output}, {free_pages} pages free {'for the cache' if of_cache else ''}"
    return Case(
        "full disk", what, steps, scan, judge=lambda _: _old_or_new(place,
        str(path.relative_to(place.work))) if not of_cache else (),
        tidy_up=tidy_up,
    )  # fmt: skip


def _age(chance: random.Random, path: Path) -> None:
    if chance.random() < 0.6:
        path.write_text("an older result")


def _old_or_new(place: Place, output: str) -> list[str]:
    """The output is as it was, or exactly what it is with room enough."""
    path, sound = place.work / output, place.work / f"sound_{Path(output).name}"
    if not path.exists() or path.read_bytes() in (b"an older result", sound.read_bytes()):
        return []
    return [f"{output} has {path.stat().st_size} bytes, expected the older result or the {sound.stat().st_size} of a whole one"]


def a_folder_without_rights(chance: random.Random, place: Place) -> Case:
    """Results or cache belong where this user may not write."""
    scan = write_scan(chance, place)
    closed = place.work / "closed"
    closed.mkdir()
    what = chance.choice(("output", "old output", "report", "maps", "cache", "cache in it", "cache without entry", "home"))
    output = "out.nrrd"
    further: list[str] = []
    if what in ("output", "old output"):
        output = "closed/out.nrrd"
        if what == "old output":
            (closed / "out.nrrd").write_text("an older result")
    elif what == "report":
        further = ["--report", "closed/r.json"]
    elif what == "maps":
        further = ["--similarity-dir", chance.choice(("closed", "closed/maps"))]
    environment = {}
    if what.startswith("cache"):
        environment["VITTF_CACHE"] = str(closed / "cache")
        if what == "cache in it":
            (closed / "cache" / "features").mkdir(parents=True)
            (closed / "cache" / "features").chmod(0o555)
    codes = REFUSED if what in ("output", "old output", "report", "maps") else DONE
    if what == "cache without entry":
        codes = DONE | REFUSED  # Whoever names such a folder has made a mistake.
    closed.chmod(0 if what == "cache without entry" else 0o555)
    if what == "home":
        environment |= {"HOME": str(closed), "VITTF_CACHE": ""}
    call = place.segment("scan.nrrd", *further, output=output, without_rights=True, environment=environment)
    return Case("no rights", what, [Step((call,), codes)], scan)


def a_console(chance: random.Random, place: Place) -> Case:
    """Nobody reads what is printed, there is no room for it, or it cannot be said in the console's letters."""
    scan = write_scan(chance, place)
    place.write_clicks(scan, classes=[{"name": chance.choice(("Glühwein", "肝臓", "plain")), "positive": [scan.inside[0]]}])
    call = place.segment(
        chance.choice(("scan.nrrd", "scan.nrrd", "fehlt-ü患.nrrd")), output=chance.choice(("out.nii", "ü患.nii"))
    )
    if chance.random() < 0.25:
        call = place.call(*chance.choice((["weights", "list"], ["cache", "info"], ["cache", "clear"], ["--help"])))
    what = chance.choice(("closed", "full", "ascii", "cp437", "cp1252", "folder is gone"))
    if what == "folder is gone":
        gone = place.work.parent / "gone"
        gone.mkdir()
        absolute = [str(place.work / part) if (place.work / part).exists() else part for part in call.arguments]
        chosen = tuple(chance.choice((absolute, list(call.arguments))))
        call = replace(call, arguments=chosen, folder=str(gone), folder_is_gone=True)
        return Case("console", what, [Step((call,))], judge=lambda _: [] if not gone.exists() else ["the folder is back"])
    fault = {"console": what} if what in ("closed", "full") else {"encoding": what}
    return Case("console", what, [Step((replace(call, **fault),), late=True)], scan)  # type: ignore[arg-type]


def a_signal(chance: random.Random, place: Place) -> Case:
    """The run is interrupted, asked to end, or killed, at any moment; the next one is none the worse for it."""
    scan = write_scan(chance, place)
    output = chance.choice(OUTPUTS)
    name = chance.choice(("SIGKILL", "SIGINT", "SIGTERM"))
    when = chance.choice(("", "", "", ".writing-*", "../cache/features/.writing-*", output, "../cache/features/*.npz"))
    after = round(chance.uniform(0.0, 0.15), 4)
    further = chance.choice(([], ["--similarity-dir", "maps"], ["--report", "r.json"]))
    grid = chance.choice(("5", "12", "20"))
    call = place.segment("scan.nrrd", *further, "--grid", grid, output=output)
    stopped = replace(call, signal_name=name, signal_after_s=after, signal_when=when)
    steps = [Step((stopped,), before=lambda: _age(chance, place.work / output)), Step((call,), DONE)]
    return Case("signal", f"{name} {f'when {when} is there' if when else f'after {after} s'}", steps, scan)


def several_runs(chance: random.Random, place: Place) -> Case:
    """Two or three runs at once on one cache, one of which may clear it; or on one output."""
    scan = write_scan(chance, place)
    what = chance.choice(("alike", "alike", "one output", "clear", "features", "other grids"))
    calls = [place.segment("scan.nrrd", output=f"out{n}.nii.gz") for n in range(chance.choice((2, 3)))]
    if what == "one output":
        calls = [place.segment("scan.nrrd", output="out.nrrd")] * 2
    elif what == "clear":
        calls += [place.call("cache", "clear"), place.call("cache", "info")]
    elif what == "features":
        calls += [place.call("features", "scan.nrrd", "--grid", "5")]
    elif what == "other grids":
        calls = [place.segment("scan.nrrd", "--grid", str(4 + n), output=f"out{n}.nii.gz") for n in range(3)]
    repeated = [Step((place.segment("scan.nrrd", output="again.nii.gz"),), DONE)] if what != "other grids" else []
    return Case("several runs", what, [Step(tuple(calls), DONE), *repeated], scan, alike=what != "other grids")


def the_same_again(chance: random.Random, place: Place) -> Case:
    """The same volume and points give the same labels: computed anew, from the cache, in another format."""
    scan = write_scan(chance, place)
    further = chance.choice(([], ["--refine", "guided"], ["--preset", "fine"], ["--preset", "paper", "--model", "tiny"]))
    grid = ["--grid", chance.choice(("5", "8", "11"))]
    caches = [str(place.cache), str(place.cache), str(place.other_cache)]
    steps = [
        Step((place.segment("scan.nrrd", *further, *grid, output=f"out{n}{end}", environment={"VITTF_CACHE": cache}),), DONE)
        for n, (cache, end) in enumerate(zip(caches, (".nii.gz", ".nrrd", ".mha"), strict=True))
    ]
    what = " ".join([*further, *grid])
    return Case("the same again", what, steps, scan, alike=True, judge=lambda _: _others_may_read(place.cache))


def _others_may_read(cache: Path) -> Iterator[str]:
    for path in cache.rglob("*"):
        if rights := stat.S_IMODE(path.stat().st_mode) & 0o077:
            yield f"others have rights {rights:o} on {path.name} in the cache"
