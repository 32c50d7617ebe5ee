"""The command `picoradar`: one module a subcommand. The only room that may put the simulated bench together."""
