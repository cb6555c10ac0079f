"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.reporting.pages import (
    correlation_report as correlation_report,
    page_to_pdf as page_to_pdf,
    qualification_report as qualification_report,
    study_report as study_report,
)
from thermid.reporting.pictures import picture as picture
