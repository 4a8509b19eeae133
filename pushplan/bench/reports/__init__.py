"""What results say: the page of a report, its statistics, and comparisons."""
