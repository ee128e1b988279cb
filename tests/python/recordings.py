"""Reader of recordings: contents of an .rrd file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from rerun.chunk import RrdReader

from pendmap import viewer

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr


class ReadBack:
    """A recording read from its file."""

    def __init__(self, path: Path) -> None:
        reader = RrdReader(path)
        self.columns: dict[str, dict[str, list[Any]]] = {}
        self.recordings = reader.recordings()
        for chunk in reader.stream():
            batch = chunk.to_record_batch()
            entity = self.columns.setdefault(chunk.entity_path, {})
            for name in batch.schema.names:
                column = batch.column(name)
                entity[name] = entity.get(name, []) + column.to_pylist()
        self.views: dict[str, str] = {}
        for store in reader.blueprints():
            for chunk in reader.stream(store=store):
                batch = chunk.to_record_batch()
                if "ViewBlueprint:space_origin" in batch.schema.names:
                    origin = batch.column("ViewBlueprint:space_origin").to_pylist()[0][0]
                    name = batch.column("ViewBlueprint:display_name").to_pylist()[0][0]
                    self.views[origin] = name

    def one(self, entity: str, component: str) -> Any:  # noqa: ANN401 (any logged value)
        """Return the only value of a static component."""
        (row,) = self.columns[entity][component]
        return row[0] if len(row) == 1 else row

    def image(self, entity: str, archetype: str, kind: type) -> npt.NDArray[Any]:
        """Return the image of an entity, with numbers of the given ``kind``."""
        shape = self.one(entity, f"{archetype}:format")
        buffer = np.asarray(self.one(entity, f"{archetype}:buffer"), dtype=np.uint8)
        return buffer.view(kind).reshape(shape["height"], shape["width"])

    def rows(self, entity: str, component: str) -> npt.NDArray[np.float64]:
        """Return the values of a column, one per instant."""
        return np.array([row[0] for row in self.columns[entity][component]], dtype=float)

    def seconds(self, entity: str) -> npt.NDArray[np.float64]:
        """Return the instants on the timeline, s."""
        times = self.columns[entity]["sim_time"]
        return np.array([t.total_seconds() for t in times])

    def names(self, entity: str) -> dict[int, str]:
        """Return the names of an entity's classes."""
        context = self.columns[entity]["AnnotationContext:context"][0][0]
        return {e["class_id"]: e["class_description"]["info"]["label"] for e in context}


def recorded(dataset: xr.Dataset, folder: Path) -> ReadBack:
    return ReadBack(viewer.record(dataset, folder / "a.rrd"))
