"""Success predicates: what must be true at the end of a run, judged by ground truth."""

from bestman_bt.evaluation.predicates.judge import METRICS, PREDICATES, Judge, find_judge, metric_names, subjects
from bestman_bt.evaluation.predicates.verdict import Evidence, Predicate, Verdict

__all__ = [
    "METRICS",
    "PREDICATES",
    "Evidence",
    "Judge",
    "Predicate",
    "Verdict",
    "find_judge",
    "metric_names",
    "subjects",
]
