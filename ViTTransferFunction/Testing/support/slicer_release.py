"""Scenes and views that go after a test: they are megabytes each, and hundreds of tests have some."""

from __future__ import annotations

from typing import Any

import vtk


def let_slicer_go(app: Any) -> None:
    """Have a trame_slicer `SlicerApp`, its scene and its views go as soon as nobody else has them.

    They would stay for ever: C++ calls them back, and Python's search for circles of references does not see what C++ holds.
    """
    from slicer import (
        vtkMRMLLayerDMObjectEventObserverScripted,
        vtkMRMLLayerDMPipelineFactory,
        vtkMRMLLayerDMPipelineScriptedCreator,
        vtkMRMLScene,
    )

    callers = vtkMRMLLayerDMObjectEventObserverScripted, vtkMRMLLayerDMPipelineScriptedCreator
    editor = app.segmentation_editor
    vtkMRMLLayerDMPipelineFactory.GetInstance().RemovePipelineCreator(editor._pipeline_creator)
    called = editor, *editor._effects.values(), app.volume_rendering, app.markups_logic, *app.view_manager.get_views()
    for caller in (value for each in called for value in vars(each).values() if isinstance(value, callers)):
        caller.SetPythonCallback(_nothing)
    # Of all events but its end: an observer in C++ that is not told of that turns to the scene when it goes itself.
    events = [value for value in vars(vtkMRMLScene).values() if isinstance(value, vtkMRMLScene.SceneEventType)]
    for event in (vtk.vtkCommand.AnyEvent, vtk.vtkCommand.ModifiedEvent, *events):
        app.scene.RemoveObservers(event)


def _nothing(*args: Any) -> None:
    """What is called from now on."""
