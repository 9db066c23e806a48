"""Set up and run everything, on a machine that has Python and pip.

    python dev.py demo     segment a chest CT from a few points and draw the result, in demo_output/
    python dev.py app      the tool in a browser, on a sample CT; or on a volume of yours: `app VOLUME`, and further arguments
    python dev.py test     run the tests; `--quick` leaves out the slow ones; further arguments go to pytest
    python dev.py lint     check style and types
    python dev.py attack   run `vittf` on odd, damaged and hostile input: `attack --cases 5000 --seed 1`
    python dev.py bench    run a benchmark: `bench solver`, say; further arguments go to it
    python dev.py screenshots    draw the pictures of the README; arguments go to it, `--help` names them
    python dev.py gallery  draw the README's gallery, of scans that `--volumes` names the folder of
    python dev.py rooms    print the drawing of the rooms of the Logic for docs/ARCHITECTURE.md
    python dev.py lock     write locked-requirements.txt anew, after a change of constraints.txt or pyproject.toml

Each command but `lock` makes the virtual environment `.venv` and installs what it needs, at the versions of constraints.txt;
on Linux with Python 3.11, as in continuous integration, only files whose hashes locked-requirements.txt names, if pip is told
where PyTorch's build for processors is (PIP_FIND_LINKS).
Only the standard library is used here, since nothing else is there yet.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
PYTHON = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
OLDEST_PYTHON = (3, 10)
CONSTRAINTS, LOCK = "constraints.txt", "locked-requirements.txt"
LOCKED_FOR = ("linux", "x86_64", (3, 11))
CPU_BUILDS = "https://download.pytorch.org/whl/cpu/torch/"
"""PyTorch's builds for processors alone, a fraction of the size of those that the package index has for Linux; pip finds them
where the variable PIP_FIND_LINKS names this address, or a folder with the file."""
SYSTEMS = {"linux", "win32", "darwin"}
"""On which Slicer runs, as Python calls them."""
SHIPPED = [f"ViTTransferFunction/{name}" for name in ("ViTTransferFunction.py", "CommandLine", "Logic", "WebApp", "Widget")]
"""What users run."""
IN_TWO_PROCESSES = ("-n", "2", "--dist", "loadfile")
"""What all tests are run with. Two: each takes some GB, and has threads of its own for what is computed. File by file: tests of
one share what is dear to make, a browser or a server say."""


def main() -> int:
    """Parse the command line, set up, run, and return the command's exit code."""
    if sys.version_info < OLDEST_PYTHON:
        print(
            f"Python {OLDEST_PYTHON[0]}.{OLDEST_PYTHON[1]} or newer is needed; this is {sys.version.split()[0]}.",
            file=sys.stderr,
        )
        return 2
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = (demo, app, test, lint, attack, bench, screenshots, gallery, rooms, lock)
    commands = {command.__name__: command for command in every}
    parser.add_argument("command", choices=list(commands))
    # Of what follows the command, `--help` too is the command's.
    name, rest = parser.parse_args(sys.argv[1:2]).command, sys.argv[2:]
    if rest and commands[name] in (demo, rooms, lock):
        parser.error(f"{name} takes no arguments")
    return commands[name](rest)


def demo(arguments: list[str]) -> int:
    """Run the demo."""
    set_up("demo")
    return run("-m", "ViTTransferFunction.CommandLine.demo", *arguments)


def app(arguments: list[str]) -> int:
    """Run the app in a browser."""
    set_up("app", "demo")
    return run("-m", "ViTTransferFunction.CommandLine.app_demo", *arguments)


def test(arguments: list[str]) -> int:
    """Run the tests; without further arguments, in two processes."""
    set_up("test")
    further = [argument for argument in arguments if argument != "--quick"]
    quick = ["-m", "not slow"] if "--quick" in arguments else []
    return run("-m", "pytest", *quick, *(further or IN_TWO_PROCESSES))


def lint(arguments: list[str]) -> int:
    """Run every check, also after one failed, so that one run shows all that is to be corrected."""
    set_up("lint")
    # On each system, modules lack something else. Each has a cache of its own, which would be made anew otherwise.
    others = [("--platform", system, "--cache-dir", f".mypy_cache/{system}", *SHIPPED) for system in SYSTEMS - {sys.platform}]
    types = [run("-m", "mypy", *options) for options in (arguments, *others)]
    return max(run("-m", "ruff", "check"), run("-m", "ruff", "format", "--check"), *types)


def attack(arguments: list[str]) -> int:
    """Run generated attacks on the command line, the compute process and the session."""
    set_up("test")
    return run("-m", "ViTTransferFunction.Testing.attack.run", *arguments)


def bench(arguments: list[str]) -> int:
    """Run one benchmark of the folder Benchmarks."""
    names = sorted(path.parent.name for path in (ROOT / "Benchmarks").glob("*/run.py"))
    if not arguments or arguments[0] not in names:
        print(f"Which benchmark? One of: {', '.join(names)}", file=sys.stderr)
        return 2
    set_up("bench")
    return run("-m", f"Benchmarks.{arguments[0]}.run", *arguments[1:])


