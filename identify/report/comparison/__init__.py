"""Two results folders side by side: what changed, and whether the change is larger than both intervals."""

from identify.report.comparison.page import comparison_html
from identify.report.comparison.saved import SavedResult, read_saved
from identify.report.comparison.section import Section
from identify.report.comparison.sections import compare
from identify.report.comparison.text import TEXT_WIDTH, comparison_text

__all__ = ["TEXT_WIDTH", "SavedResult", "Section", "compare", "comparison_html", "comparison_text", "read_saved"]
