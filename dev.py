"""Set up and run everything, on a machine that has Python and pip.

    python dev.py demo     segment a chest CT from a few points and draw the result, in demo_output/
    python dev.py test     run the tests; `--quick` leaves out the slow ones; further arguments go to pytest
    python dev.py lint     check style and types
    python dev.py attack   run `vittf` on odd, damaged and hostile input: `attack --cases 5000 --seed 1`
    python dev.py bench    run a benchmark: `bench solver`, say; further arguments go to it
    python dev.py screenshots    draw the pictures of the README; arguments go to it, `--help` names them
    python dev.py rooms    print the drawing of the rooms of the Logic for docs/ARCHITECTURE.md

Each command makes the virtual environment `.venv` and installs what it needs, at the versions of constraints.txt.
Only the standard library is used here, since nothing else is there yet.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
PYTHON = ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
OLDEST_PYTHON = (3, 10)


def main() -> int:
    """Parse the command line, set up, run, and return the command's exit code."""
    if sys.version_info < OLDEST_PYTHON:
        print(
            f"Python {OLDEST_PYTHON[0]}.{OLDEST_PYTHON[1]} or newer is needed; this is {sys.version.split()[0]}.",
            file=sys.stderr,
        )
        return 2
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = (demo, test, lint, attack, bench, screenshots, rooms)
    commands = {command.__name__: command for command in every}
    parser.add_argument("command", choices=list(commands))
    command, rest = parser.parse_known_args()
    return commands[command.command](rest)


def demo(arguments: list[str]) -> int:
    """Run the demo."""
    set_up("demo")
    return run("-m", "ViTTransferFunction.CommandLine.demo", *arguments)


def test(arguments: list[str]) -> int:
    """Run the tests."""
    set_up("test")
    if "--quick" in arguments:
        arguments = ["-m", "not slow", *(argument for argument in arguments if argument != "--quick")]
    return run("-m", "pytest", *arguments)


def lint(arguments: list[str]) -> int:
    """Run every check, also after one failed, so that one run shows all that is to be corrected."""
    set_up("lint")
    codes = [run("-m", "ruff", "check"), run("-m", "ruff", "format", "--check"), run("-m", "mypy", *arguments)]
    return max(codes)


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


def rooms(arguments: list[str]) -> int:
    """Print the drawing of the rooms."""
    set_up("test")
    return run("-m", "ViTTransferFunction.Testing.support.rooms", *arguments)


def set_up(*extras: str) -> None:
    """Create the environment and install the project with `extras`, unless that was done for the same requirements."""
    stamp = ENVIRONMENT / f"installed-{'-'.join(extras) or 'base'}"
    wanted = requirements_digest()
    if PYTHON.exists() and stamp.exists() and stamp.read_text() == wanted:
        return
    if not PYTHON.exists():
        print(f"Creating {ENVIRONMENT}", flush=True)
        venv.create(ENVIRONMENT, with_pip=True)
    target = f".[{','.join(extras)}]" if extras else "."
    print(f"Installing {target} (PyTorch and VTK: a few minutes on the first run)", flush=True)
    # Somebody who watches sees pip's progress; a log does without.
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    options = ["--disable-pip-version-check", *quiet, "--constraint", "constraints.txt", "--editable", target]
    installed = subprocess.run([PYTHON, "-m", "pip", "install", *options], cwd=ROOT, check=False)
    if installed.returncode:
        sys.exit(f"pip could not install the requirements (exit code {installed.returncode}); its message stands above.")
    stamp.write_text(wanted)


def requirements_digest() -> str:
    """Changes whenever what is to be installed changes."""
    return hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in ("pyproject.toml", "constraints.txt"))).hexdigest()


def run(*arguments: str) -> int:
    """Run Python of the environment in the project's folder; returns its exit code."""
    # Where another program uses a core, OpenMP's default of spinning while it waits makes PyTorch many times slower.
    # NumPy's own threads spin as well; all large products are PyTorch's.
    environment = {"OMP_WAIT_POLICY": "passive", "OPENBLAS_NUM_THREADS": "1", **os.environ}
    return subprocess.run([PYTHON, *arguments], cwd=ROOT, env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
