"""A scene that was made with one model, where another one would be taken."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest
from ViTTransferFunction.Logic.scene.interface.choices import choices, make_possible
from ViTTransferFunction.Logic.scene.interface.parameters import SceneParameters
from ViTTransferFunction.Logic.scene.interface.problems import Problems
from ViTTransferFunction.Logic.scene.session import SceneSession
from ViTTransferFunction.Logic.scene.volumes.former_model import FormerModel
from ViTTransferFunction.Logic.session.settings import SessionSettings
from ViTTransferFunction.Testing.support.scenes import add_parameter_node, annotate, open_spheres
from ViTTransferFunction.Testing.support.spheres import Spheres, centre_ras

MODEL, OTHER = "dinov2_vits14", "dinov2_vits14_focus"
RED = (1.0, 0.0, 0.0)
Reopen = Callable[..., SceneSession]


@pytest.fixture
def reopen(slicer_app: Any, spheres: Spheres, monkeypatch: pytest.MonkeyPatch) -> Reopen:
    """Opens the scene with the three spheres again, as if it had been made otherwise; features of `MODEL` are in the cache."""
    monkeypatch.delenv("VITTF_WEIGHTS", raising=False)

    def reopened(with_structures: bool = True, **parameters: str) -> SceneSession:
        session = open_spheres(slicer_app, spheres)
        if with_structures:
            annotate(session, spheres)
        session.close()
        for name, value in parameters.items():
            session.parameters.set(name, value)
        again = SceneSession(slicer_app.scene, slicer_app.app_logic, session.parameters.node)
        again.wait()
        return again

    return reopened


@pytest.mark.slow
def test_a_scene_remembers_which_model_its_features_were_of_and_goes_on_with_it_in_silence(reopen: Reopen) -> None:
    session = reopen()
    assert session.parameters.get("usedModel") == MODEL
    assert session.take_error() is None


@pytest.mark.slow
def test_where_the_weights_of_a_scenes_model_are_missing_the_user_is_told_what_to_do(reopen: Reopen) -> None:
    session = reopen(usedModel=OTHER)
    assert session.phase == "ready"
    told = session.take_error()
    assert told is not None
    assert f"made with the model {OTHER}" in told
    assert f"go on with {MODEL}" in told
    assert session.take_error() is None


@pytest.mark.slow
def test_who_has_no_structures_is_told_nothing(reopen: Reopen) -> None:
    assert reopen(with_structures=False, usedModel=OTHER).take_error() is None


@pytest.mark.slow
def test_who_chooses_a_model_is_told_nothing(reopen: Reopen) -> None:
    assert reopen(usedModel=OTHER, model=MODEL).take_error() is None


@pytest.mark.slow
def test_structures_that_are_restored_go_on_with_their_model_and_leave_features_of_it_as_they_are(
    reopen: Reopen, spheres: Spheres
) -> None:
    session = reopen(with_structures=False)
    session.file_classes.restore([AnnotatedClass(ClassRequest("1", centre_ras(spheres, 1)), RED)], MODEL, ())
    assert session.phase == "ready"
    session.wait()
    assert session.take_error() is None
    session.file_classes.restore([AnnotatedClass(ClassRequest("2", centre_ras(spheres, 2)), RED)], OTHER, ())
    session.wait()
    told = session.take_error()
    assert told is not None
    assert f"made with the model {OTHER}" in told


@pytest.fixture
def extracting() -> Any:
    """The proxy while features of `MODEL` are extracted."""
    return SimpleNamespace(estimate=SimpleNamespace(model=MODEL), phase="extracting")


def test_features_are_got_with_another_model_only_where_restored_structures_are_known_to_be_of_one(
    slicer_app: Any, extracting: Any
) -> None:
    former = FormerModel(SceneParameters(add_parameter_node(slicer_app.scene)), extracting, Problems())
    for of_these, model in ((MODEL, None), (OTHER, OTHER), ("", OTHER)):
        former.remember(of_these)
        assert former.applied_to(SessionSettings()).former_model == model


def test_the_user_is_told_of_another_model_until_it_is_the_former_one_and_the_scene_notes_which_had_features(
    slicer_app: Any, extracting: Any
) -> None:
    parameters, problems = SceneParameters(add_parameter_node(slicer_app.scene)), Problems()
    former = FormerModel(parameters, extracting, problems)
    former.remember(OTHER)
    told = []
    # At first, it is not known yet which one it will be.
    for model, phase in (("", "opening"), (MODEL, "extracting"), (MODEL, "ready"), (OTHER, "ready")):
        extracting.estimate, extracting.phase = SimpleNamespace(model=model) if model else None, phase
        former.look(has_structures=True)
        told.append((len(problems.standing), parameters.get("usedModel")))
    assert told == [(0, ""), (1, ""), (1, MODEL), (0, OTHER)]


def test_a_model_that_is_not_offered_here_is_told_of_once_by_whoever_can_say_what_to_do(
    slicer_app: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("VITTF_WEIGHTS", raising=False)
    parameters = SceneParameters(add_parameter_node(slicer_app.scene))
    for used, count in ((OTHER, 0), ("", 1)):
        parameters.set("model", OTHER)
        parameters.set("usedModel", used)
        assert len(make_possible(parameters, choices())) == count
        assert parameters.get("model") == ""


def test_weights_of_another_computer_are_forgotten_and_the_user_is_told(slicer_app: Any, tmp_path: Path) -> None:
    parameters = SceneParameters(add_parameter_node(slicer_app.scene))
    # In quotes, as Windows' Copy as path has it.
    for named in (str(tmp_path), f'"{tmp_path}"'):
        parameters.set("weightsPath", named)
        assert make_possible(parameters, choices()) == []
        assert parameters.get("weightsPath") == named
    # The last cannot even be looked up, as one in a folder of somebody else's.
    for gone in ("gone.pt", "x" * 300):
        parameters.set("weightsPath", str(tmp_path / gone))
        (told,) = make_possible(parameters, choices())
        assert "are not on this computer" in told
        assert parameters.get("weightsPath") == ""
