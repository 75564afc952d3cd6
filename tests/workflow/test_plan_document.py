"""``plan.json`` is typed through: nothing of it is a table of anything, and nothing of it is lost in reading."""

import json
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from planner.circular.document import CircularDocument
from planner.common.errors import InputError
from planner.session.document import PlanDocument, read_plan

OLDER = Path(__file__).parents[1] / "data" / "kr6-plan" / "plan.json"


def kinds_in(annotation):
    """All types of a field, those of the models that it holds included."""
    yield annotation
    for part in get_args(annotation):
        yield from kinds_in(part)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for field in annotation.model_fields.values():
            yield from kinds_in(field.annotation)


@pytest.mark.parametrize("document", [PlanDocument, CircularDocument])
def test_every_key_has_a_type(document):
    kinds = list(kinds_in(document))
    assert len(kinds) > 50
    assert not [k for k in kinds if k in (Any, object, dict)]


def test_an_older_plan_is_read_whole():
    content = json.loads(OLDER.read_text())
    assert json.dumps(read_plan(OLDER).content()) == json.dumps(content)


def test_a_wrong_number_of_a_plan_is_named(tmp_path):
    content = json.loads(OLDER.read_text())
    content["observability"]["on_grid"]["gap"] = "small"
    (tmp_path / "plan.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"'observability.on_grid.gap' = 'small': a number is needed"):
        read_plan(tmp_path / "plan.json")
