"""One process a run: started by a fork server or a cluster, limited, and judged when it ends."""
