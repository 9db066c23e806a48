"""The views as far as the panel sees them: widgets in windows, slice nodes, and interactors whose events tests send."""

from __future__ import annotations

import time
from typing import Any

import slicer
import vtk
from PySide6.QtCore import Property, QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QDockWidget, QMainWindow, QVBoxLayout, QWidget
from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

SIZE_PIXELS = 200
FIELD_OF_VIEW_MM = 200.0
FRAME_S = 1.0 / 60.0


class DrawnView(QWidget):
    """A view, and when it is drawn: a sixtieth of a second after its first change, or with the next change once that is past.

    Args:
        drawn: gets the view each time that it is drawn.

    Attributes:
        pauses: how often it was paused and not resumed.
    """

    def __init__(self, drawn: list[DrawnView]) -> None:
        super().__init__()
        self.pauses = 0
        self._drawn = drawn
        self._changed_s: float | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(int(1000.0 * FRAME_S))
        self._timer.timeout.connect(self._draw_unless_paused)

    def scheduleRender(self) -> None:  # noqa: N802
        """It has changed."""
        if self._changed_s is None:
            self._changed_s = time.monotonic()
            self._timer.start()
        elif time.monotonic() - self._changed_s > FRAME_S:
            self._draw_unless_paused()

    def forceRender(self) -> None:  # noqa: N802
        """Draw it, also where it is paused."""
        self._timer.stop()
        self._changed_s = None
        self._drawn.append(self)

    def pauseRender(self) -> None:  # noqa: N802
        """Draw it no more by itself, until it was resumed as often as it was paused."""
        self.pauses += 1

    def resumeRender(self) -> None:  # noqa: N802
        """See `pauseRender`. What should have been drawn in this moment is drawn with the next change only, as in Slicer."""
        assert self.pauses > 0, "Cannot resume rendering, pause render count is already 0!"
        self.pauses -= 1
        if not self.pauses and self._changed_s is not None:
            self.scheduleRender()

    def _draw_unless_paused(self) -> None:
        self._timer.stop()
        if not self.pauses:
            self.forceRender()


class LayoutManager(QObject):
    """Three slice views, those that are added, and a 3D view.

    Args:
        scene: gets their slice nodes.

    Attributes:
        drawn: the views, each as often as it was drawn, in order.
    """

    layoutChanged = Signal(int)  # noqa: N815

    def __init__(self, scene: Any) -> None:
        super().__init__()
        self._scene = scene
        self.drawn: list[DrawnView] = []
        orientations = {"Red": "Axial", "Green": "Coronal", "Yellow": "Sagittal"}
        self._widgets = {name: SliceWidget(scene, self.drawn, name, orientation) for name, orientation in orientations.items()}
        self._three_d = ThreeDWidget(self.drawn)

    def setRenderPaused(self, pause: bool) -> None:  # noqa: N802
        """Pause all views, or resume them."""
        for view in (*self._widgets.values(), self._three_d):
            (view.pauseRender if pause else view.resumeRender)()

    def setViewport(self, window: QMainWindow) -> None:  # noqa: N802
        """Put the views into the main window, where tests do not look at them."""
        for widget in self._widgets.values():
            widget.setParent(window)
            widget.hide()
        self._three_d.setParent(window)

    def close(self) -> None:
        """Let go of what views are drawn with: PySide keeps the widgets of a window that is no more."""
        interactors = [self._three_d.interactor(), *(widget.interactor() for widget in self._widgets.values())]
        for interactor in interactors:
            interactor.SetRenderWindow(None)

    def add_detached_view(self, name: str, main_window: QMainWindow) -> QWidget:
        """Change to a layout with another view, in a window of its own as on a second monitor; returns that window."""
        window = QWidget(main_window, Qt.WindowType.Window)
        QVBoxLayout(window).addWidget(self._add(name))
        window.show()
        self.layoutChanged.emit(0)
        return window

    def add_floating_view(self, name: str, main_window: QMainWindow) -> QDockWidget:
        """Change to a layout with another view, in a dock of the main window that floats; returns that dock."""
        dock = QDockWidget(main_window)
        dock.setWidget(self._add(name))
        main_window.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, dock)
        dock.setFloating(True)
        dock.show()
        self.layoutChanged.emit(0)
        return dock

    def remove_view(self, name: str) -> None:
        """Remove a view's node, and with it the view; then change to a layout without it."""
        widget = self._widgets.pop(name)
        self._scene.RemoveNode(widget.mrmlSliceNode())
        widget.deleteLater()
        self.layoutChanged.emit(0)

    def _add(self, name: str) -> SliceWidget:
        self._widgets[name] = SliceWidget(self._scene, self.drawn, name, "Axial")
        return self._widgets[name]

    def sliceViewNames(self) -> tuple[str, ...]:  # noqa: N802
        """Names of the slice views, shown or not."""
        return tuple(self._widgets)

    def sliceWidget(self, name: str) -> SliceWidget | None:  # noqa: N802
        """A slice view by its name; None where there is none of that name."""
        return self._widgets.get(name)

    threeDViewCount = Property(int, lambda self: 1)  # noqa: N815

    def threeDWidget(self, index: int) -> ThreeDWidget | None:  # noqa: N802
        """A 3D view; None where there are fewer."""
        return self._three_d if index == 0 else None

    def viewWidgets(self) -> tuple[QWidget, ...]:  # noqa: N802
        """All views, shown or not."""
        return tuple(self._widgets.values())


