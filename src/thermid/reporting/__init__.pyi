"""The public names with their types; written by scripts/write_stub.py from the tables in `thermid/__init__.py`."""

from thermid.reporting.blocks.extras import page_to_pdf as page_to_pdf
from thermid.reporting.pages.study import Structure as Structure
from thermid.reporting.pages.study import structures_report as structures_report
from thermid.reporting.pages.study import study_report as study_report
from thermid.reporting.pictures.trust import picture as picture
from thermid.reporting.qualification.page import correlation_report as correlation_report
from thermid.reporting.qualification.page import qualification_report as qualification_report
