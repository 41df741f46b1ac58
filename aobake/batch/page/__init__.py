"""The page of a batch: report.html, and report_files/ beside it for what one file should not hold."""

from __future__ import annotations

from aobake.batch.page.beside import files_beside, keep_viewer
from aobake.batch.page.page import write_page

__all__ = ["files_beside", "keep_viewer", "write_page"]
