"""The kinds of records in an MCAP file, and what every file and record begins with."""

from __future__ import annotations

from pushplan.util.names import LOG_MAGIC

MAGIC = LOG_MAGIC

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT, ATTACHMENT_INDEX, STATISTICS = 0x07, 0x08, 0x09, 0x0A, 0x0B
METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = 0x0C, 0x0D, 0x0E, 0x0F

PREFIX = 9
"""Bytes before the content of a record: its kind and its length."""
