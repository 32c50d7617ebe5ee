"""The robust method: the schedule of search and fit, and the second solution without dark points."""
