"""One line of a scan: what crosses from the acquisition to its sinks."""
