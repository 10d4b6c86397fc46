from __future__ import annotations

from tests.navigation.conftest import kitchen
from tests.perception.conftest import table

__all__ = ["kitchen", "table"]
