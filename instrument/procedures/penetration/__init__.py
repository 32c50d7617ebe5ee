"""Bench procedure `penetration`: how much too far the radar reads on bone or tissue, from a half painted piece."""
