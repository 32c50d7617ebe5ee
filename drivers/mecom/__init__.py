"""The temperature controller Meerstetter TEC-1091, over MeCom."""
