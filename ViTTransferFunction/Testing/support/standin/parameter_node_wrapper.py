"""`slicer.parameterNodeWrapper` for texts, numbers and truth values, and the widgets that the panel binds to them."""

from __future__ import annotations

import typing
from collections.abc import Callable
from typing import Any

import vtk
from PySide6.QtCore import SignalInstance
from PySide6.QtWidgets import QCheckBox, QComboBox, QSpinBox

from ViTTransferFunction.Testing.support.standin.ctk import ctkSliderWidget

PROPERTY = "SlicerParameterName"


class Choice:
    """The values that a parameter may have."""

    def __init__(self, choices: list[Any]) -> None:
        self.choices = choices

    def validate(self, value: Any) -> None:
        """Raise ValueError for any other."""
        if value not in self.choices:
            raise ValueError(f"{value!r} is not one of {self.choices}")


class WithinRange:
    """The smallest and largest number that a parameter may be."""

    def __init__(self, minimum: float, maximum: float) -> None:
        self.minimum, self.maximum = minimum, maximum

    def validate(self, value: float) -> None:
        """Raise ValueError for a number outside."""
        if not self.minimum <= value <= self.maximum:
            raise ValueError(f"{value} is not within [{self.minimum}, {self.maximum}]")


def parameterNodeWrapper(cls: type) -> type:  # noqa: N802
    """Make a class whose annotated attributes are the parameters of the node that it is made with."""
    types = typing.get_type_hints(cls, include_extras=True)
    for name, annotated in types.items():
        kind, limits = _split(annotated)
        setattr(cls, name, property(_reader(name, kind, getattr(cls, name)), _writer(name, limits)))
    cls.__init__ = _initialise  # type: ignore[misc]
    cls.AddObserver = lambda self, *arguments: self.parameterNode.AddObserver(*arguments)  # type: ignore[attr-defined]
    cls.connectGui = lambda self, gui: _connect(self, gui, types)  # type: ignore[attr-defined]
    cls.disconnectGui = _disconnect  # type: ignore[attr-defined]
    return cls


def _split(annotated: Any) -> tuple[type, list[Any]]:
    kind, *limits = typing.get_args(annotated) or (annotated,)
    return kind, limits


def _initialise(self: Any, node: Any) -> None:
    self.parameterNode = node
    self._connections = {}


def _reader(name: str, kind: type, default: Any) -> Callable[[Any], Any]:
    def read(self: Any) -> Any:
        if not self.parameterNode.HasParameter(name):
            self.parameterNode.SetParameter(name, str(default))
        text = self.parameterNode.GetParameter(name)
        return text == "True" if kind is bool else kind(text)

    return read


def _writer(name: str, limits: list[Any]) -> Callable[[Any, Any], None]:
    def write(self: Any, value: Any) -> None:
        for limit in limits:
            limit.validate(value)
        self.parameterNode.SetParameter(name, str(value))

    return write


def _connect(self: Any, gui: Any, types: dict[str, Any]) -> int:
    """Bind every widget that is an attribute of `gui` and names a parameter."""
    widgets = {widget.property(PROPERTY): widget for widget in vars(gui).values() if widget.property(PROPERTY)}
    connectors = {name: _Connector(widget, *_split(types[name])) for name, widget in widgets.items()}
    updating = False
    tag = len(self._connections)

    def to_widgets(*_: Any) -> None:
        nonlocal updating
        if not updating and tag in self._connections:
            updating = True
            for name, connector in connectors.items():
                connector.write(getattr(self, name))
            updating = False

    def to_parameter(name: str) -> None:
        if not updating:
            setattr(self, name, connectors[name].read())

    self._connections[tag] = list(connectors.values())
    to_widgets()
    for name, connector in connectors.items():
        connector.connect(lambda *_, name=name: to_parameter(name))
    self.AddObserver(vtk.vtkCommand.ModifiedEvent, to_widgets)
    return tag


def _disconnect(self: Any, tag: int) -> None:
    """The widgets alone: Slicer 5.10 goes on to observe the node."""
    for connector in self._connections.pop(tag):
        connector.disconnect()


class _Connector:
    """Reads and writes a widget of one of the four kinds that are known."""

    def __init__(self, widget: Any, kind: type, limits: list[Any]) -> None:
        self._widget = widget
        self._callback: Any = None
        if isinstance(widget, QComboBox) and kind is str:
            (choice,) = limits
            self._choices = choice.choices
            widget.clear()
            widget.addItems(self._choices)
        elif isinstance(widget, (QSpinBox, ctkSliderWidget)) and kind in (int, float):
            (within,) = limits
            self._limit(within)
        elif not (isinstance(widget, QCheckBox) and kind is bool):
            raise RuntimeError(f"cannot connect {type(widget)} to {kind}")

    def read(self) -> Any:
        if isinstance(self._widget, QComboBox):
            return self._choices[self._widget.currentIndex()]
        if isinstance(self._widget, QCheckBox):
            return self._widget.isChecked()
        return self._widget.value() if isinstance(self._widget, QSpinBox) else self._widget.value

    def write(self, value: Any) -> None:
        if isinstance(self._widget, QComboBox):
            self._widget.setCurrentIndex(self._choices.index(value))
        elif isinstance(self._widget, QCheckBox):
            self._widget.setChecked(value)
        elif isinstance(self._widget, QSpinBox):
            self._widget.setValue(value)
        else:
            self._widget.value = value

    def connect(self, callback: Callable[..., None]) -> None:
        self._callback = callback
        self._signal().connect(callback)

    def disconnect(self) -> None:
        self._signal().disconnect(self._callback)

    def _signal(self) -> SignalInstance:
        if isinstance(self._widget, QComboBox):
            return self._widget.currentIndexChanged
        return self._widget.toggled if isinstance(self._widget, QCheckBox) else self._widget.valueChanged

    def _limit(self, within: WithinRange) -> None:
        if isinstance(self._widget, QSpinBox):
            self._widget.setRange(int(within.minimum), int(within.maximum))
        else:
            self._widget.minimum, self._widget.maximum = within.minimum, within.maximum