class ThreeDWidget(DrawnView):
    """A 3D view, and the view in it."""

    def __init__(self, drawn: list[DrawnView]) -> None:
        super().__init__(drawn)
        self._window = vtk.vtkRenderWindow()
        self._window.SetOffScreenRendering(True)
        self._window.SetSize(SIZE_PIXELS, SIZE_PIXELS)
        self._window.AddRenderer(vtk.vtkRenderer())
        self._interactor = vtkGenericRenderWindowInteractor()
        self._interactor.SetRenderWindow(self._window)
        self._interactor.SetInteractorStyle(vtk.vtkInteractorStyleUser())
        self.managers: dict[str, Any] = {}

    def threeDView(self) -> ThreeDWidget:  # noqa: N802
        """The view."""
        return self

    def interactor(self) -> Any:
        """Sends what the mouse does."""
        return self._interactor

    def renderWindow(self) -> Any:  # noqa: N802
        """What it is drawn in."""
        return self._window

    def displayableManagerByClassName(self, name: str) -> Any:  # noqa: N802
        """What shows nodes of a kind in the view: nothing, except in tests that set `managers`."""
        return self.managers.get(name)


class SliceWidget(DrawnView):
    """A slice view, and the view in it."""

    def __init__(self, scene: Any, drawn: list[DrawnView], name: str, orientation: str) -> None:
        super().__init__(drawn)
        node = slicer.vtkMRMLSliceNode()
        node.SetLayoutName(name)
        node.SetSingletonTag(name)
        node.SetName(name)
        self._node = scene.AddNode(node)
        self._node.SetDefaultOrientation(orientation)
        self._node.SetDimensions(SIZE_PIXELS, SIZE_PIXELS, 1)
        self._node.SetFieldOfView(FIELD_OF_VIEW_MM, FIELD_OF_VIEW_MM, 1.0)
        self._interactor = vtkGenericRenderWindowInteractor()
        # Never drawn, but tools put their actors into it.
        window = vtk.vtkRenderWindow()
        window.SetOffScreenRendering(True)
        window.SetSize(SIZE_PIXELS, SIZE_PIXELS)
        window.AddRenderer(vtk.vtkRenderer())
        self._interactor.SetRenderWindow(window)
        self._interactor.SetInteractorStyle(vtk.vtkInteractorStyleUser())

    def mrmlSliceNode(self) -> Any:  # noqa: N802
        """Where the view lies in the patient."""
        return self._node

    def sliceView(self) -> SliceWidget:  # noqa: N802
        """The view."""
        return self

    def interactor(self) -> Any:
        """Sends what the mouse does."""
        return self._interactor

    def renderWindow(self) -> Any:  # noqa: N802
        """What it is drawn in."""
        return self._interactor.GetRenderWindow()
