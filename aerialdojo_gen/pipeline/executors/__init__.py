"""Where tasks are computed: in processes of this machine, or on a Ray cluster."""
