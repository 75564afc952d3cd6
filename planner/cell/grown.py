"""Sections of the cell file that have grown since plans were first written from it."""

from typing import ClassVar

from pydantic import SerializerFunctionWrapHandler, model_serializer

from planner.schema import Strict


class Grown(Strict):
    """A section with keys that came later: they are written only where they are set, so that older cells stay alike."""

    LATER: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, object]:
        out: dict[str, object] = handler(self)
        fields = type(self).model_fields
        return {k: v for k, v in out.items() if k not in self.LATER or getattr(self, k) != fields[k].default}
