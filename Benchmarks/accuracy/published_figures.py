"""What the paper reports (Engel, Sick & Ropinski 2024) on CT-ORG.

Another data set, with its own user: no comparison of methods, but what ours is to be seen beside.
"""

from __future__ import annotations

DATA_SET = "CT-ORG, another data set"

IOU_BY_CLASS = {
    "Ours": {"liver": 0.957, "bladder": 0.999, "lung": 0.980, "kidney": 0.994, "bone": 0.975},
    "SAM-Med3D (t)": {"liver": 0.968, "bladder": 0.972, "lung": 0.975, "kidney": 0.997, "bone": 0.872},
    "SAM-Med3D (o)": {"liver": 0.948, "bladder": 0.975, "lung": 0.847, "kidney": 0.917, "bone": 0.847},
    "RF": {"liver": 0.038, "bladder": 0.034, "lung": 0.304, "kidney": 0.027, "bone": 0.151},
    "SVM": {"liver": 0.0, "bladder": 0.019, "lung": 0.0, "kidney": 0.0, "bone": 0.127},
}
"""5.2 annotations a class on average."""

BY_ANNOTATIONS = (
    (5.2, "Ours", {"precision": 0.989, "recall": 0.990, "dice": 0.990, "iou": 0.981}),
    (5.2, "SAM-Med3D (t)", {"precision": 0.980, "recall": 0.979, "dice": 0.977, "iou": 0.957}),
    (5.2, "SAM-Med3D (o)", {"precision": 0.932, "recall": 0.976, "dice": 0.950, "iou": 0.906}),
    (5.2, "RF", {"precision": 0.329, "recall": 0.509, "dice": 0.296, "iou": 0.218}),
    (5.2, "SVM", {"precision": 0.181, "recall": 0.405, "dice": 0.180, "iou": 0.139}),
    (1024, "RF", {"precision": 0.472, "recall": 0.931, "dice": 0.587, "iou": 0.440}),
    (1024, "SVM", {"precision": 0.340, "recall": 0.859, "dice": 0.399, "iou": 0.283}),
    (2048, "RF", {"precision": 0.512, "recall": 0.943, "dice": 0.630, "iou": 0.483}),
    (2048, "SVM", {"precision": 0.356, "recall": 0.883, "dice": 0.425, "iou": 0.306}),
    (8192, "RF", {"precision": 0.567, "recall": 0.962, "dice": 0.686, "iou": 0.545}),
    (8192, "SVM", {"precision": 0.390, "recall": 0.909, "dice": 0.473, "iou": 0.348}),
)
"""Annotations a class, method, and means over the classes; its F1 score is the Dice coefficient."""

SECONDS = (
    ("64³", "Ours", "13.5", "0.01"),
    ("128³", "Ours, refined", "14.4", "0.10"),
    ("256³", "Ours, refined", "25.7", "0.37"),
    ("512³", "Ours, refined", "132.1", "5.33"),
    ("512³", "RF, 5.2 annotations", "–", "172"),
    ("512³", "SVM, 5.2 annotations", "–", "323"),
    ("512³", "RF, 4096 annotations", "–", "432"),
    ("512³", "SVM, 4096 annotations", "–", "71500"),
)
"""Resolution, method, preprocessing, inference of a class; on the authors' machine with a GPU."""
