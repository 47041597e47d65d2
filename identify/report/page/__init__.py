"""report.html: one self-contained page that shows what was measured, found and left unexplained."""

from identify.report.page.html import report_html

__all__ = ["report_html"]
