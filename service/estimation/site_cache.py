"""Sites that a worker has read: what the tracks of a camera are scored and charted by."""

from collections import OrderedDict
from dataclasses import fields, is_dataclass
from threading import Lock
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import ChartBasis, chart_basis
from models.errors import CheckpointError
from models.pose import CameraSite, chart_from_bytes, paths_from_bytes, reference_from_bytes
from service.store import cameras
from service.store.cameras import CameraRecord
from service.store.monitor_states import Inputs
from service.store.references import FlowMapRecord, SiteReferenceRecord

_MOST_BYTES = 128 * 2**20
_Site = tuple[Any, ...]


class SiteCache:
    """The bases of the charts that were used last, up to so many bytes of arrays."""

    def __init__(self, most_bytes: int = _MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._kept: OrderedDict[_Site, tuple[ChartBasis, int]] = OrderedDict()
        self._lock = Lock()

    def basis_of(
        self,
        session: Session,
        camera: CameraRecord,
        reference: SiteReferenceRecord,
        inputs: Inputs,
    ) -> ChartBasis | None:
        """The basis of a camera's chart; None if it has none that this release can read."""
        site = (
            camera.id,
            camera.intrinsics,
            reference.id,
            reference.prior_pose_id,
            inputs.map_learned_at,
        )
        with self._lock:
            if site in self._kept:
                self._kept.move_to_end(site)
                return self._kept[site][0]
        basis = _read(session, camera, reference)
        if basis is not None:
            self._keep(site, basis)
        return basis

    def _keep(self, site: _Site, basis: ChartBasis) -> None:
        size = array_bytes(basis)
        with self._lock:
            if site in self._kept:
                return
            self._kept[site] = basis, size
            self._bytes += size
            while self._bytes > self._most_bytes and len(self._kept) > 1:
                _, (_, dropped) = self._kept.popitem(last=False)
                self._bytes -= dropped


def array_bytes(value: Any) -> int:
    """Bytes of the arrays in a dataclass, at any depth."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, tuple):
        return sum(array_bytes(part) for part in value)
    if is_dataclass(value):
        return sum(array_bytes(getattr(value, field.name)) for field in fields(value))
    return 0


def _read(
    session: Session, camera: CameraRecord, reference: SiteReferenceRecord
) -> ChartBasis | None:
    kept = session.get(FlowMapRecord, reference.id)
    if reference.data is None or kept is None or kept.data is None or kept.chart is None:
        return None
    try:
        return chart_basis(
            CameraSite(
                intrinsics=camera.intrinsics,
                prior=cameras.prior_pose(session, camera.id).pose,
                speed_reference=reference_from_bytes(reference.data),
                paths=paths_from_bytes(kept.data),
                chart=chart_from_bytes(kept.chart),
            )
        )
    except CheckpointError:
        return None
