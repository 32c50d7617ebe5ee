"""Bench procedures `gray-target` and `templates`: timing walk and pulse shapes from gray cards."""
