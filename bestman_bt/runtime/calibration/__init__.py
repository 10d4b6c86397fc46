"""Calibration of a robot's cameras: datasets, recorded or simulated, and what is written for robot files."""

from bestman_bt.runtime.calibration.dataset import Dataset, DatasetConfig, Progress, load_dataset
from bestman_bt.runtime.calibration.result import CalibrationResult
from bestman_bt.runtime.calibration.simulate import Kind, Simulated, compare, simulate
from bestman_bt.runtime.calibration.solve import plot_residuals, solve_hand_eye, solve_head, solve_intrinsics

__all__ = [
    "CalibrationResult",
    "Dataset",
    "DatasetConfig",
    "Kind",
    "Progress",
    "Simulated",
    "compare",
    "load_dataset",
    "plot_residuals",
    "simulate",
    "solve_hand_eye",
    "solve_head",
    "solve_intrinsics",
]
