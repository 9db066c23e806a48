"""The four widgets of CTK that the panel uses, looking and behaving near enough."""

from __future__ import annotations

from PySide6.QtCore import Property, QChildEvent, QEvent, QObject, QPoint, QSize, Qt, Signal
from PySide6.QtGui import QFontMetrics, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QDoubleSpinBox,
    QHBoxLayout,
    QLineEdit,
    QSizePolicy,
    QSlider,
    QStyle,
    QStyleOption,
    QStyleOptionButton,
    QToolButton,
    QWidget,
)

_SLIDER_STEPS = 10_000
HANDLE = 11


class ctkCollapsibleButton(QAbstractButton):  # noqa: N801
    """A button with its children below it, which it hides when it is collapsed."""

    contentsCollapsed = Signal(bool)  # noqa: N815

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._collapsed = False
        self._waiting: set[QWidget] = set()
        self._puts_away = False
        self.setSizePolicy(QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Preferred)
        self.setContentsMargins(0, self._header(), 0, 0)
        self.clicked.connect(lambda: self._set_collapsed(not self._collapsed))

    def _set_collapsed(self, collapsed: bool) -> None:
        self._collapsed = collapsed
        for child in self._children() if collapsed else ():
            if not child.isHidden():
                self._put_away(child)
        if not collapsed:
            waiting, self._waiting = self._waiting, set()
            for child in waiting:
                child.show()
        self.setMaximumHeight(self._header() if collapsed else 16777215)
        self.updateGeometry()
        self.contentsCollapsed.emit(collapsed)

    collapsed = Property(bool, lambda self: self._collapsed, _set_collapsed)

    def childEvent(self, event: QChildEvent) -> None:  # noqa: N802
        """A child that comes to a collapsed button is hidden like the others."""
        child = event.child()
        if event.type() == QEvent.Type.ChildPolished and isinstance(child, QWidget):
            child.installEventFilter(self)
            if self._collapsed:
                self._put_away(child)

    def eventFilter(self, child: QObject, event: QEvent) -> bool:  # noqa: N802
        """Who shows or hides a child while the button is collapsed decides what is seen when it opens."""
        if self._collapsed and not self._puts_away and isinstance(child, QWidget):
            if event.type() == QEvent.Type.ShowToParent:
                self._put_away(child)
            elif event.type() == QEvent.Type.HideToParent:
                self._waiting.discard(child)
        return False

    def _put_away(self, child: QWidget) -> None:
        self._waiting.add(child)
        self._puts_away = True
        child.hide()
        # Otherwise, Qt would ignore that somebody else hides it.
        child.setAttribute(Qt.WidgetAttribute.WA_WState_ExplicitShowHide, False)
        self._puts_away = False

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the button, with an arrow that says whether it is open."""
        painter, option, arrow = QPainter(self), QStyleOptionButton(), QStyleOption()
        option.initFrom(self)
        option.rect = self.rect().adjusted(0, 0, 0, self._header() - self.height())
        option.features = QStyleOptionButton.ButtonFeature.None_
        self.style().drawControl(QStyle.ControlElement.CE_PushButtonBevel, option, painter, self)
        arrow.initFrom(self)
        arrow.rect = option.rect.adjusted(6, 6, 0, -6)
        arrow.rect.setWidth(arrow.rect.height())
        direction = "Right" if self._collapsed else "Down"
        element = getattr(QStyle.PrimitiveElement, f"PE_IndicatorArrow{direction}")
        self.style().drawPrimitive(element, arrow, painter, self)
        painter.drawText(option.rect.adjusted(26, 0, 0, 0), Qt.AlignmentFlag.AlignVCenter, self.text())

    def hitButton(self, position: QPoint) -> bool:  # noqa: N802
        """Only the header is the button."""
        return position.y() < self._header()

    def sizeHint(self) -> QSize:  # noqa: N802
        """The layout's, and the header's."""
        return QWidget.sizeHint(self)

    def minimumSizeHint(self) -> QSize:  # noqa: N802
        """The layout's, and the header's."""
        return QWidget.minimumSizeHint(self)

    def _header(self) -> int:
        return QFontMetrics(self.font()).height() + 10

    def _children(self) -> list[QWidget]:
        return [child for child in self.children() if isinstance(child, QWidget)]


class ctkSliderWidget(QWidget):  # noqa: N801
    """A slider and a spin box for the same number."""

    valueChanged = Signal(float)  # noqa: N815

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._spin_box, self._slider = QDoubleSpinBox(self), QSlider(Qt.Orientation.Horizontal, self)
        self._slider.setMaximum(_SLIDER_STEPS)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._slider)
        layout.addWidget(self._spin_box)
        self._slider.sliderMoved.connect(self._on_slider)
        self._spin_box.valueChanged.connect(self._on_value)

    def _on_slider(self, position: int) -> None:
        low, high = self._spin_box.minimum(), self._spin_box.maximum()
        self._spin_box.setValue(low + (high - low) * position / _SLIDER_STEPS)

    def _on_value(self, value: float) -> None:
        self._place_slider()
        self.valueChanged.emit(value)

    def _place_slider(self) -> None:
        low, high = self._spin_box.minimum(), self._spin_box.maximum()
        self._slider.setValue(round(_SLIDER_STEPS * (self._spin_box.value() - low) / (high - low or 1.0)))

    def _set_minimum(self, minimum: float) -> None:
        self._spin_box.setMinimum(minimum)
        self._place_slider()

    def _set_maximum(self, maximum: float) -> None:
        self._spin_box.setMaximum(maximum)
        self._place_slider()

    value = Property(float, lambda self: self._spin_box.value(), lambda self, value: self._spin_box.setValue(value))
    minimum = Property(float, lambda self: self._spin_box.minimum(), _set_minimum)
    maximum = Property(float, lambda self: self._spin_box.maximum(), _set_maximum)
    decimals = Property(int, lambda self: self._spin_box.decimals(), lambda self, n: self._spin_box.setDecimals(n))
    singleStep = Property(  # noqa: N815
        float, lambda self: self._spin_box.singleStep(), lambda self, step: self._spin_box.setSingleStep(step)
    )
    suffix = Property(str, lambda self: self._spin_box.suffix(), lambda self, text: self._spin_box.setSuffix(text))
    spinBoxVisible = Property(  # noqa: N815
        bool, lambda self: self._spin_box.isVisibleTo(self), lambda self, visible: self._spin_box.setVisible(visible)
    )


class ctkDoubleRangeSlider(QWidget):  # noqa: N801
    """Two handles on one line. Neither gets beyond the line's ends, nor past the other one."""

    minimumValueChanged = Signal(float)  # noqa: N815
    maximumValueChanged = Signal(float)  # noqa: N815
    rangeChanged = Signal(float, float)  # noqa: N815

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._minimum, self._maximum, self._step = 0.0, 99.0, 1.0
        self._low, self._high = 0.0, 99.0
        self._orientation = Qt.Orientation.Vertical

    def setRange(self, minimum: float, maximum: float) -> None:  # noqa: N802
        """Set the line's ends."""
        before, (self._minimum, self._maximum) = (self._minimum, self._maximum), sorted((minimum, maximum))
        if before != (self._minimum, self._maximum):
            self.rangeChanged.emit(self._minimum, self._maximum)
        self.setValues(self._low, self._high)

    def setValues(self, low: float, high: float) -> None:  # noqa: N802
        """Set both handles."""
        before = self._low, self._high
        self._low, self._high = (min(max(value, self._minimum), self._maximum) for value in sorted((low, high)))
        if self._low != before[0]:
            self.minimumValueChanged.emit(self._low)
        if self._high != before[1]:
            self.maximumValueChanged.emit(self._high)
        self.update()

    def _set_step(self, step: float) -> None:
        if self._minimum != self._maximum and not 2.3e-16 <= step <= self._maximum - self._minimum:
            raise ValueError(f"CTK warns that a step of {step} is outside of valid bounds, and goes on with the one before")
        self._step = step

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the line, what lies between the handles, and these."""
        painter, room, middle = QPainter(self), self.width() - HANDLE, self.height() // 2
        span = (self._maximum - self._minimum) or 1.0
        left, right = (round(room * (value - self._minimum) / span) for value in (self._low, self._high))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().mid())
        painter.drawRect(HANDLE // 2, middle - 2, room, 4)
        painter.setBrush(self.palette().highlight() if self.isEnabled() else self.palette().mid())
        painter.drawRect(HANDLE // 2 + left, middle - 2, right - left, 4)
        for x in (left, right):
            painter.setBrush(self.palette().button())
            painter.setPen(self.palette().dark().color())
            painter.drawRect(x, middle - 8, HANDLE - 1, 16)

    def sizeHint(self) -> QSize:  # noqa: N802
        """As high as a slider."""
        return QSize(84, 22)

    minimumValue = Property(float, lambda self: self._low, lambda self, low: self.setValues(low, max(low, self._high)))  # noqa: N815
    maximumValue = Property(float, lambda self: self._high, lambda self, high: self.setValues(min(high, self._low), high))  # noqa: N815
    minimum = Property(float, lambda self: self._minimum, lambda self, end: self.setRange(end, self._maximum))
    maximum = Property(float, lambda self: self._maximum, lambda self, end: self.setRange(self._minimum, end))
    singleStep = Property(float, lambda self: self._step, _set_step)  # noqa: N815
    orientation = Property(Qt.Orientation, lambda self: self._orientation, lambda self, o: setattr(self, "_orientation", o))


class ctkPathLineEdit(QWidget):  # noqa: N801
    """A path, typed or chosen: announced at every letter, whether it exists or not. What its button opens is files."""

    currentPathChanged = Signal(str)  # noqa: N815

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._line_edit, browse = QLineEdit(self), QToolButton(self)
        browse.setText("…")
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._line_edit)
        layout.addWidget(browse)
        self._line_edit.textChanged.connect(self.currentPathChanged.emit)

    currentPath = Property(  # noqa: N815
        str, lambda self: self._line_edit.text(), lambda self, path: self._line_edit.setText(path)
    )
