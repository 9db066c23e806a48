"""Slicer's three slice views and 3D view, drawn here and shown in the browser, which sends back what the mouse does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trame.widgets import html
from trame_slicer.app.logic import connect_slice_view_slider_to_state
from trame_slicer.core import SlicerApp
from trame_slicer.views import CursorId, SliceView, ThreeDView, ViewLayoutDefinition
from trame_slicer.views.threed_view import ViewDirection
from vtkmodules.vtkCommonCore import vtkCommand

from ..Logic.core.volumes.patient_sides import sides
from ..Logic.scene.mrml.transforms import numpy_matrix
from ..Logic.scene.tools.slice_tools import SliceTools
from ..Logic.scene.views.view_sight import look_at
from .data_probe import DataProbe
from .rendering_pace import PICTURES_PER_S, PICTURES_PER_S_ELSEWHERE, PatientSliceViewFactory, PatientThreeDViewFactory
from .scale_bar import scale_bar
from .view_steps import take_steps

VIEWS = {"Red": "Axial", "ThreeD": "3D", "Green": "Coronal", "Yellow": "Sagittal"}
"""What users call the views, by their names, in the order of the page: row by row."""
BACKGROUND_3D = "#0b0d0f"


class SlicerViews:
    """The four views.

    Args:
        server: trame's; its page shows the views by `ServerTemplate`s of their names.
        app: Slicer's scene and logics.
        awaits_answer: whether the answer to a click is under way, which comes before the slice views that were not clicked in.
        is_busy: whether anything is, which comes before the 3D view.
    """

    def __init__(self, server: Any, app: SlicerApp, awaits_answer: Callable[[], bool], is_busy: Callable[[], bool]) -> None:
        self._app = app
        self._server = server
        self._volume: Any = None
        self._probes: list[DataProbe] = []
        fps = {"target_fps": PICTURES_PER_S, "blur_fps": PICTURES_PER_S_ELSEWHERE}
        slice_factory = PatientSliceViewFactory(server, awaits_answer, populate_view_ui_f=self._add_slice_controls, **fps)
        app.view_manager.register_factory(slice_factory)
        self._factory_3d = PatientThreeDViewFactory(server, is_busy, populate_view_ui_f=self._add_3d_controls, **fps)
        app.view_manager.register_factory(self._factory_3d)
        slices = (ViewLayoutDefinition.axial_view(), ViewLayoutDefinition.coronal_view(), ViewLayoutDefinition.sagittal_view())
        self.slices: tuple[SliceView, ...] = tuple(app.view_manager.create_view(definition) for definition in slices)
        for view in self.slices:
            view.get_view_node().SetLayoutLabel(view.name[0])  # Slicer takes the letters of its views from a scene.
        definition_3d = ViewLayoutDefinition.threed_view(background_color=BACKGROUND_3D)
        self.view_3d: ThreeDView = app.view_manager.create_view(definition_3d)
        app.view_manager.set_current_view_ids(list(VIEWS))
        server.trigger("use_view")(self.use)

    def show(self, volume: Any) -> None:
        """Show a volume in the slice views, all of it, at its middle, and have the 3D view look at it; None: nothing."""
        self._volume = volume
        self._app.display_manager.show_volume_in_slice_background(volume)
        self._app.display_manager.show_volume_in_slice_foreground(None)
        for view in self.slices:
            view.reset_view()
        for probe in self._probes:
            probe.tell_anew()
        self._fit_3d()
        # Whatever is under way: the structures of another patient go at once.
        for strategy in self._factory_3d.strategies:
            strategy.draw()

    def settle(self) -> None:
        """What the session shows has changed: the 3D view follows when it has time."""
        for strategy in self._factory_3d.strategies:
            strategy.settle()

    def leave(self) -> None:
        """Have nothing follow the mouse in any view: no next point, and no brush's circle."""
        for view in (*self.slices, self.view_3d):
            view.interactor().InvokeEvent(vtkCommand.LeaveEvent)
        self.settle()

    def use(self, view_id: str, steps: Sequence[Sequence[Any]]) -> None:
        """Do to a view what mouse and fingers did, as `take_steps` takes it."""
        view = next(view for view in (*self.slices, self.view_3d) if view.name == view_id)
        take_steps(view, steps)
        self._server.state[f"{view_id}_active_view_cursor"] = CursorId.from_vtk_cursor_id(
            view.render_window().GetCurrentCursor()
        ).value
        # Other steps in slice views are frequent, or have an answer to wait for.
        if view is self.view_3d or any(what in ("leave", "spread") for what, *_ in steps):
            self.settle()

    def _fit_3d(self) -> None:
        """Look at the volume from the front. The view itself would go by what it shows, which may be nothing yet."""
        bounds = [0.0] * 6
        if self._volume is not None:
            self._volume.GetRASBounds(bounds)
        if bounds[0] < bounds[1]:
            self.view_3d.rotate_to_view_direction(ViewDirection.ANTERIOR)
            look_at(self.view_3d.renderer(), bounds)
        self.view_3d.schedule_render()
        self.settle()

    def _add_slice_controls(self, server: Any, view_id: str, view: SliceView) -> None:
        slider = connect_slice_view_slider_to_state(server, view).name
        html.Div(VIEWS[view_id], classes=f"view-name {view_id}")
        _add_view_buttons(view_id, view.reset_view)
        for side in ("left", "right", "top", "bottom"):
            html.Div(f"{{{{ sides_{view_id}.{side} }}}}", classes=f"side {side}")
        self._keep_sides(view_id, view)
        self._add_scale_bar(view_id, view)
        self._add_probe(view_id, view)
        letter = f"sides_{view_id}[{slider.value} < 0 ? 'negative' : 'positive']"
        # As many digits as tell a slice from the next: of small specimens, several lie within a tenth of a millimetre.
        digits = f"Math.min(Math.max(1, Math.ceil(-Math.log10({slider.step}) - 1e-6)), 6)"
        place = f"{letter} + ' ' + Math.abs({slider.value}).toFixed({digits}) + ' mm'"
        with html.Div(classes="slice-row"):
            html.Input(
                type="range",
                classes="slice",
                raw_attrs=[
                    f'aria-label="{VIEWS[view_id]} slice"',
                    f':aria-valuetext="{place}"',
                    f'data-testid="slice-{view_id}"',
                ],
                min=(slider.min_value,),
                max=(slider.max_value,),
                step=(slider.step,),
                value=(slider.value,),
                input=f"{slider.value} = Number($event.target.value)",
            )
            html.Span(f"{{{{ {place} }}}}", classes="offset")

    def _add_scale_bar(self, view_id: str, view: SliceView) -> None:
        name = f"scale_{view_id}"

        def keep(_view: SliceView) -> None:
            with self._server.state as state:
                state[name] = scale_bar(view.get_view_node().GetFieldOfView()[0])

        view.modified.connect(keep)
        keep(view)
        style = f"{{ width: 100 * {name}.share + '%' }}"
        html.Div(f"{{{{ {name}.text }}}}", classes="scale", raw_attrs=[f':style="{style}"', f'data-testid="scale-{view_id}"'])

    def _add_probe(self, view_id: str, view: SliceView) -> None:
        """Show what is under the mouse, by a state of its own: nothing else of the page follows moves."""
        name = f"probe_{view_id}"

        def show(text: str) -> None:
            with self._server.state as state:
                state[name] = text

        show("")
        html.Div(f"{{{{ {name} }}}}", classes="probe", raw_attrs=[f'data-testid="probe-{view_id}"'])
        self._probes.append(DataProbe(view.interactor(), view.get_view_node(), lambda: self._volume, show))

    def _add_3d_controls(self, server: Any, view_id: str, view: ThreeDView) -> None:
        html.Div(VIEWS[view_id], classes="view-name")
        _add_view_buttons(view_id, self._fit_3d)

    def _keep_sides(self, view_id: str, view: SliceView) -> None:
        """Keep the letters at the view's edges those of the patient's sides that lie there."""

        def keep(_view: SliceView) -> None:
            with self._server.state as state:
                state[f"sides_{view_id}"] = sides(numpy_matrix(view.get_view_node().GetSliceToRAS()))

        view.modified.connect(keep)
        keep(view)


def slice_tools(views: SlicerViews) -> SliceTools:
    """Keeps a tool in each of the slice views until it is stopped."""
    return SliceTools(lambda: [(view.interactor(), view.get_view_node(), view.schedule_render) for view in views.slices])


def _add_view_buttons(view_id: str, fit: Callable[[], None]) -> None:
    with html.Div(classes="view-buttons"):
        toggle = f"enlarged = enlarged === '{view_id}' ? '' : '{view_id}'"
        with html.Button(click=toggle, title="Enlarge, or show all four views"):
            html.Img(src="__vittf/enlarge.svg", alt="Enlarge")
        with html.Button(click=fit, title="Fit to the volume"):
            html.Img(src="__vittf/fit.svg", alt="Fit")
