"""The bench as the controller sees it: devices opened by URL, examined, found on their ports."""
