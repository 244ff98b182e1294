"""The hand-made plan the tests share."""

from pathlib import Path

import pytest

from chassis_fmu import plan

HERE = Path(__file__).parent


@pytest.fixture
def scenario() -> plan.Plan:
    return plan.parse((HERE / "plan.json").read_text(encoding="utf-8"), HERE)
