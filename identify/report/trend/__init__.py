"""How the results of one rig change from campaign to campaign."""

from identify.report.trend.page import trend_html
from identify.report.trend.series import Campaign, Estimate

__all__ = ["Campaign", "Estimate", "trend_html"]
