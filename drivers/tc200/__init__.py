"""The temperature controller Thorlabs TC200: the example of another maker's device behind the same interface."""
