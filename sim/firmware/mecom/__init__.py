"""The temperature controller's firmware and its control loop."""
