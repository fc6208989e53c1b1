"""The record that is written to see whether the store can be written."""

from datetime import datetime

from sqlalchemy.orm import Mapped, mapped_column

from service.store.record import Record


class ProbeRecord(Record):
    """One row, written anew to see whether the store can be written."""

    __tablename__ = "store_probes"

    id: Mapped[int] = mapped_column(primary_key=True)
    written_at: Mapped[datetime]