def screenshots(arguments: list[str]) -> int:
    """Draw the pictures of the README."""
    set_up("test")
    return run("-m", "ViTTransferFunction.Testing.support.readme_pictures.run", *arguments)


def gallery(arguments: list[str]) -> int:
    """Draw the gallery of the README."""
    set_up("test")
    return run("-m", "ViTTransferFunction.Testing.support.readme_pictures.gallery", *arguments)


def rooms(arguments: list[str]) -> int:
    """Print the drawing of the rooms."""
    set_up("test")
    return run("-m", "ViTTransferFunction.Testing.support.rooms", *arguments)


def set_up(*extras: str) -> None:
    """Create the environment and install the project with `extras`, unless that was done for the same requirements."""
    stamp = ENVIRONMENT / f"installed-{'-'.join(extras) or 'base'}"
    wanted = requirements_digest()
    if PYTHON.exists() and stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return
    if not PYTHON.exists():
        print(f"Creating {ENVIRONMENT}", flush=True)
        venv.create(ENVIRONMENT, with_pip=True)
    print("Installing the requirements (PyTorch and VTK: a few minutes on the first run)", flush=True)
    if locked_for_this_computer() and cpu_build_is_offered():
        install("--require-hashes", "--no-deps", "--requirement", LOCK)
        install("--no-deps", "--no-build-isolation", "--editable", ".")
    else:
        target = f".[{','.join(extras)}]" if extras else "."
        install("--constraint", CONSTRAINTS, "--editable", target)
    stamp.write_text(wanted, encoding="utf-8")


def locked_for_this_computer() -> bool:
    """Whether the lock is for this computer's kind."""
    return (sys.platform, platform.machine(), sys.version_info[:2]) == LOCKED_FOR


def cpu_build_is_offered() -> bool:
    """Whether pip finds the build of PyTorch that the lock names, which the package index does not have."""
    (torch,) = (
        line.split()[0] for line in (ROOT / LOCK).read_text(encoding="utf-8").splitlines() if line.startswith("torch==")
    )
    command: list[str | Path] = [PYTHON, "-m", "pip", "install", "--dry-run", "--no-deps", torch]
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode == 0


def install(*arguments: str) -> None:
    """Let pip install into the environment; ends the program if it cannot."""
    # Somebody who watches sees pip's progress; a log does without.
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    command: list[str | Path] = [PYTHON, "-m", "pip", "install", "--disable-pip-version-check", *quiet, *arguments]
    installed = subprocess.run(command, cwd=ROOT, check=False)
    if installed.returncode:
        sys.exit(f"pip could not install the requirements (exit code {installed.returncode}); its message stands above.")


def lock(arguments: list[str]) -> int:
    """Write the lock: the version of everything that the tests and checks need, and the hash of its file."""
    if not locked_for_this_computer():
        print("The lock is of Linux on x86-64 with Python 3.11, and can only be made there.", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        # A pip of today learns what a package needs without fetching it.
        venv.create(folder, with_pip=True)
        python = Path(folder) / "bin" / "python"
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--upgrade", "pip"], check=True)
        files = resolved(python, "--constraint", CONSTRAINTS, "setuptools>=77", ".[test,lint]")
    if not any(requirement.endswith("+cpu") for requirement in files):
        print(f"PyTorch's build for processors was not found; set PIP_FIND_LINKS={CPU_BUILDS}", file=sys.stderr)
        return 2
    lines = [f"{requirement} \\\n    --hash=sha256:{sha256}" for requirement, sha256 in sorted(files.items())]
    (ROOT / LOCK).write_text("\n".join(["# Made by `python dev.py lock`.", *lines]) + "\n", encoding="utf-8")
    return 0


def resolved(python: Path, *arguments: str) -> dict[str, str]:
    """What pip would install, as `name==version`, and the hexadecimal SHA-256 of each file; the project itself left out."""
    options = ["--dry-run", "--ignore-installed", "--quiet", "--report", "-"]
    command: list[str | Path] = [python, "-m", "pip", "install", *options, *arguments]
    report = json.loads(subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout)
    files = [(entry["metadata"], entry["download_info"].get("archive_info")) for entry in report["install"]]
    return {f"{about['name'].lower()}=={about['version']}": file["hashes"]["sha256"] for about, file in files if file}


def requirements_digest() -> str:
    """Changes whenever what is to be installed changes."""
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in ("pyproject.toml", CONSTRAINTS, LOCK))).hexdigest()


def run(*arguments: str) -> int:
    """Run Python of the environment in the project's folder; returns its exit code."""
    # Where another program uses a core, OpenMP's default of spinning while it waits makes PyTorch many times slower.
    # NumPy's own threads spin as well; all large products are PyTorch's.
    environment = {"OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1", **os.environ}
    return subprocess.run([PYTHON, *arguments], cwd=ROOT, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
