"""What a run looks like.  matplotlib, which is heavy, is imported nowhere else."""
