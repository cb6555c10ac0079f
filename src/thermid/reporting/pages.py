"""Report pages, and the blocks that they are made of."""

from thermid.reporting._blocks.content import (
    Table as Table,
    check_audience as check_audience,
    check_page as check_page,
    page_to_pdf as page_to_pdf,
    tables_folder as tables_folder,
)
from thermid.reporting._pages.campaign import report as report
from thermid.reporting._pages.study import study_report as study_report
from thermid.reporting._pages.tables import levels as levels
from thermid.reporting._qualification.page import correlation_report as correlation_report, qualification_report as qualification_report
