"""`vittf weights list|get|remove`: which model weights are on this computer, fetching them, removing them."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ViTTransferFunction.CommandLine.options import Subparsers
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.weights.models import PRETRAINED_MODELS, PretrainedModel, pretrained_model

if TYPE_CHECKING:
    from ViTTransferFunction.Logic.weights.store import CachedWeights


def add_arguments(subparsers: Subparsers) -> None:
    """Add the command `weights` and its actions to those of `vittf`."""
    parser = subparsers.add_parser(
        "weights",
        help="list, get or remove model weights",
        description="List, get or remove model weights. Other commands get what they need by themselves.",
    )
    parser.set_defaults(run=run)
    actions = parser.add_subparsers(dest="action", required=True, metavar="list|get|remove")
    actions.add_parser(
        "list",
        help="show every model, its terms, and where its weights are",
        description="Show every model, its terms, and where its weights are.",
    )
    get = actions.add_parser(
        "get",
        help="download a model's weights into the cache",
        description="Download a model's weights into the cache, check them by their SHA-256, and print where they are.",
    )
    remove = actions.add_parser(
        "remove",
        help="delete a model's weights from the cache",
        description="Delete a model's weights from the cache. Files of your own stay.",
    )
    get.add_argument("--sha256", metavar="HASH", help="the file that is to be trusted, where its publisher names no hash")
    for action in (get, remove):
        # Not `choices`: the Logic names the known models, with the same words as everywhere else.
        action.add_argument("name", metavar="NAME", help=", ".join(PRETRAINED_MODELS))


def run(args: argparse.Namespace) -> int:
    """Carry out the action. Returns the exit code."""
    if args.action == "list":
        _list()
    elif args.action == "get":
        _get(args.name, args.sha256)
    else:
        _remove(args.name)
    return 0


def _list() -> None:
    from ViTTransferFunction.Logic.weights.sources import WEIGHTS_VARIABLE, files_of_environment
    from ViTTransferFunction.Logic.weights.store import list_weights, weights_folder

    given: dict[str, Path] = {}
    problem = ""
    try:
        given = files_of_environment()
    except InputError as error:
        problem = str(error)
    rows = [("model", "licence", "size", "SHA-256", "where")]
    rows += [_row(entry, given.get(entry.model.name)) for entry in list_weights()]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    print(f"\nThe cache is {weights_folder()}")
    if problem or WEIGHTS_VARIABLE in os.environ:
        print(problem or f"{WEIGHTS_VARIABLE}, which comes first, is {os.environ[WEIGHTS_VARIABLE]}")


def _row(entry: CachedWeights, given: Path | None) -> tuple[str, str, str, str, str]:
    """What is shown of a model: of the file that the environment gives, where there is one, else of that in the cache."""
    model = entry.model
    if given is not None:
        from ViTTransferFunction.Logic.weights.download import sha256_of

        return model.name, model.licence, f"{model.size_mb} MB", sha256_of(given)[:12], f"{given} (VITTF_WEIGHTS)"
    return model.name, model.licence, f"{model.size_mb} MB", (entry.sha256 or "")[:12], _where(entry)


def _where(entry: CachedWeights) -> str:
    if entry.path is None:
        page = entry.model.request_page
        return "not downloaded" if page is None else f"not here; ask for it at {page}"
    return str(entry.path) if entry.intact else f"DAMAGED, remove and get again: {entry.path}"


def _get(name: str, wanted: str | None) -> None:
    from ViTTransferFunction.CommandLine.focus_weights import FOCUS_MODEL, install_focus_weights
    from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
    from ViTTransferFunction.Logic.weights.sources import fetch_weights

    model = pretrained_model(name)
    print(f"{model.name}: {model.licence}; {model.citation}; {model.homepage}")
    with ProgressBar() as progress:
        weights = (
            install_focus_weights(progress)
            if model is FOCUS_MODEL
            else fetch_weights(name, trust=partial(_trusted, wanted), progress=progress)
        )
    print(f"{weights.path} ({weights.origin})\nSHA-256 {weights.sha256}")


def _trusted(wanted: str | None, model: PretrainedModel, sha256: str) -> bool:
    """Whether the user wants this file: the one of the hash that was asked for, or else what the user says now.

    Raises:
        InputError: nobody is there to ask.
    """
    if wanted is not None:
        return wanted.lower() == sha256
    question = f"Nobody publishes a SHA-256 of {model.name}. The file from {model.url} has {sha256}. Use it from now on? [y/N] "
    if sys.stdin is None or not sys.stdin.isatty():
        raise InputError(
            f"Nobody publishes a SHA-256 of {model.name}. The file from {model.url} has {sha256}, and was not kept. If that is "
            f"the one you want, run 'vittf weights get {model.name} --sha256 {sha256}'."
        )
    try:
        return input(question).strip().lower() in ("y", "yes")
    except EOFError:
        return False


def _remove(name: str) -> None:
    from ViTTransferFunction.Logic.weights.store import remove_weights

    for path in remove_weights(name):
        print(f"removed {path}")
