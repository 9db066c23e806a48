"""`qt` as Slicer has it: the classes of several Qt modules under one name."""

from __future__ import annotations

from PySide6 import QtCore, QtGui, QtUiTools, QtWidgets

from ViTTransferFunction.Testing.support.standin import ctk
from ViTTransferFunction.Testing.support.standin.node_combo_box import qMRMLNodeComboBox
from ViTTransferFunction.Testing.support.standin.segmentation_widgets import qMRMLSegmentationShow3DButton

for _module in (QtCore, QtGui, QtWidgets):
    globals().update({name: getattr(_module, name) for name in dir(_module) if name.startswith("Q")})

# Read by `slicer.util.childWidgetVariables`; PythonQt gives every object this second name for `objectName`.
setattr(QtCore.QObject, "name", property(lambda self: self.objectName()))  # noqa: B010  (type checkers know no such name)

# PythonQt's name of what runs a dialog, and the one that Slicer's own files use.
for _dialog in (QtWidgets.QDialog, QtWidgets.QMessageBox):
    setattr(_dialog, "exec_", _dialog.exec)  # noqa: B010

# PythonQt returns the file alone, and not with the kind that was chosen.
QFileDialog = QtWidgets.QFileDialog
for _name in ("getSaveFileName", "getOpenFileName"):
    _ask = getattr(QFileDialog, _name)
    setattr(QFileDialog, _name, staticmethod(lambda *arguments, _ask=_ask: _ask(*arguments)[0]))


class QUiLoader(QtUiTools.QUiLoader):
    """Knows the widgets of CTK and Slicer."""

    def __init__(self) -> None:
        super().__init__()
        of_ctk = (ctk.ctkCollapsibleButton, ctk.ctkSliderWidget, ctk.ctkDoubleRangeSlider, ctk.ctkPathLineEdit)
        for widget in (*of_ctk, qMRMLNodeComboBox, qMRMLSegmentationShow3DButton):
            self.registerCustomWidget(widget)
