"""What plans, their executions and the runs of both are made of."""
