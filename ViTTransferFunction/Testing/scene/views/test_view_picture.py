"""Pictures of a view: of the size that was asked for, from where it is seen, and without a trace in the view."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("vtkmodules.vtkRenderingOpenGL2")
pytest.importorskip("slicer")

import slicer
import vtk

from ViTTransferFunction.Logic.core.volumes.camera import Camera
from ViTTransferFunction.Logic.files.camera_files import read_camera, write_camera
from ViTTransferFunction.Logic.files.film import FilmPlan, film_steps
from ViTTransferFunction.Logic.scene.views.filming import Filming
from ViTTransferFunction.Logic.scene.views.view_picture import camera_of, place, placed_camera, view_picture
from ViTTransferFunction.Testing.files.test_film import frames_of

SIZE = 60, 40
PLACES = {"right": (30.0, 0.0, 0.0), "left": (-30.0, 0.0, 0.0)}
COLORS = {"right": (1.0, 0.0, 0.0), "left": (0.0, 0.0, 1.0)}
FRONT = Camera((0.0, 200.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), SIZE, 30.0)


@pytest.fixture
def window() -> Iterator[Any]:
    """A view from the front of a red ball to the patient's right and a blue one to the left, over grey."""
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    renderer.SetBackground(0.5, 0.5, 0.5)
    for side, place_ras in PLACES.items():
        ball, mapper, actor = vtk.vtkSphereSource(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
        ball.SetRadius(15.0)
        ball.SetCenter(*place_ras)
        mapper.SetInputConnection(ball.GetOutputPort())
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*COLORS[side])
        actor.GetProperty().LightingOff()
        renderer.AddActor(actor)
    place(renderer.GetActiveCamera(), FRONT, np.zeros(3))
    window.Render()
    yield window
    window.Finalize()


def camera(window: Any) -> Any:
    return window.GetRenderers().GetFirstRenderer().GetActiveCamera()


def column_of(picture: np.ndarray, channel: int) -> float:
    """Where along the width a ball is, from 0 to 1."""
    other = 2 - channel
    return float((np.nonzero((picture[..., channel] > 200) & (picture[..., other] < 60))[1].mean() + 0.5) / picture.shape[1])


@pytest.mark.parametrize("size", [SIZE, (180, 120), (90, 120)])
def test_a_picture_has_its_own_size_and_shows_what_the_view_shows(window: Any, size: tuple[int, int]) -> None:
    picture = view_picture(window, size)
    assert picture.shape == (size[1], size[0], 3)
    # Seen from the front, the patient's right is on the left.
    reach = 30.0 / (200.0 * np.tan(np.radians(15.0)) * size[0] / size[1]) / 2.0
    assert column_of(picture, 0) == pytest.approx(0.5 - reach, abs=0.02)
    assert column_of(picture, 2) == pytest.approx(0.5 + reach, abs=0.02)
    # Half of 255, which graphics cards round either way.
    assert set(picture[0, 0].tolist()) <= {127, 128}


@pytest.mark.parametrize("gradient", [False, True])
def test_a_transparent_picture_has_nothing_behind_what_is_shown(window: Any, gradient: bool) -> None:
    window.GetRenderers().GetFirstRenderer().SetGradientBackground(gradient)
    picture = view_picture(window, SIZE, transparent=True)
    assert picture.shape == (40, 60, 4)
    assert picture[0, 0].tolist() == [0, 0, 0, 0]
    shown = picture[picture[..., 3] == 255]
    assert {tuple(color) for color in shown[:, :3].tolist()} == {(255, 0, 0), (0, 0, 255)}


def test_what_is_translucent_has_its_own_colours_in_a_transparent_picture(window: Any) -> None:
    for actor in window.GetRenderers().GetFirstRenderer().GetActors():
        actor.GetProperty().SetOpacity(0.3)
    picture = view_picture(window, SIZE, transparent=True)
    shown = picture[picture[..., 3] > 0].astype(int)
    assert len(shown)
    assert shown[:, 3].max() < 250
    # What was weighed by a small opacity comes back less exactly.
    right_or_left = [abs(shown[:, :3] - 255 * np.array(color)).max(axis=1) for color in COLORS.values()]
    assert np.minimum(*right_or_left).max() <= 4


def test_the_view_is_afterwards_as_it_was(window: Any) -> None:
    # As Slicer's views have it.
    window.GetRenderers().GetFirstRenderer().GradientBackgroundOn()
    window.GetRenderers().GetFirstRenderer().SetBackground2(0.1, 0.2, 0.3)
    before = view_picture(window, SIZE)
    look = camera(window).GetPosition(), camera(window).GetClippingRange(), window.GetSize(), window.GetSwapBuffers()
    view_picture(window, (100, 80), transparent=True, camera=FRONT.turned(70.0))
    assert (camera(window).GetPosition(), camera(window).GetClippingRange()) == look[:2]
    assert (tuple(window.GetSize()), window.GetSwapBuffers()) == look[2:]
    np.testing.assert_array_equal(view_picture(window, SIZE), before)


def test_a_camera_saved_in_one_view_shows_the_same_in_another(window: Any, tmp_path: Path) -> None:
    middle = np.array([10.0, -20.0, 5.0])
    camera(window).Azimuth(25.0)
    shown = view_picture(window, SIZE)
    write_camera(camera_of(window, SIZE, middle), tmp_path / "c.json")
    place(camera(window), FRONT, np.zeros(3))
    assert (view_picture(window, SIZE) != shown).any()
    place(camera(window), read_camera(tmp_path / "c.json"), middle)
    np.testing.assert_array_equal(view_picture(window, SIZE), shown)


def test_a_view_in_parallel_projection_has_a_camera_that_sees_as_much(window: Any) -> None:
    camera(window).ParallelProjectionOn()
    camera(window).SetParallelScale(55.0)
    seen = camera_of(window, SIZE)
    other = placed_camera(seen, np.zeros(3))
    assert other.GetParallelScale() == pytest.approx(55.0)
    assert other.GetDistance() * np.tan(np.radians(other.GetViewAngle() / 2.0)) == pytest.approx(55.0)
    np.testing.assert_allclose(other.GetDirectionOfProjection(), camera(window).GetDirectionOfProjection(), atol=1e-9)


def test_a_film_goes_once_around_the_patient_and_leaves_the_view(window: Any, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    before = view_picture(window, SIZE)
    plan = FilmPlan(tmp_path / "film.gif", frames=4, seconds=1.0)
    filming = Filming(slicer.vtkMRMLScene(), window, SIZE, plan.frames, plan.drawings, lambda frame: film_steps(plan, frame))
    seen = [filming.progress.done]
    while not filming.advance():
        seen.append(filming.progress.done)
    assert (seen[0], seen[-1], filming.progress.total) == (0, plan.drawings, plan.drawings)
    frames, seconds = frames_of(plan.path)
    assert (len(frames), seconds) == (4, 1.0)
    front, _, back, _ = frames
    # From behind, the patient's right is on the right.
    assert column_of(front, 0) < 0.4 < 0.6 < column_of(back, 0)
    np.testing.assert_array_equal(view_picture(window, SIZE), before)


def test_a_film_that_is_cancelled_leaves_nothing(window: Any, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    plan = FilmPlan(tmp_path / "new" / "film.gif", frames=24, seconds=2.0)
    filming = Filming(slicer.vtkMRMLScene(), window, SIZE, plan.frames, plan.drawings, lambda frame: film_steps(plan, frame))
    while filming.progress.done < 3:
        filming.advance()
    filming.cancel()
    assert list(plan.path.parent.iterdir()) == []
