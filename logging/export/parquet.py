"""The samples of an execution as a Parquet file, with what the run was in its metadata."""

from __future__ import annotations

import io
from pathlib import Path

from pushplan.logging.export.csv import table
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.util.extras import optional
from pushplan.util.outputs.write import write_whole


def write_parquet(run: RecordedRun, path: Path | str) -> None:
    """Write the columns of `table` as Parquet; the log's metadata become the schema's.

    Raises:
        MissingExtraError: When pyarrow is not installed.
        PushplanError: When nothing was executed.
        OutputError: When the file cannot be written.
    """
    arrow = optional("pyarrow", "a Parquet file", "pyarrow", "parquet")
    parquet = optional("pyarrow.parquet", "a Parquet file", "pyarrow", "parquet")
    words = {f"{name}.{key}": value for name, group in run.words.items() for key, value in group.items()}
    columns = arrow.table(table(run)).replace_schema_metadata(words)
    buffer = io.BytesIO()
    parquet.write_table(columns, buffer, compression="zstd")
    write_whole(path, buffer.getvalue())
