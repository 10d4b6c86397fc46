"""Success predicates: what must be true at the end of a run, judged by ground truth."""

from bestman_bt.evaluation.predicates.judge import PREDICATES, Judge, find_judge
from bestman_bt.evaluation.predicates.verdict import Evidence, Predicate, Verdict

__all__ = ["PREDICATES", "Evidence", "Judge", "Predicate", "Verdict", "find_judge"]
