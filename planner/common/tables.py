"""Results as tables: read item by item as before, shown short, and handed over as a data frame on request."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    import polars as pl

T = TypeVar("T")
Row = dict[str, Any]
"""One row: its values by the names of the columns, which hold the unit."""


class TableView(Generic[T]):
    """What tables share.

    Args:
        items: what is in the rows.
        row_of: the row of an item.
    """

    def __init__(self, items: Sequence[T], row_of: Callable[[T], Row]) -> None:
        self._items, self._row_of = tuple(items), row_of

    def to_frame(self) -> "pl.DataFrame":
        """Return the table as a data frame of polars (``.to_pandas()`` makes one of pandas of it)."""
        import polars as pl  # others load quicker without

        return pl.DataFrame([self._row_of(item) for item in self._items], infer_schema_length=None)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        """Return a short description without the numbers."""
        columns = ", ".join(self._row_of(self._items[0])) if self._items else "empty"
        return f"<{type(self).__name__}: {len(self)} rows of {columns}>"

    def _repr_html_(self) -> str:
        return str(self.to_frame()._repr_html_())


class RowTable(TableView[T], Sequence[T]):
    """A table whose rows are read by number."""

    @overload
    def __getitem__(self, k: int) -> T: ...

    @overload
    def __getitem__(self, k: slice) -> Sequence[T]: ...

    def __getitem__(self, k: int | slice) -> T | Sequence[T]:
        """Return an item, or several."""
        return self._items[k]


class NamedTable(TableView[T], Mapping[str, T]):
    """A table whose rows are read by name.

    Args:
        items: what is in the rows.
        row_of: the row of an item.
        name_of: the name of an item.
    """

    def __init__(self, items: Sequence[T], row_of: Callable[[T], Row], name_of: Callable[[T], str]) -> None:
        super().__init__(items, row_of)
        self._by_name = {name_of(item): item for item in items}

    def __getitem__(self, name: str) -> T:
        """Return the item of a name."""
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)
